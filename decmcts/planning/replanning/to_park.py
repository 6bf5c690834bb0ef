"""Routes of heads to their parks from wherever they stand, one after another.

A head goes straight up above all that is printed, across, and down at its park. It goes when its
route keeps clear of wherever all others may stand by then, those that failed included. A route
names the axes that move and no others, so it is one for all places in which its head may stand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.gcode.writing.park_file import AxisWords
from decmcts.print.contours import Contours
from decmcts.print.machine import Head, Machine, Point, Stands, line_of
from sim.replay.fenced import too_near

SAME_MM = 1e-6
ABOVE_MM = 1.0  # all that is printed, on the way across
BOX_MM = 2.0  # length of line that one box stands for, as long as there are
MOST_BOXES = 500  # a head


@dataclass(frozen=True, slots=True)
class Route:
    """How a head goes to its park."""

    head: str
    moves: tuple[AxisWords, ...]

    def path(self, at: Point) -> NDArray[np.float64]:
        """Return the points it leads through from one place, (k, 3); no two alike in turn."""
        points = [np.array(at, np.float64)]
        for words in self.moves:
            to = np.array([p if w is None else w for p, w in zip(points[-1], words, strict=True)])
            if not same_place(to, points[-1]):
                points.append(to)
        return np.array(points)


def same_place(a: Point | NDArray[np.float64], b: Point | NDArray[np.float64]) -> bool:
    """Tell whether two places are one, but for rounding."""
    return float(np.abs(np.subtract(a, b)).max()) < SAME_MM


def top_of(*stands: Contours | None) -> float:
    """Return how high all of this stands, mm; None: nothing."""
    return max(float(c.points[:, 2].max(initial=0.0)) for c in stands if c is not None)


def routes_to_parks(
    machine: Machine, standing: Mapping[str, NDArray[np.float64]], fenced: Mapping[str, Stands],
    top_mm: float,
) -> list[Route]:  # fmt: skip
    """Return routes in the order in which they keep clear; none of heads that are at their parks.

    Parameters
    ----------
    machine : Machine
        With all heads, those that failed too.
    standing : Mapping[str, NDArray]
        Lines on which each head stands somewhere that is to go, (k, 3) mm.
    fenced : Mapping[str, Stands]
        Where each head stands that does not move.
    top_mm : float
        How high all stands that is printed.

    Raises
    ------
    InputError
        When some head has no clear route.
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


def _boxes(line: NDArray[np.float64]) -> NDArray[np.float64]:
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
    machine: Machine, head: Head, places: Mapping[str, NDArray[np.float64]], height: float
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


def _swept(route: Route, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
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
