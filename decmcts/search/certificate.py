"""The certificate: a proven lower bound on extrusionless travel.

Looks for good prices of the relaxation (`decmcts.search.relaxation`); problems of
a few contours are solved exactly. Nothing here finds sequences.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.subsets import least_travel
from decmcts._kernels.tour import tour_cost
from decmcts.search.problem import OrderProblem
from decmcts.search.relaxation import Relaxation, Relaxed

EXACT_UP_TO = 12  # contours

Method = Literal["exact", "arborescence"]


@dataclass(frozen=True, slots=True)
class Certificate:
    """No order that the graph and the freedom allow has less travel than `bound_mm`."""

    bound_mm: float
    iterations: int  # relaxations solved on the way
    method: Method  # "exact": `bound_mm` is the least travel, but for rounding
    arcs: int  # travels looked at one by one; the others are bounded together

    def gap_percent(self, travel_mm: float) -> float | None:
        """Return how far above optimal `travel_mm` is at most; None if the bound is zero."""
        if travel_mm <= self.bound_mm:
            return 0.0
        return 100.0 * (travel_mm / self.bound_mm - 1.0) if self.bound_mm > 0.0 else None


def lower_bound(
    problem: OrderProblem,
    *,
    time_limit_s: float,
    clock: Callable[[], float] = time.monotonic,
    upper_bound_mm: float | None = None,
    max_iterations: int | None = None,
) -> Certificate:
    """Return a bound on the travel of every order and every choice of directions allowed.

    Up to `EXACT_UP_TO` contours the bound is the optimum (rounded down). Beyond,
    it is the best value of a Lagrangian relaxation at the prices that were tried.
    More time, or more iterations, never gives a lower bound.

    **Why it holds.** Take any order with directions that is allowed. Its travels,
    with one of length zero from a root to the first contour, are an arborescence
    that spans the contours; another travel of length zero leads from the last
    contour back to the root. Each of them is *possible*: it leads from i to j only
    where no j ≺ i and no k has i ≺ k ≺ j, for i and j are neighbours in a linear
    extension; the first contour has no predecessor and the last no successor.
    For prices u (contours and root), t (contours that may turn), ρ ≥ 0 (sets S of
    contours that each order leaves at least k_S times, see
    `decmcts.search.crossings`) and τ ≥ 0 (sets P of travels of which each order uses
    at most one, see `decmcts.search.passages`) let a travel from i to j cost

        length + u_i ± t_i ∓ t_j − Σ {ρ_S : i in S, j not in S} + Σ {τ_P : (i, j) in P},

    the sign of t being + for a contour printed forwards and − for one printed
    backwards. Over the order, each contour and the root is left once, so the u add
    up to Σ u; each contour is left in the direction in which it was entered, so the
    t cancel; the refunds are at least Σ ρ_S k_S and the tolls at most Σ τ. Hence

        travel ≥ cost of arborescence + cost of the way back − Σ u + Σ ρ_S k_S − Σ τ,

    and replacing both by the cheapest arborescence and the cheapest way back over
    all possible travels can only lower the right side. Travels that are not listed
    are taken for arcs from the root that cost no more: hanging the head of an arc
    from the root instead leaves an arborescence, so this too can only lower it.

    Parameters
    ----------
    time_limit_s : float
        Ends the search for better prices. The first bound is made in any case.
    upper_bound_mm : float | None
        The travel of a known order; it sets the length of the first steps only.
        None: that of the source.
    max_iterations : int | None
        Limit on the relaxations solved; results are then repeatable.

    Raises
    ------
    ValueError
        If a limit is negative.

    References
    ----------
    Held & Karp 1971, "The travelling-salesman problem and minimum spanning trees:
    part II"; Escudero, Guignard & Malik 1994, "A Lagrangian relax-and-cut approach
    for the sequential ordering problem with precedence relationships". The tolls
    are ours; they say of travels what x(A, B) ≤ 1 for A ≺ B says in a linear program.
    """
    if not time_limit_s >= 0.0 or (max_iterations is not None and max_iterations < 0):
        raise ValueError(f"negative limit: {time_limit_s} s, {max_iterations} iterations")
    n = len(problem)
    if n <= EXACT_UP_TO:
        return Certificate(_least(problem), 0, "exact", 2 * n * 2 * n)
    end = clock() + time_limit_s
    ascent = Ascent(Relaxation(problem), _target(problem, upper_bound_mm))
    while clock() < end and ascent.may_go_on(max_iterations):
        if not ascent.round(lambda: clock() < end):
            break
    bound = max(0.0, ascent.bound_mm)
    return Certificate(bound, ascent.iterations, "arborescence", len(ascent.relaxation.codes))


def _least(problem: OrderProblem) -> float:
    """Return the least travel, rounded down."""
    if len(problem) < 2:
        return 0.0
    graph, ports = problem.graph, problem.ports()
    before = np.zeros(len(problem), np.int64)
    for a, b in graph.pairs():
        before[b] |= 1 << int(a)
    lengths = np.linalg.norm(ports[:, None] - ports[None], axis=2)
    return float(least_travel(lengths, problem.reversible, before)) * (1.0 - 1e-12)


def _target(problem: OrderProblem, upper_bound_mm: float | None) -> float:
    if upper_bound_mm is not None:
        return upper_bound_mm
    n = len(problem)
    return tour_cost(problem.ports(), np.arange(n, dtype=np.int32), np.zeros(n, np.uint8))


class Ascent:
    """Subgradient steps on the prices of a relaxation, in rounds.

    A value counts as a bound only at the end of a round, when the travels that
    were not listed are bounded at its best prices.
    """

    first_share = 0.5  # of the step that would reach the target were the slope constant
    patience = 15  # steps without a better value before steps get shorter
    shorten = 0.8
    memory = 0.3  # share of the last direction in the next

    def __init__(self, relaxation: Relaxation, target_mm: float) -> None:
        self.relaxation, self.target_mm = relaxation, target_mm
        self.iterations = 0
        self._rounds = 0
        self._at = np.zeros(relaxation.size)
        self._step = np.zeros(relaxation.size)
        self._share, self._stale = self.first_share, 0
        self.bound_mm = -np.inf
        self._best: Relaxed
        self._best_at: NDArray[np.float64]
        self._certify(self._at)

    @property
    def round_length(self) -> int:
        """Steps of the next round: few at first, while the listed travels are still poor."""
        longest = max(5, min(50, 100_000 // self.relaxation.n))
        return min(longest, 5 + 5 * self._rounds)

    def may_go_on(self, max_iterations: int | None) -> bool:
        """Tell whether another round fits into the limit and may still gain."""
        fits = max_iterations is None or self.iterations + self.round_length <= max_iterations
        return fits and self._share > 1e-5 and bool(self._best.slope.any())

    def round(self, in_time: Callable[[], bool]) -> bool:
        """Climb for one round; returns False, with the bound as it was, if time ran out."""
        for _ in range(self.round_length):
            if not in_time():
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
        missing = max(self.target_mm - now.value, 1e-3 * self.target_mm)
        length = self._share * missing / max(float(self._step @ self._step), 1e-12)
        self._at = self.relaxation.allowed(self._at + length * self._step)

    def _certify(self, at: NDArray[np.float64]) -> bool:
        """Make a bound of these prices; returns whether unlisted travels lowered their value."""
        before = np.inf if self.iterations == 0 else self._best.value
        self.relaxation.take_up(at)
        self._best, self._best_at = self.relaxation.evaluate(at), at.copy()
        self.bound_mm = float(max(self.bound_mm, self._best.value - self._best.rounding))
        return self._best.value < before
