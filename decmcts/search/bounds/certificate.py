"""The certificate: a proven lower bound on extrusionless travel, or on its time.

Problems whose layers have few contours are solved exactly (`decmcts.search.bounds.exact`);
for others good prices of the relaxation (`decmcts.search.bounds.relaxation`) are looked for.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from decmcts.arrays import Floats
from decmcts.search.bounds.exact import Patience, solve_exactly
from decmcts.search.bounds.relaxation import Relaxation, Relaxed
from decmcts.search.sequence.entries_kernels import visits_cost
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping

EXACT_UP_TO = 12  # contours, whatever time that takes
EXACT_SHARE = 0.5  # of the time, at most, for an exact solution of larger problems
PROBE_SHARE = 0.1  # of the time, before that, for finding out what one takes
INFORMS_PERCENT = 25.0
"""A gap beyond this says nothing to a person: `greedy` itself ends 26 to 58 % above the
best order known (medians of ten settings, docs/results/planners.md, 60 s), so such a bound
does not tell a good order from a quick one. Programs get every bound."""

Method = Literal["exact", "arborescence"]


@dataclass(frozen=True, slots=True)
class LowerBound:
    """No order that the graph and the freedom allow has less travel than `bound`."""

    bound: float  # in the unit of the problem
    iterations: int  # relaxations solved on the way
    method: Method  # "exact": `bound` is the least travel, but for rounding
    arcs: int  # travels the relaxation lists; the others are bounded together

    def gap_percent(self, travel: float) -> float | None:
        """Return how far above optimal `travel` is at most; None if the bound is zero.

        Raises
        ------
        ValueError
            If the travel is below the bound: then one of the two is wrong.
        """
        if travel < self.bound * (1.0 - 1e-9):
            raise ValueError(f"travel {travel} is below the bound {self.bound}")
        if travel <= self.bound:
            return 0.0
        return 100.0 * (travel / self.bound - 1.0) if self.bound > 0.0 else None


def lower_bound(
    problem: OrderProblem,
    *,
    stopping: Stopping,
    clock: Callable[[], float] = time.monotonic,
    upper_bound: float | None = None,
) -> LowerBound:
    """Return a bound on the travel of every order and every choice of directions allowed.

    Up to `EXACT_UP_TO` contours the bound is the optimum (rounded down), and beyond
    where the time suffices for it. Else it is the best value of a Lagrangian
    relaxation at the prices that were tried. More iterations never give a smaller bound; more
    seconds may, where an exact solution takes longer to be given up.

    **Why it holds.** Take any order with directions that is allowed. Its travels,
    with one of length zero from a root to the first contour, are an arborescence
    that spans the contours; another travel of length zero leads from the last
    contour back to the root. Each of them is *possible*: it leads from i to j only
    where no j ≺ i and no k has i ≺ k ≺ j, for i and j are neighbours in a linear
    extension; the first contour has no predecessor and the last no successor.
    For prices u (contours and root), t (choices for a contour), ρ ≥ 0 (sets S of
    contours that each order leaves at least k_S times, see
    `decmcts.search.bounds.relaxation`) and τ ≥ 0 (sets P of travels of which each order uses
    at most one, see `decmcts.search.bounds.exclusive_travels`) let a travel from i to j cost

        price + u_i + t_p − t_q − Σ {ρ_S : i in S, j not in S} + Σ {τ_P : (i, j) in P}

    if i is printed by choice p and j by choice q, as sliced or reversed; a loop is entered
    and left at whichever entries are nearest. Over the order, each contour and the root is left
    once, so the u add up to Σ u; each contour is left by the choice by which it was
    entered, so the t cancel; the refunds are at least Σ ρ_S k_S and the tolls at most
    Σ τ. Hence

        travel ≥ cost of arborescence + cost of the way back − Σ u + Σ ρ_S k_S − Σ τ,

    and replacing both by the cheapest arborescence and the cheapest way back over
    all possible travels can only lower the right side. Travels that are not listed
    are taken for arcs from the root that cost no more: hanging the head of an arc
    from the root instead leaves an arborescence, so this too can only lower it.

    Parameters
    ----------
    stopping : Stopping
        What ends the search for better prices; the first bound is made in any case.
        Iterations are the relaxations solved. Where these are limited, results are
        repeatable, and more than `EXACT_UP_TO` contours are not solved exactly.
    upper_bound : float | None
        The travel of a known order; it sets the length of the first steps only.
        None: that of the source.

    Raises
    ------
    ValueError
        If the problem is one of bare costs.

    References
    ----------
    Held & Karp 1971, "The travelling-salesman problem and minimum spanning trees:
    part II"; Escudero, Guignard & Malik 1994, "A Lagrangian relax-and-cut approach
    for the sequential ordering problem with precedence relationships". The tolls
    are ours; they say of travels what x(A, B) ≤ 1 for A ≺ B says in a linear program.
    """
    if problem.costs is not None:
        raise ValueError("bare costs are bounded by `decmcts.search.sop.solver`")
    n, began = len(problem), clock()
    if n < 2:
        return LowerBound(0.0, 0, "exact", 0)

    def over(iterations: int = 0) -> bool:
        return stopping.ends(clock() - began, iterations)

    def spent() -> float:
        return stopping.spent(clock() - began, 0)

    patience = Patience(spent, PROBE_SHARE, EXACT_SHARE)

    def go_on(made: int, share: float) -> bool:
        return n <= EXACT_UP_TO or (patience.lasts(share) and not over())

    if n <= EXACT_UP_TO or (stopping.iterations is None and not over()):
        optimum = solve_exactly(problem, go_on)
        if optimum is not None:
            return LowerBound(optimum.bound, 0, "exact", 0)
    ascent = Ascent(Relaxation(problem), _target(problem, upper_bound))
    while not over(ascent.iterations) and ascent.may_go_on(stopping.iterations):
        if not ascent.round(lambda: over(ascent.iterations)):
            break
    bound = max(0.0, ascent.bound)
    return LowerBound(bound, ascent.iterations, "arborescence", len(ascent.relaxation.codes))


def _target(problem: OrderProblem, upper_bound: float | None) -> float:
    if upper_bound is not None:
        return upper_bound
    order, sliced = np.arange(len(problem), dtype=np.int32), np.full(len(problem), -1, np.int32)
    return visits_cost(problem.metric(), order, np.zeros(len(order), np.uint8), sliced)


class Ascent:
    """Subgradient steps on the prices of a relaxation, in rounds.

    A value counts as a bound only at the end of a round, when the travels that
    were not listed are bounded at its best prices.
    """

    first_share = 0.5  # of the step that would reach the target were the slope constant
    patience = 15  # steps without a better value before steps get shorter
    shorten = 0.8
    memory = 0.3  # share of the last direction in the next

    def __init__(self, relaxation: Relaxation, target: float) -> None:
        self.relaxation, self.target = relaxation, target
        self.iterations = 0
        self._rounds = 0
        self._at = np.zeros(relaxation.size)
        self._step = np.zeros(relaxation.size)
        self._share, self._stale = self.first_share, 0
        self.bound = -np.inf
        self._best: Relaxed
        self._best_at: Floats
        self._certify(self._at)

    @property
    def round_length(self) -> int:
        """Steps of the next round: few at first, while the listed travels are still poor."""
        longest = max(5, min(50, 100_000 // self.relaxation.n))
        return min(longest, 5 + 5 * self._rounds)

    def may_go_on(self, most: int | None) -> bool:
        """Tell whether another round fits into the limit of iterations and may still gain."""
        fits = most is None or self.iterations + self.round_length <= most
        return fits and self._share > 1e-5 and bool(self._best.slope.any())

    def round(self, over: Callable[[], bool]) -> bool:
        """Climb for one round; returns False, with the bound as it was, if the search is over."""
        for _ in range(self.round_length):
            if over():
                return False
            self.iterations += 1
            self._climb(self.relaxation.evaluate(self._at))
        self._rounds += 1
        if self._certify(self._best_at):
            self._at = self._best_at.copy()
        return True

    def _climb(self, now: Relaxed) -> None:
        """Make one step, or return to the best prices to go on with shorter steps."""
        if now.value > self._best.value:
            self._best, self._best_at, self._stale = now, self._at.copy(), 0
        else:
            self._stale += 1
        if self._stale >= self.patience:
            self._share, self._stale = self._share * self.shorten, 0
            self._at, self._step = self._best_at.copy(), np.zeros_like(self._step)
            return
        self._step = (1.0 - self.memory) * now.slope + self.memory * self._step
        missing = max(self.target - now.value, 1e-3 * self.target)
        length = self._share * missing / max(float(self._step @ self._step), 1e-12)
        self._at = self.relaxation.allowed(self._at + length * self._step)

    def _certify(self, at: Floats) -> bool:
        """Make a bound of these prices; returns whether unlisted travels lowered their value."""
        before = np.inf if self.iterations == 0 else self._best.value
        self.relaxation.take_up(at)
        self._best, self._best_at = self.relaxation.evaluate(at), at.copy()
        self.bound = float(max(self.bound, self._best.value - self._best.rounding))
        return self._best.value < before
