"""The bare sequential ordering problem: a cost matrix and precedence, nothing else.

Three searches share the best sequence, and each is strong where the others are not:

- beam search from both ends, where precedence is dense, and on prints;
- branch and bound over assignments, where there is next to no precedence;
- annealing by exchanges and reversals of segments, between the two.

The first two often prove that no sequence is cheaper. Reduced costs (`.assignment`) make
partial sequences comparable in the first, and successors in the last. The searches run on
two threads, which exchange results after each slice of work.

References
----------
Escudero 1988 (the problem); Libralesso et al. 2020 (beam search); Gambardella &
Dorigo 2000 (moves); Carpaneto & Toth 1980 (branch and bound).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats, Int32s
from decmcts.errors import InputError
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.bare.sop import MOST_COST
from decmcts.print.brief import brief
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Progress, Stopping
from decmcts.search.sop.assignment import Assignment, assign, patch_cycles
from decmcts.search.sop.precedence import Precedence
from decmcts.search.sop.threads import TwoThreads


@dataclass(frozen=True, slots=True)
class SopResult:
    """The best sequence found, and what is proven of it."""

    order: Int32s  # (n,) nodes as the caller numbers them, from 0
    cost: float
    bound: float  # no sequence costs less; equals `cost` where that is proven optimal
    iterations: int  # partial sequences looked at, moves proposed; an assignment counts n² / 4
    history: Floats  # (k, 3) seconds, iterations, cost at each improvement
    found_by: str  # "start", "beam", "annealing" or "assignments"
    seed: int

    __repr__ = brief("order", "cost", "bound", "iterations", "found_by")

    @property
    def optimal(self) -> bool:
        """Whether no sequence can be cheaper."""
        return self.bound >= self.cost


def search_sop(
    costs: Floats,
    precedence: Int32s,
    *,
    stopping: Stopping,
    seed: int = 0,
    clock: Callable[[], float] = time.monotonic,
    progress: Callable[[Progress], None] | None = None,
) -> SopResult:
    """Find a cheap sequence of all nodes that keeps the precedence, on two threads.

    Equal seeds and equal limits of iterations give equal results, provided nothing else
    ends the search. Ends early when the result is proven optimal.

    Parameters
    ----------
    costs : Floats
        (n, n) cost of going from row to column, 0 to `MOST_COST`; the diagonal is not used.
    precedence : Int32s
        (m, 2) rows (a, b): a somewhere before b. May be redundant.
    stopping : Stopping
        What ends the search. Its seconds include preparations; iterations are partial
        sequences looked at and moves proposed, by both threads together.
    seed : int
        Of what is drawn at random.
    clock : Callable[[], float]
        Seconds; only differences matter.
    progress : Callable[[Progress], None] | None
        Called several times a second with where the search stands.

    Raises
    ------
    InputError
        If shapes do not fit, a cost is negative or too large, a node is unknown, or the
        precedence has a cycle.
    """
    bare, pairs = _checked(costs, precedence)
    n = len(bare)
    started = clock()
    numbered = Precedence.of(*_with_ends(n, pairs))
    full = np.zeros((len(numbered.original),) * 2)
    full[:n, :n] = bare
    full = np.ascontiguousarray(full[np.ix_(numbered.original, numbered.original)])
    np.fill_diagonal(full, 0.0)
    assignment = assign(full, numbered.possible)
    graph = DependencyGraph.from_pairs(len(full), numbered.pairs)
    incumbent = Incumbent(
        OrderProblem.of_costs(full, graph),
        clock=clock,
        stopping=stopping,
        report=progress,
        started=started,
    )
    bound = _search(incumbent, numbered, assignment, seed)
    order = numbered.original[incumbent.order]
    return SopResult(
        order[order < n],
        incumbent.cost,
        min(bound, incumbent.cost),
        incumbent.iterations,
        incumbent.history,
        incumbent.found_by or "start",
        seed,
    )


def _checked(costs: Floats, precedence: Int32s) -> tuple[Floats, Int32s]:
    """Return costs and pairs as arrays of their own, or raise InputError."""
    bare = np.array(costs, np.float64)
    if bare.ndim != 2 or bare.shape[0] != bare.shape[1]:
        raise InputError(f"costs have shape {bare.shape}, expected (n, n)")
    np.fill_diagonal(bare, 0.0)
    if not ((bare >= 0.0) & (bare <= MOST_COST)).all():
        raise InputError(f"costs have one below 0, above {MOST_COST:g} or not a number")
    pairs = np.asarray(precedence)
    if pairs.size == 0:
        pairs = pairs.reshape(0, 2)
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        raise InputError(f"precedence has shape {pairs.shape}, expected (m, 2)")
    if len(pairs) and not (pairs.min() >= 0 and pairs.max() < len(bare)):
        raise InputError(f"precedence names a node outside 0..{len(bare) - 1}")
    if len(pairs) and not np.issubdtype(pairs.dtype, np.integer):
        raise InputError(f"precedence is of {pairs.dtype}, expected whole numbers")
    return bare, pairs.astype(np.int32)


def _with_ends(n: int, pairs: Int32s) -> tuple[int, Int32s]:
    """Return (n, pairs) with a first and a last node that cost nothing, n and n + 1.

    Prices then add up to the same for every sequence.
    """
    nodes = np.arange(n)
    first = np.stack([np.full(n + 1, n), np.append(nodes, n + 1)], axis=1)
    last = np.stack([nodes, np.full(n, n + 1)], axis=1)
    return n + 2, np.concatenate([pairs, first, last]).astype(np.int32)


def _search(
    incumbent: Incumbent, precedence: Precedence, assignment: Assignment, seed: int
) -> float:
    """Spend the budget on the incumbent; return a proven lower bound."""
    costs = incumbent.problem.costs
    assert costs is not None
    steps = np.where(precedence.possible, costs, np.inf)
    relaxed = patch_cycles(steps, assignment.following)
    incumbent.offer(precedence.repaired(relaxed), incumbent.reversed)
    incumbent.tick()
    if len(costs) <= 3 or incumbent.over:
        return incumbent.cost if len(costs) <= 3 else assignment.bound
    whole = bool((costs == np.rint(costs)).all())
    least_gain = 0.5 if whole else 1e-9 * (1.0 + float(costs.max()))
    return TwoThreads(incumbent, precedence, assignment, seed, least_gain).run()
