"""The data type of joint plans: what an action waits for."""

from __future__ import annotations

import numpy as np

from decmcts.print.plan import ACTION_END, ActionKind, After, HeadActions, end_edges


def test_after_names_head_action_point_and_lag():
    """An edge that names no more than an action waits for its end, and no longer."""
    none = np.full(3, -1, np.int32)
    actions = HeadActions(
        "left", np.full(3, ActionKind.WAIT, np.int8), none, none > 0, none + 1, np.arange(4),
        np.zeros((3, 3)), np.arange(3.0), np.arange(3.0), np.array([0, 0, 2, 3]),
        np.array([1, 2, 1], np.int32), np.array([4, 0, 7], np.int32),
        np.array([3, ACTION_END, ACTION_END], np.int32), np.array([0.0, 2.5, 0.0]),
    )  # fmt: skip
    assert actions.after_edges(0) == []
    assert actions.after_edges(1) == [After(1, 4, 3), After(2, 0, lag_s=2.5)]
    assert actions.after_edges(2) == [After(1, 7, ACTION_END, 0.0)]
    assert actions.after(1) == [(1, 4), (2, 0)]


def test_edges_that_wait_for_ends():
    """What today's planners write: no points, no lags, of the right types."""
    point, lag_s = end_edges(2)
    assert point.tolist() == [ACTION_END] * 2 and lag_s.tolist() == [0.0] * 2
    assert point.dtype == np.int32 and lag_s.dtype == np.float64
