"""Old orders carried out by those that are left."""

from __future__ import annotations

import numpy as np

from decmcts.experiments.online import Old, retimed
from decmcts.team.dec_mcts.warm_up import smallest_problem
from decmcts.team.engine.plans import StatedOrder

TEAM = smallest_problem()  # contours 0 and 2 lie left, 1 and 3 right; 2 on 0, 3 on 1
N = len(TEAM.macro)
LEFT_FIRST = StatedOrder(
    np.array([0, 1, 2, 3], np.int32), np.zeros(4, np.bool_), np.array([0, 1, 0, 1])
)


def test_an_old_order_is_kept_where_all_heads_live() -> None:
    """Only times change, so who prints what and in which order must not."""
    order, resolved = retimed(TEAM, Old(LEFT_FIRST, np.arange(N), np.array([0, 1])))
    assert order.order.tolist() == LEFT_FIRST.order.tolist()
    assert order.head.tolist() == LEFT_FIRST.head.tolist()
    assert [path.order.tolist() for path in resolved.toolpaths] == [[0, 2], [1, 3]]


def test_what_a_head_leaves_is_printed_by_another() -> None:
    """All of it, once, and what must come before comes before."""
    order, resolved = retimed(TEAM, Old(LEFT_FIRST, np.arange(N), np.array([-1, 1])))
    assert set(order.head.tolist()) <= {0, 1}
    turn = np.argsort(order.order)
    assert sorted(order.order.tolist()) == list(range(N))
    assert turn[0] < turn[2] and turn[1] < turn[3]
    assert sum(len(path) for path in resolved.toolpaths) == N


def test_what_must_come_before_comes_before() -> None:
    """The rest of a print may demand what the whole did not."""
    upside_down = StatedOrder(LEFT_FIRST.order[::-1].copy(), LEFT_FIRST.reversed, LEFT_FIRST.head)
    order, _ = retimed(TEAM, Old(upside_down, np.arange(N), np.array([0, 1])))
    assert order.order.tolist() == [1, 3, 0, 2]
