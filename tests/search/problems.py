"""Small problems for the tests of the search."""

from __future__ import annotations

import numpy as np

from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.problem import OrderProblem


def random_problem(
    seed: int, n: int, *, density: float = 0.3, turning: float = 0.5
) -> OrderProblem:
    """Endpoints in a small box, on a coarse grid so that ties and zero travels occur."""
    rng = np.random.default_rng(seed)
    start = rng.integers(0, 5, (n, 3)).astype(float)
    end = rng.integers(0, 5, (n, 3)).astype(float)
    pairs = np.argwhere(np.triu(rng.random((n, n)) < density, 1)).astype(np.int32)
    layer = np.sort(rng.integers(0, 1 + n // 3, n)).astype(np.int32)
    graph = DependencyGraph.from_pairs(n, pairs)
    return OrderProblem(start, end, rng.random(n) < turning, layer, graph)
