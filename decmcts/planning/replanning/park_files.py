"""Files that take heads to their parks, one after another, before those of the rest are run.

The files of a rest begin at the parks, and where a print was broken off heads stand elsewhere.

A head goes straight up above all that is printed, across, and down at its park. It goes when its
route keeps clear of wherever all others may stand by then, those that failed included. A route
names the axes that move and no others, so it is one for all places in which its head may stand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from glob import escape
from itertools import pairwise
from pathlib import Path

import numpy as np

from decmcts.arrays import Floats
from decmcts.errors import InputError
from decmcts.formats.gcode.writing.head_files import AxisWords, park_gcode
from decmcts.planning.problem.planned import require_passed
from decmcts.planning.problem.source import Source
from decmcts.print.contours import Contours, taken
from decmcts.print.machine import Head, Machine, Point, Stands, line_of
from decmcts.print.plan import NO_CONTOUR, HeadActions, PlanDocument
from decmcts.print.print_state import HeadState, PrintState, whereabouts
from sim.heads.to_park import Whereabouts, check_to_park
from sim.replay.fenced import too_near

AT_PARK_MM = 0.01
Line = Floats  # (k, 3) mm, on which a head stands somewhere
BEFORE = (
    "No start code, no homing: run it only if this head's controller still knows where the head",
    "is, and all heads stand where this says:",
)


@dataclass(frozen=True, slots=True)
class ParkFile:
    """What takes one head to its park."""

    head: str
    text: bytes


def park_paths(files: tuple[ParkFile, ...], stem: Path) -> list[Path]:
    """Return the names of the files in the order to run them, `STEM-1_HEAD_to_park.gcode`."""
    return [
        stem.with_name(f"{stem.name}-{k}_{one.head}_to_park.gcode")
        for k, one in enumerate(files, 1)
    ]


def refuse_earlier(files: tuple[ParkFile, ...], stem: Path) -> None:
    """Raise InputError where files of an earlier replan would stand beside these, to be run too."""
    there = stem.parent.glob(f"{escape(stem.name)}-*_to_park.gcode")
    if earlier := sorted(set(there) - set(park_paths(files, stem))):
        raise InputError(
            "leads a head to its park from where it stood for an earlier replan",
            path=earlier[0], advice="remove it, or name another stem",
        )  # fmt: skip


def park_files(
    document: PlanDocument, source: Source, state: PrintState, machine: Machine,
    fenced: Mapping[str, Stands],
) -> tuple[ParkFile, ...]:  # fmt: skip
    """Return the files in the order to run them; none where all heads stand at their parks.

    By the `state` heads were seen last; one that was not seen is at its park. `machine` has all
    heads; those that are `fenced` do not move. Raises InputError where some head has no clear path;
    and VerificationError where the files, read back, do not lead there, or not clear of all else.
    """
    lines = _lines(document, state, machine, fenced)
    begun = taken(document.contours, np.flatnonzero(state.done))
    try:
        routes = routes_to_parks(machine, lines, fenced, top_of(begun, document.printed))
    except InputError as error:
        raise InputError(
            f"{error.what} from wherever it may stand",
            advice="take all heads that live to their parks by hand and add --parked, or move "
            "those that failed away and say where they stand",
        ) from error
    files, stands = list[ParkFile](), dict(lines)
    settings, newline = source.job.settings, source.document.newline
    for k, route in enumerate(routes, 1):
        place = f"head {route.head}, file {k} of {len(routes)}: to its park"
        about = [place, *BEFORE, *_stated(route.head, stands, machine, fenced)]
        files.append(ParkFile(route.head, park_gcode(about, route.moves, settings, newline)))
        stands[route.head] = np.array([machine.head(route.head).park])
    if files:
        _require_clear(files, document, state, machine, lines, fenced)
    return tuple(files)


def _lines(
    document: PlanDocument, state: PrintState, machine: Machine, fenced: Mapping[str, Stands]
) -> dict[str, Line]:
    """Return where each head stands that is not fenced."""
    seen = {one.head: (one, actions) for one, actions in _heads(document, state)}
    lines = dict[str, Line]()
    for head in machine.heads:
        if head.name not in fenced:
            park = line = np.array([head.park], np.float64)
            if head.name in seen:
                line = whereabouts(*seen[head.name], head.park)
            lines[head.name] = line if np.abs(line - park).max() > AT_PARK_MM else park
    return lines


def _heads(document: PlanDocument, state: PrintState) -> list[tuple[HeadState, HeadActions]]:
    return list(zip(state.heads, document.plan.heads, strict=True))


def _stated(
    moves: str, stands: Mapping[str, Line], machine: Machine, fenced: Mapping[str, Stands]
) -> list[str]:
    """Return in words where each head stands before a file is run, a line each."""
    found = []
    for head in machine.heads:
        line = stands[head.name] if head.name in stands else line_of(fenced[head.name])
        low, high = line.min(axis=0), line.max(axis=0)
        places = ", ".join(
            f"{axis} {a:.2f}" if b - a <= AT_PARK_MM else f"{axis} {a:.2f} to {b:.2f}"
            for axis, a, b in zip("XYZ", low.tolist(), high.tolist(), strict=True)
        )
        parked = bool(np.abs(line - np.array(head.park)).max() <= AT_PARK_MM)
        what = "at its park" if parked else "fenced" if head.name in fenced else "where it stopped"
        who = "this head" if head.name == moves else f"head {head.name}"
        found.append(f"  {who}, {what}: {places}")
    return found


def _require_clear(
    files: list[ParkFile], document: PlanDocument, state: PrintState, machine: Machine,
    lines: Mapping[str, Line], fenced: Mapping[str, Stands],
) -> None:  # fmt: skip
    """Raise VerificationError unless the judge finds that the files lead heads to their parks."""
    within = {
        one.head: int(actions.contour[one.ended])
        for one, actions in _heads(document, state) if one.begun and one.ended < len(actions)
    }  # fmt: skip
    standing = {
        name: Whereabouts(line, within.get(name, NO_CONTOUR)) for name, line in lines.items()
    }
    standing |= {name: Whereabouts(line_of(at), moves=False) for name, at in fenced.items()}
    texts = [one.text for one in files]
    require_passed(check_to_park(texts, document, machine, state.done, standing))


SAME_MM = 1e-6
ABOVE_MM = 1.0  # all that is printed, on the way across
BOX_MM = 2.0  # length of line that one box stands for, as long as there are
MOST_BOXES = 500  # a head


@dataclass(frozen=True, slots=True)
class Route:
    """How a head goes to its park."""

    head: str
    moves: tuple[AxisWords, ...]

    def path(self, at: Point) -> Floats:
        """Return the points it leads through from one place, (k, 3); no two alike in turn."""
        points = [np.array(at, np.float64)]
        for words in self.moves:
            to = np.array([p if w is None else w for p, w in zip(points[-1], words, strict=True)])
            if not same_place(to, points[-1]):
                points.append(to)
        return np.array(points)


def same_place(a: Point | Floats, b: Point | Floats) -> bool:
    """Tell whether two places are one, but for rounding."""
    return float(np.abs(np.subtract(a, b)).max()) < SAME_MM


def top_of(*stands: Contours | None) -> float:
    """Return how high all of this stands, mm; None: nothing."""
    return max(float(c.points[:, 2].max(initial=0.0)) for c in stands if c is not None)


def routes_to_parks(
    machine: Machine, standing: Mapping[str, Floats], fenced: Mapping[str, Stands], top_mm: float,
) -> list[Route]:  # fmt: skip
    """Return routes in the order in which they keep clear; none of heads that are at their parks.

    `standing` has lines on which each head stands somewhere that is to go, (k, 3) mm; those that
    are `fenced` do not move. All that is printed stands up to `top_mm`. Raises InputError when some
    head has no clear route.
    """
    places = {name: _boxes(line_of(stands)) for name, stands in fenced.items()}
    places |= {name: _boxes(line) for name, line in standing.items()}
    parks = {head.name: np.array([[*head.park, *head.park]]) for head in machine.heads}
    found = list[Route]()
    waiting = [name for name in standing if not same_place(places[name], parks[name])]
    while waiting:
        for name in waiting:
            route = _clear_route(machine, machine.head(name), places, top_mm + ABOVE_MM)
            if route is not None:
                break
        else:
            raise InputError(
                f"head {waiting[0]} has no clear path to its park",
                advice="move the heads that failed away, and say where they stand",
            )
        waiting.remove(name)
        found.append(route)
        places[name] = parks[name]
    return found


def _boxes(line: Floats) -> Floats:
    """Return boxes around pieces of a line, least and most corner, (n, 6)."""
    points = [line[:1]]
    for a, b in pairwise(line):
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / BOX_MM)))
        points.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    fine = np.concatenate(points)
    if len(fine) == 1:
        return np.hstack([fine, fine])
    low, high = np.minimum(fine[:-1], fine[1:]), np.maximum(fine[:-1], fine[1:])
    first = np.unique(np.linspace(0, len(low), MOST_BOXES, endpoint=False).astype(np.int64))
    return np.hstack([np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)])


def _clear_route(
    machine: Machine, head: Head, places: Mapping[str, Floats], height: float
) -> Route | None:
    """Return a route to a head's park that keeps clear of the others, None if there is none."""
    x, y, z = head.park
    lowest = min([0.0, *(body.minimum[2] for body in head.bodies)])
    over = max(height - lowest, float(places[head.name][:, 5].max()), z)
    ways: tuple[tuple[AxisWords, ...], ...] = (
        ((x, y, None),),
        ((x, None, None), (None, y, None)),
        ((None, y, None), (x, None, None)),
    )
    for across in ways:
        route = Route(head.name, ((None, None, over), *across, (None, None, z)))
        swept = _swept(route, places[head.name])
        if not any(
            too_near(machine, head, swept, machine.head(other), boxes).any()
            for other, boxes in places.items() if other != head.name
        ):  # fmt: skip
            return route
    return None


def _swept(route: Route, boxes: Floats) -> Floats:
    """Return boxes around all that a nozzle passes that begins anywhere in `boxes`, (m, 6)."""
    found = []
    for words in route.moves:
        there = boxes.copy()
        for axis, word in enumerate(words):
            if word is not None:
                there[:, [axis, axis + 3]] = word
        low = np.minimum(boxes[:, :3], there[:, :3])
        found.append(np.hstack([low, np.maximum(boxes[:, 3:], there[:, 3:])]))
        boxes = there
    return np.concatenate(found)
