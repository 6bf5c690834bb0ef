"""Large structure by tree search: which cluster next, at several Γ side by side.

Each Γ of the paper's clustering gives blocks of another size, from whole towers
to a few layers, hence other places where the nozzle may switch. A tree per Γ
starts from the block order of the best sequence so far; the Γ whose tree ends
with the least travel is the print's. What is found is a start for annealing,
whose result guides the next call.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from collections.abc import Sequence as Several
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.trees.guided import block_ranks, explore
from decmcts._kernels.trees.rollout import Clustered, Rollout
from decmcts._kernels.trees.tree import Tree, new_tree
from decmcts.feasibility.clustering import cluster_contours
from decmcts.search.hybrid.pieces import Sequence
from decmcts.search.hybrid.threads import Threads
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.starts.clustered import clustered_problem, fresh_rollout

_CLUSTERING_S = 0.6e-6  # an edge and Γ, about
_POLL_S = 0.1  # how often a search looks at the clock and the stop wish
_CAPACITY = 20_000  # nodes of a tree; a full one goes on without growing
_ROUNDS = 5  # slices of a call that is limited by iterations
_MOST_ROLLOUTS = 1000  # a slice and Γ


@dataclass(frozen=True, slots=True)
class Trees:
    """What trees are grown, and for how long."""

    share: float = 0.02  # of the search for each turn; 0: no trees
    gammas: tuple[float, ...] = (0.3, 0.5, 0.7, 0.9)
    one_from: int = 6000  # contours from which one Γ, the second, is all that time allows
    exploration: float = 0.05  # of UCB1; rewards of good sequences differ little

    def turn(self, incumbent: Incumbent, threads: Threads, guest: Sequence) -> Iterator[None]:
        """Mutate the guest to the best of trees grown for their share, if they have time."""
        if not self._have_time(incumbent):
            return
        until, gammas = incumbent.spent + self.share, self._gammas_for(incumbent)
        searches = gamma_searches(incumbent, gammas, threads.fresh(len(gammas)))
        best = yield from search_structure(
            incumbent, searches, threads, exploration=self.exploration, until=until
        )
        guest.order[:], guest.flip[:] = best.order, best.flip
        guest.settle()
        incumbent.offer(guest.order, guest.flip, guest.seat)
        incumbent.notes["gamma"] = best.gamma
        yield

    def _have_time(self, incumbent: Incumbent) -> bool:
        """Tell whether clustering takes no more than their share of time."""
        edges = len(incumbent.problem.graph.preds)
        seconds = _CLUSTERING_S * edges * len(self._gammas_for(incumbent))
        return self.share > 0.0 and incumbent.stopping.share_of(seconds) <= self.share

    def _gammas_for(self, incumbent: Incumbent) -> tuple[float, ...]:
        """Return each Γ to be tried."""
        few = len(incumbent.problem) < self.one_from
        return self.gammas if few else self.gammas[1:2] or self.gammas


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
    threads: Threads,
    *,
    exploration: float,
    until: float,
) -> Generator[None, None, GammaSearch]:
    """Grow all trees until the share `until` is spent or the search is over; return the best.

    A rollout counts an iteration a contour. At least one is made for each Γ.
    """
    n, rollouts, limit = len(incumbent.problem), 1, incumbent.stopping.iterations
    if limit is not None:
        share = max(until - incumbent.spent, 0.0) * limit / (n * len(searches) * _ROUNDS)
        rollouts = int(min(max(share, 1.0), _MOST_ROLLOUTS))
    while True:
        before, reference, step = incumbent.seconds, incumbent.cost, rollouts
        growing = (searches, repeat(step), repeat(reference), repeat(exploration))
        list(threads.pool.map(GammaSearch.grow, *growing))
        best = min(searches, key=lambda search: search.best_mm)
        incumbent.offer(best.order, best.flip)
        incumbent.tick(step * n * len(searches))
        if incumbent.over or incumbent.spent >= until:
            return best
        if limit is None:
            speed = step / max(incumbent.seconds - before, 1e-6)
            rollouts = int(min(max(_POLL_S * speed, 1.0), 4.0 * step, _MOST_ROLLOUTS))
        yield
