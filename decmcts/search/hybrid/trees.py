"""Large structure by tree search: which cluster next.

A cluster of the paper is a whole tower or a few layers of one, so the nozzle goes from
tower to tower where one cluster ends. The tree search begins with the order of clusters
in the best sequence so far. Its result is a start for annealing, and what annealing makes
of that guides the next turn. Only the planner `hybrid-mcts` has it, since travel is no
shorter for it (docs/results/ablation.md). The paper leaves Γ open; taking the best of
four values saved no more travel than one value.

References
----------
Yoo et al. 2020, "Toward Optimal FDM Toolpath Planning with Monte Carlo Tree Search"
(clusters and tree).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.trees.guided import cluster_ranks, explore
from decmcts._kernels.trees.rollout import Clustered, Rollout
from decmcts._kernels.trees.tree import Tree, new_tree
from decmcts.feasibility.clustering import cluster_contours
from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.decomposition.clustered import clustered_problem, fresh_rollout
from decmcts.search.decomposition.threads import Threads
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import POLL_S, next_chunk

_CLUSTERING_S = 0.6e-6  # an edge, about
_CAPACITY = 20_000  # nodes of a tree; a full one goes on without growing
_ROUNDS = 5  # slices of a call that is limited by iterations
_MOST_ROLLOUTS = 1000  # a slice


@dataclass(frozen=True, slots=True)
class Trees:
    """What trees are grown, and for how long."""

    share: float = 0.02  # of the search for each turn
    gamma: float = 0.5  # Γ, from which on two clusters become one
    exploration: float = 0.05  # of UCB1; rewards of good sequences differ little

    def turn(self, incumbent: Incumbent, threads: Threads, sequence: Sequence) -> Iterator[None]:
        """Mutate the sequence to the best of a tree grown for `share`, if there is time for it."""
        if not self._have_time(incumbent):
            return
        until = incumbent.spent + self.share
        search = guided_search(incumbent, self.gamma, threads.fresh())
        yield from grow_until(incumbent, search, exploration=self.exploration, until=until)
        sequence.order[:], sequence.reversed[:] = search.order, search.reversed
        sequence.choose_entries()
        sequence.offer_to(incumbent)
        yield

    def _have_time(self, incumbent: Incumbent) -> bool:
        """Tell whether clustering takes no more than its share of time."""
        seconds = _CLUSTERING_S * len(incumbent.problem.graph.preds)
        return incumbent.stopping.share_of(seconds) <= self.share


@dataclass(slots=True)
class GuidedSearch:
    """A tree and the best sequence it gave; mutable."""

    clustered: Clustered
    rollout: Rollout
    tree: Tree
    rank: NDArray[np.float64]  # (h,) place of each cluster in the guide
    state: NDArray[np.uint64]
    order: NDArray[np.int32]  # (n,)
    reversed: NDArray[np.uint8]  # (n,) by contour
    best_cost: float = math.inf

    def grow(self, rollouts: int, reference_cost: float, exploration: float) -> None:
        """Mutate the search by so many iterations."""
        self.best_cost = explore(
            self.tree, self.clustered, self.rollout, self.rank, 1.0 / len(self.rank), exploration,
            reference_cost, rollouts, self.state, self.order, self.reversed, self.best_cost,
        )  # fmt: skip


def guided_search(incumbent: Incumbent, gamma: float, state: NDArray[np.uint64]) -> GuidedSearch:
    """Return a search guided by the incumbent."""
    n = len(incumbent.problem)
    position = np.empty(n, np.int32)
    position[incumbent.order] = np.arange(n, dtype=np.int32)
    labels = cluster_contours(incumbent.problem.graph, threshold=gamma)
    clustered = clustered_problem(incumbent.problem, labels)
    rank = cluster_ranks(position, clustered.label, len(clustered.outer_preds))
    order, is_reversed = incumbent.order.copy(), incumbent.reversed.copy()
    rollout, tree = fresh_rollout(clustered), new_tree(_CAPACITY)
    return GuidedSearch(clustered, rollout, tree, rank, state, order, is_reversed)


def grow_until(
    incumbent: Incumbent, search: GuidedSearch, *, exploration: float, until: float
) -> Iterator[None]:
    """Grow the tree until the share `until` is spent or the search is over.

    A rollout counts as many iterations as there are contours. At least one is made.
    """
    n, rollouts, limit = len(incumbent.problem), 1, incumbent.stopping.iterations
    if limit is not None:
        share = max(until - incumbent.spent, 0.0) * limit / (n * _ROUNDS)
        rollouts = int(min(max(share, 1.0), _MOST_ROLLOUTS))
    while True:
        before, step = incumbent.seconds, rollouts
        search.grow(step, incumbent.cost, exploration)
        incumbent.offer(search.order, search.reversed)
        incumbent.tick(step * n)
        if incumbent.over or incumbent.spent >= until:
            return
        if limit is None:
            took_s = incumbent.seconds - before
            rollouts = next_chunk(step, took_s, POLL_S, least=1, most=_MOST_ROLLOUTS)
        yield
