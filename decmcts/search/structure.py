"""Large structure by tree search: which cluster next, at several Γ side by side.

Each Γ of the paper's clustering gives blocks of another size, from whole towers
to a few layers, hence other places where the nozzle may switch. A tree per Γ
starts from the block order of the best sequence so far; the Γ whose tree ends
with the least travel is the print's. What is found is a start for annealing,
whose result guides the next call.
"""

from __future__ import annotations

import math
from collections.abc import Sequence as Several
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.guided import block_ranks, explore
from decmcts._kernels.rollout import Clustered, Rollout
from decmcts._kernels.tree import Tree, new_tree
from decmcts.feasibility.clustering import cluster_contours
from decmcts.search.clustered import clustered_problem, fresh_rollout
from decmcts.search.incumbent import Incumbent
from decmcts.search.lanes import Lanes

_POLL_S = 0.1  # how often a search looks at the clock and the stop wish
_CAPACITY = 20_000  # nodes of a tree; a full one goes on without growing
_ROUNDS = 5  # slices of a call that is limited by iterations
_MOST_ROLLOUTS = 1000  # a slice and Γ


@dataclass(slots=True)
class GammaSearch:
    """The tree of one Γ and the best sequence it gave; mutable."""

    gamma: float
    clustered: Clustered
    rollout: Rollout
    tree: Tree
    rank: NDArray[np.float64]  # (h,) place of each cluster in the guide
    state: NDArray[np.uint64]
    order: NDArray[np.int32]  # (n,)
    flip: NDArray[np.uint8]  # (n,) by contour
    best_mm: float = math.inf

    def grow(self, rollouts: int, reference_mm: float, exploration: float) -> None:
        """Mutate the search by so many iterations."""
        self.best_mm = explore(
            self.tree, self.clustered, self.rollout, self.rank, 1.0 / len(self.rank), exploration,
            reference_mm, rollouts, self.state, self.order, self.flip, self.best_mm,
        )  # fmt: skip


def gamma_searches(
    incumbent: Incumbent, gammas: Several[float], states: Several[NDArray[np.uint64]]
) -> list[GammaSearch]:
    """Return a search for each Γ, guided by the incumbent; equal clusterings are kept once."""
    n = len(incumbent.problem)
    position = np.empty(n, np.int32)
    position[incumbent.order] = np.arange(n, dtype=np.int32)
    found: list[GammaSearch] = []
    for gamma, state in zip(gammas, states, strict=True):
        labels = cluster_contours(incumbent.problem.graph, threshold=gamma)
        clustered = clustered_problem(incumbent.problem, labels)
        if any((clustered.label == other.clustered.label).all() for other in found):
            continue
        rank = block_ranks(position, clustered.label, len(clustered.outer_preds))
        rollout = fresh_rollout(clustered)
        found.append(
            GammaSearch(gamma, clustered, rollout, new_tree(_CAPACITY), rank, state,
                        incumbent.order.copy(), incumbent.flip.copy())
        )  # fmt: skip
    return found


def search_structure(
    incumbent: Incumbent,
    searches: list[GammaSearch],
    lanes: Lanes,
    *,
    exploration: float,
    until: float,
) -> tuple[GammaSearch, bool]:
    """Grow all trees until the share `until` of the budget; return the best and whether to stop.

    A rollout counts an iteration a contour. At least one is made for each Γ.
    """
    n, rollouts, limit = len(incumbent.problem), 1, incumbent.budget.iterations
    if limit is not None:
        share = max(until - incumbent.spent, 0.0) * limit / (n * len(searches) * _ROUNDS)
        rollouts = int(min(max(share, 1.0), _MOST_ROLLOUTS))
    while True:
        before, reference, step = incumbent.seconds, incumbent.cost, rollouts
        growing = (searches, repeat(step), repeat(reference), repeat(exploration))
        list(lanes.pool.map(GammaSearch.grow, *growing))
        best = min(searches, key=lambda search: search.best_mm)
        incumbent.offer(best.order, best.flip)
        if incumbent.tick(step * n * len(searches)):
            return best, True
        if incumbent.spent >= until:
            return best, False
        if limit is None:
            speed = step / max(incumbent.seconds - before, 1e-6)
            rollouts = int(min(max(_POLL_S * speed, 1.0), 4.0 * step, _MOST_ROLLOUTS))
