"""An order that keeps to a tool as long as it may: against all orders there are."""

from __future__ import annotations

from itertools import pairwise, permutations

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph
from decmcts.planning.problem.fewer_changes import ToolRuns, by_tool


def runs_of(
    pairs: list[tuple[int, int]], tool: list[int], stretch: list[int] | None = None
) -> ToolRuns | None:
    graph = DependencyGraph.from_pairs(len(tool), np.array(pairs, np.int32).reshape(-1, 2))
    own = np.zeros(len(tool), np.int32) if stretch is None else np.array(stretch, np.int32)
    return by_tool(graph, np.array(tool, np.int16), own, lambda a, b: True)


def changes(tool: list[int], order: list[int]) -> int:
    return sum(tool[a] != tool[b] for a, b in pairwise(order))


@pytest.mark.parametrize("seed", range(30))
def test_no_order_of_two_tools_has_fewer_changes(seed: int):
    """With the source's first tool at first and its last contour's tool at last."""
    rng = np.random.default_rng(seed)
    n = 7
    tool = rng.integers(0, 2, n).tolist()
    pairs = [(a, b) for b in range(n) for a in range(b) if rng.random() < 0.25]
    runs = runs_of(pairs, tool)
    assert runs is not None
    order = runs.order.tolist()
    place = np.argsort(order)
    assert sorted(order) == list(range(n))
    assert all(place[a] < place[b] for a, b in pairs)
    assert (tool[order[0]], tool[order[-1]]) == (tool[0], tool[-1])
    assert runs.run[-1] == changes(tool, order)
    least = min(
        changes(tool, list(o)) for o in permutations(range(n))
        if all(o.index(a) < o.index(b) for a, b in pairs)
        and (tool[o[0]], tool[o[-1]]) == (tool[0], tool[-1])
    )  # fmt: skip
    assert changes(tool, order) == least


def test_nothing_crosses_a_stretch_and_runs_begin_anew_there():
    """Each stretch begins and ends with its own tools, though one change would do without."""
    runs = runs_of([], [0, 1, 0, 1, 0, 1], [0, 0, 0, 1, 1, 1])
    assert runs is not None
    assert runs.order.tolist() == [0, 1, 2, 3, 4, 5]
    assert runs.run.tolist() == [0, 1, 2, 3, 4, 5]


def test_a_change_that_the_source_never_makes_is_not_made():
    """Of three tools 2 is reached from 1 alone; where no change leads on there is no order."""
    graph = DependencyGraph.from_pairs(3, np.empty((0, 2), np.int32))
    tool, own = np.array([0, 2, 1], np.int16), np.zeros(3, np.int32)
    assert by_tool(graph, tool, own, lambda a, b: (a, b) == (0, 1)) is None


def test_one_tool_and_nothing_at_all():
    """The source's own order; no contour makes no order."""
    one, none = runs_of([(0, 1)], [3, 3]), runs_of([], [])
    assert one is not None and one.order.tolist() == [0, 1] and one.run.tolist() == [0, 0]
    assert none is not None and len(none.order) == 0
