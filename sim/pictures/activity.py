"""What a head does over time, in few enough pieces to draw."""

from __future__ import annotations

import numpy as np

from decmcts.print.plan import ActionKind, HeadActions
from sim.arrays import Flags, Floats

EXACT = 400  # actions drawn one by one; with more, shares of equal intervals are drawn
INTERVALS = 800


def activity(actions: HeadActions, makespan_s: float) -> tuple[Floats, Floats]:
    """Return the edges of intervals and the shares of them spent printing and travelling.

    Returns
    -------
    edges : (k + 1,) seconds
    shares : (k, 2) printing, travelling; the rest is waiting
    """
    if len(actions) <= EXACT:
        edges = np.unique(np.concatenate([[0.0, makespan_s], actions.begin_s, actions.end_s]))
    else:
        edges = np.linspace(0.0, makespan_s, INTERVALS + 1)
    if len(edges) < 2:
        return np.array([0.0, 0.0]), np.zeros((1, 2))
    printing = actions.kind == ActionKind.PRINT
    travelling = ~printing & (actions.kind != ActionKind.WAIT)
    width = np.maximum(np.diff(edges), 1e-12)
    columns = [
        np.diff(_time_spent(actions, rows, edges)) / width for rows in (printing, travelling)
    ]
    return edges, np.clip(np.stack(columns, axis=1), 0.0, 1.0)


def _time_spent(actions: HeadActions, rows: Flags, at: Floats) -> Floats:
    """Return the seconds spent in the chosen actions up to each time."""
    if not rows.any():
        return np.zeros(len(at))
    begin, end = actions.begin_s[rows], actions.end_s[rows]
    done = np.cumsum(end - begin)
    times = np.stack([begin, end], axis=1).ravel()
    spent = np.stack([done - (end - begin), done], axis=1).ravel()
    return np.interp(at, times, spent)
