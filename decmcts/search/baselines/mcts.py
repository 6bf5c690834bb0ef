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
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from decmcts.arrays import Int32s
from decmcts.feasibility.clustering import cluster_contours
from decmcts.feasibility.graph import DependencyGraph
from decmcts.random_kernels import seeded
from decmcts.search.baselines.mcts_kernels import Clustered, Rollout, new_tree, simulate_many
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import POLL_S, next_chunk

_CHUNK = 200  # iterations between looks at the clock when iterations are limited
_LARGEST_CHUNK = 100_000


@dataclass(frozen=True, slots=True)
class Mcts:
    """Tree search over clusters with UCB1, random feasible rollouts and the paper's reward."""

    exploration: float = math.sqrt(2.0)  # of UCB1
    patience_s: float = 300.0  # stop when nothing better was found for so long
    labels: Callable[[DependencyGraph], Int32s] = cluster_contours
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
        tree, chunk = new_tree(self.most_nodes), 1
        order, is_reversed, best = rollout.order.copy(), rollout.reversed.copy(), math.inf
        limit = incumbent.stopping.iterations
        while not incumbent.over:
            now, was = incumbent.progress, best
            if now.seconds - now.improved_at_s >= self.patience_s:  # the paper's rule
                break
            best = simulate_many(
                tree, clustered, rollout, tried, state, self.exploration, longest, self.nearest,
                chunk, order, is_reversed, best,
            )  # fmt: skip
            incumbent.iterations += chunk
            if best < was:
                incumbent.offer(order, is_reversed)
                incumbent.offer_order(order)
            incumbent.tick()
            if limit is not None:
                chunk = max(1, min(_CHUNK, limit - incumbent.iterations))
            else:
                took_s = incumbent.seconds - now.seconds
                chunk = next_chunk(chunk, took_s, POLL_S, least=1, most=_LARGEST_CHUNK)


def clustered_problem(problem: OrderProblem, labels: Int32s) -> Clustered:
    """Join a problem with the cluster of each contour.

    Clusters that depend on each other in a cycle could never be printed one
    after the other; they become one cluster.
    """
    labels = _without_cycles(problem, labels)
    graph, n_clusters = problem.graph, int(labels.max(initial=-1)) + 1
    pairs = labels[graph.pairs()]
    outer = pairs[pairs[:, 0] != pairs[:, 1], 1]
    sizes = np.bincount(labels, minlength=n_clusters)
    return Clustered(
        problem.metric(),
        problem.reversible,
        graph.pred_offsets,
        graph.succ_offsets,
        graph.succs,
        labels,
        np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        np.argsort(labels, kind="stable").astype(np.int32),
        np.bincount(outer, minlength=n_clusters).astype(np.int32),
    )


def _without_cycles(problem: OrderProblem, labels: Int32s) -> Int32s:
    """Return labels 0..h - 1 whose cluster graph has no cycle, by merging those on one."""
    ids, dense = np.unique(labels, return_inverse=True)
    pairs = dense[problem.graph.pairs()]
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(ids), len(ids)))
    _, component = connected_components(links, directed=True, connection="strong")
    return np.ascontiguousarray(component[dense], np.int32)


def fresh_rollout(clustered: Clustered) -> Rollout:
    """Return working arrays for rollouts of a problem."""
    n, n_clusters = len(clustered.label), len(clustered.outer_preds)
    return Rollout(
        np.zeros(n, np.int32),
        np.zeros(n, np.uint8),
        np.zeros(n, np.int32),
        np.zeros(n_clusters, np.int32),
        np.zeros(n_clusters, np.int32),
        np.zeros(n, np.int32),
        np.zeros(3, np.int64),
        np.zeros(1),
    )
