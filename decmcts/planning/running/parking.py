"""Heads that go to their parks from wherever they stand, one after another.

A head goes straight up above all that is printed, across, and down at its park. It goes when its
path keeps clear of where all others stand by then, those that failed included. One that stands at
its park has no action; it takes up the plan too, so that all know that it stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.print.contours import taken
from decmcts.print.machine import Head, Machine, Point
from decmcts.print.metrics import Metrics
from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, JointPlan, PlanDocument
from sim.replay.fenced import head_meets

SAME_MM = 1e-6
ABOVE_MM = 1.0  # all that is printed, on the path


def parking_plan(
    document: PlanDocument, machine: Machine, standing: Mapping[str, Point],
    fenced: Mapping[str, Point],
) -> PlanDocument | None:  # fmt: skip
    """Return a plan by which heads go to their parks; None where none is to go.

    Parameters
    ----------
    document : PlanDocument
        The plan that is broken off.
    machine : Machine
        With all heads, those that failed too.
    standing : Mapping[str, Point]
        Where each head stands that is to go, mm, or is at its park.
    fenced : Mapping[str, Point]
        Where each head stands that does not move.

    Raises
    ------
    InputError
        When some head has no clear path.
    """
    top = max(
        float(c.points[:, 2].max(initial=0.0))
        for c in (document.contours, document.printed) if c is not None
    )  # fmt: skip
    places, order = {**fenced, **standing}, list[tuple[str, NDArray[np.float64]]]()
    waiting = [name for name, at in standing.items() if not same_place(at, machine.head(name).park)]
    there = [name for name in standing if name not in waiting]
    while waiting:
        for name in waiting:
            others = {other: at for other, at in places.items() if other != name}
            path = _clear_path(machine, machine.head(name), places[name], others, top + ABOVE_MM)
            if path is not None:
                break
        else:
            raise InputError(
                f"head {waiting[0]} has no clear path to its park",
                advice="move the heads that failed away, and say where they stand",
            )
        waiting.remove(name)
        order.append((name, path))
        places[name] = machine.head(name).park
    order += [(name, np.empty((0, 3))) for name in there]
    return _document(document, machine, order) if order else None


def same_place(a: Point, b: Point) -> bool:
    """Tell whether two places are one, but for rounding."""
    return float(np.abs(np.subtract(a, b)).max()) < SAME_MM


def _clear_path(
    machine: Machine, head: Head, at: Point, others: Mapping[str, Point], height: float
) -> NDArray[np.float64] | None:
    """Return a path to a head's park that keeps clear of the others, None if there is none."""
    z = max(height, at[2], head.park[2])
    for corner in (None, (head.park[0], at[1]), (at[0], head.park[1])):
        points = [at, (at[0], at[1], z)]
        points += [] if corner is None else [(*corner, z)]
        points += [(head.park[0], head.park[1], z), head.park]
        path = np.array([points[0]] + [b for a, b in pairwise(points) if not same_place(a, b)])
        moves = np.concatenate([path[:-1], path[1:]], axis=1)
        if not any(head_meets(machine, head, moves, machine.head(o), p) for o, p in others.items()):
            return path
    return None


def _document(
    document: PlanDocument, machine: Machine, order: list[tuple[str, NDArray[np.float64]]]
) -> PlanDocument:
    """Return paths as a plan in which each head waits for the one before."""
    begin, heads = 0.0, list[HeadActions]()
    for k, (name, path) in enumerate(order):
        length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        end = begin + length / machine.limits_of(machine.head(name)).travel_feed
        n = int(len(path) > 0)  # actions
        m = n * int(k > 0)
        heads.append(
            HeadActions(
                head=name, kind=np.full(n, ActionKind.PARK, np.int8),
                contour=np.full(n, -1, np.int32), reversed=np.zeros(n, np.bool_),
                entry=np.zeros(n, np.int32), path_offsets=np.array([0, len(path)][: n + 1]),
                path=path, begin_s=np.full(n, begin), end_s=np.full(n, end),
                after_offsets=np.array([0, m][: n + 1]),
                after_head=np.full(m, k - 1, np.int32), after_action=np.zeros(m, np.int32),
                after_point=np.full(m, ACTION_END, np.int32), after_lag_s=np.zeros(m),
            )
        )  # fmt: skip
        begin = end
    none = np.empty(0, np.int64)
    return replace(
        document, machine=machine, contours=taken(document.contours, none),
        plan=JointPlan(tuple(heads)), precedence=np.empty((0, 2), np.int32), metrics=Metrics(),
        acceleration=None, printed=None, fenced=None,
    )  # fmt: skip
