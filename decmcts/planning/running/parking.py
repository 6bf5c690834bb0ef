"""A plan by which heads go to their parks from wherever they stand, one after another.

One that stands at its park has no action; it takes up the plan too, so all know that it stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.planning.replanning.to_park import routes_to_parks, top_of
from decmcts.print.contours import taken
from decmcts.print.machine import Machine, Point
from decmcts.print.metrics import Metrics
from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, JointPlan, PlanDocument


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
    lines = {name: np.array([at], np.float64) for name, at in standing.items()}
    routes = routes_to_parks(machine, lines, fenced, top_of(document.contours, document.printed))
    order = [(route.head, route.path(standing[route.head])) for route in routes]
    gone = {name for name, _ in order}
    order += [(name, np.empty((0, 3))) for name in standing if name not in gone]
    return _document(document, machine, order) if order else None


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
