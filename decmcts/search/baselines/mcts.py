"""The planner `mcts`: the paper's Monte Carlo tree search on the clustered graph.

Kept as the reference for the paper's figures: as it is by default nothing is added to it. What
experiments vary are parameters.

References
----------
Yoo et al. 2020, "Toward Optimal FDM Toolpath Planning with Monte Carlo Tree
Search", Sec. III.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.random import seeded
from decmcts._kernels.trees.tree import new_tree, simulate_many, with_room
from decmcts.feasibility.clustering import cluster_contours
from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.decomposition.clustered import clustered_problem, fresh_rollout
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import POLL_S, next_chunk

_CHUNK = 200  # iterations between looks at the clock when iterations are limited
_LARGEST_CHUNK = 100_000


@dataclass(frozen=True, slots=True)
class Mcts:
    """Tree search over clusters with UCB1, random feasible rollouts and the paper's reward."""

    exploration: float = math.sqrt(2.0)  # of UCB1
    patience_s: float = 300.0  # stop when nothing better was found for so long
    labels: Callable[[DependencyGraph], NDArray[np.int32]] = cluster_contours
    nearest: float = 0.0  # chance that a rollout goes on with the nearest cluster, not any
    most_nodes: int = 4_000_000  # of the tree, about 150 MB; 1: rollouts from the root alone

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Search until the budget is spent or patience runs out."""
        if len(incumbent.problem) < 2:
            return
        clustered = clustered_problem(incumbent.problem, self.labels(incumbent.problem.graph))
        rollout, state = fresh_rollout(clustered), seeded(seed)
        tried = np.zeros(len(clustered.outer_preds), np.bool_)
        longest = incumbent.problem.longest_travel() * len(rollout.order)
        tree, chunk = new_tree(min(1024, self.most_nodes)), 1
        order, is_reversed, best = rollout.order.copy(), rollout.reversed.copy(), math.inf
        while not incumbent.over and not self._has_lost_patience(incumbent):
            tree = with_room(tree, chunk, self.most_nodes)
            before, was = incumbent.seconds, best
            best = simulate_many(
                tree, clustered, rollout, tried, state, self.exploration, longest, self.nearest,
                chunk, order, is_reversed, best,
            )  # fmt: skip
            incumbent.iterations += chunk
            if best < was:
                incumbent.offer(order, is_reversed)
                incumbent.offer_order(order)
            incumbent.tick()
            chunk = _next_chunk(incumbent, chunk, incumbent.seconds - before)

    def _has_lost_patience(self, incumbent: Incumbent) -> bool:
        """Tell whether nothing better was found for long (the paper's rule)."""
        now = incumbent.progress
        return now.seconds - now.improved_at_s >= self.patience_s


def _next_chunk(incumbent: Incumbent, chunk: int, took_s: float) -> int:
    """Return how many iterations to do before looking at the clock again."""
    if incumbent.stopping.iterations is not None:
        return max(1, min(_CHUNK, incumbent.stopping.iterations - incumbent.iterations))
    return next_chunk(chunk, took_s, POLL_S, least=1, most=_LARGEST_CHUNK)
