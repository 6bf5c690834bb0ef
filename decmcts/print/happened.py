"""A plan as it was carried out: its actions at the times at which they happened."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.print.plan import HeadActions, JointPlan, PlanDocument
from decmcts.print.print_events import EventKind, EventLog


def happened(document: PlanDocument, log: EventLog) -> PlanDocument:
    """Return what was carried out of a plan, as a plan of its own, with the times of events.

    Actions that did not end are left out, with all that their heads should have done behind them.
    Actions of which no event tells, such as waits, last until the next one begins.

    Parameters
    ----------
    log : EventLog
        Events of this plan, see `decmcts.print.print_state.state_of_events`.
    """
    times = [_times(actions, log, h) for h, actions in enumerate(document.plan.heads)]
    counts = np.array([len(begin) for begin, _ in times])
    plan = JointPlan(
        tuple(
            _first(actions, begin, end, counts)
            for actions, (begin, end) in zip(document.plan.heads, times, strict=True)
        )
    )
    return replace(document, plan=plan, metrics={"makespan_s": plan.makespan_s})


def _times(
    actions: HeadActions, log: EventLog, h: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return when the actions of a head began and ended, up to the last that ended, (k,) each."""
    begin, end = np.full(len(actions), np.nan), np.full(len(actions), np.nan)
    for event in log.events:
        if event.head == h and 0 <= event.action < len(actions):
            if event.kind is EventKind.BEGAN:
                begin[event.action] = event.time_s
            elif event.kind is EventKind.ENDED:
                end[event.action] = event.time_s
    ended = np.flatnonzero(np.isfinite(end))
    count = int(ended[-1]) + 1 if len(ended) else 0
    begin, end = begin[:count], end[:count]
    last = np.fmax.accumulate(np.concatenate([[0.0], end]))[:-1]  # when what is before has ended
    begin = np.where(np.isfinite(begin), begin, last)
    following = np.append(begin[1:], end[-1:])
    end = np.where(np.isfinite(end), end, following)
    return begin, np.maximum(end, begin)


def _first(
    actions: HeadActions,
    begin: NDArray[np.float64],
    end: NDArray[np.float64],
    counts: NDArray[np.int64],
) -> HeadActions:
    """Return a head's first actions at these times; `counts` says how many each head has."""
    k = len(begin)
    rows, points = int(actions.after_offsets[k]), int(actions.path_offsets[k])
    kept = actions.after_action[:rows] < counts[actions.after_head[:rows]]
    before = np.concatenate([[0], np.cumsum(kept)])
    return HeadActions(
        actions.head, actions.kind[:k], actions.contour[:k], actions.reversed[:k],
        actions.entry[:k], actions.path_offsets[: k + 1], actions.path[:points], begin, end,
        before[actions.after_offsets[: k + 1]], actions.after_head[:rows][kept],
        actions.after_action[:rows][kept], actions.after_point[:rows][kept],
        actions.after_lag_s[:rows][kept],
    )  # fmt: skip
