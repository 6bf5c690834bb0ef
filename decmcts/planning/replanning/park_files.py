"""Files that take heads to their parks, one after another, before those of the rest are run.

The files of a rest begin at the parks, and where a print was broken off heads stand elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from glob import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.gcode.writing.park_file import park_gcode
from decmcts.planning.problem.planned import require_passed
from decmcts.planning.problem.source import Source
from decmcts.planning.replanning.to_park import routes_to_parks, top_of
from decmcts.print.contours import taken
from decmcts.print.machine import Machine, Stands, line_of
from decmcts.print.plan import NO_CONTOUR, HeadActions, PlanDocument
from decmcts.print.print_state import HeadState, PrintState, whereabouts
from sim.heads.to_park import Whereabouts, check_to_park

AT_PARK_MM = 0.01
Line = NDArray[np.float64]  # (k, 3) mm, on which a head stands somewhere
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

    Parameters
    ----------
    document : PlanDocument
        The plan that was broken off.
    state : PrintState
        Where heads were seen last; one that was not seen is at its park.
    machine : Machine
        With all heads, those that print no more too.
    fenced : Mapping[str, Stands]
        Heads that do not move, and where they stand.

    Raises
    ------
    InputError
        Where some head has no clear path.
    VerificationError
        Where the files, read back, do not lead there, or not clear of all else.
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
