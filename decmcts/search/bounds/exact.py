"""Sequences that are proven optimal, for prints whose layers have few contours.

By dynamic programming over order ideals, the sets of contours that may have been printed
at some time (`decmcts.search.bounds.ideals_kernels`). How long that will take is known early, so
a print that would take too long is given up soon.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Int32s
from decmcts.search.bounds.ideals_kernels import (
    IdealRules,
    Ideals,
    make_ideals,
    needs,
    price_steps,
    reaches,
    reset,
    trace,
)
from decmcts.search.bounds.relaxation import choices_of
from decmcts.search.sequence.problem import OrderProblem

_QUOTA = 20_000  # steps between two questions, while they are being found
EFFORT = 2e7  # travels looked at between two questions, at most, while they are priced
_ROUNDING = 2.0**-52  # of the cost, for each travel that is summed
WIDEST = 500_000  # steps from a level: with more there is no hope


@dataclass(frozen=True, slots=True)
class Capacity:
    """How much is kept of the order ideals at most; 0.4 GiB, if all is used."""

    ideals: int = 2_000_000
    steps: int = 8_000_000
    travels: int = 32_000_000
    slots: int = 1_000_003  # a prime

    def allocate(self) -> Ideals:
        """Return room for ideals, to be reset first; what is not used takes no memory."""
        most, steps = self.ideals, self.steps
        return Ideals(
            np.empty(most, np.int32), np.empty(most, np.uint64), np.empty(most + 1, np.int32),
            np.empty(most, np.int32), np.empty(most, np.int32), np.empty(steps, np.int32),
            np.empty(steps, np.int32), np.empty(steps + 1, np.int64), np.empty(self.travels),
            np.empty(self.slots, np.int32),
        )  # fmt: skip


CAPACITY = Capacity()


@dataclass(frozen=True, slots=True)
class Optimum:
    """A sequence, and the proof that none costs less: all of them were looked at."""

    order: Int32s  # (n,)
    reversed: NDArray[np.uint8]  # (n,) by contour
    entry_id: Int32s  # (n,) by contour
    cost: float
    bound: float  # the cost, rounded down


@dataclass(slots=True)
class Patience:
    """Tells whether an exact solution is in sight, as it is being made.

    Shares are of a budget, `spent` says how much of it is used.
    """

    spent: Callable[[], float]
    finding: float  # share for finding the steps
    pricing: float  # share for pricing them
    probe: float = 0.05  # share that pricing may use before its pace is judged
    _began: float = field(init=False)
    _found: float = field(init=False)  # share used by then

    def __post_init__(self) -> None:
        self._began = self._found = self.spent()

    def lasts(self, share: float) -> bool:
        """Return whether to go on with this share of the pricing done."""
        spent = self.spent()
        if share == 0.0:
            self._found = spent
            return spent - self._began <= self.finding
        return spent - self._found <= max(self.probe, self.pricing * share)


def solve_exactly(
    problem: OrderProblem,
    go_on: Callable[[int, float], bool] = lambda made, share: True,
    *,
    widest: int = WIDEST,
    effort: float = EFFORT,
    capacity: Capacity = CAPACITY,
) -> Optimum | None:
    """Return an optimal sequence, or None if that takes too much.

    Time grows with the order ideals of the graph: about evenly with the number of
    layers, with 2ᵏ at most for k contours in a layer. That is too much, too, where a
    contour may be overtaken by one far behind it in the source.

    Parameters
    ----------
    go_on : Callable[[int, float], bool]
        Asked after every piece of work: with the number of steps made since it was last asked,
        and the share of all steps that are priced, 0 while they are still being found. A step
        leads from a set of printed contours to one with one more. False gives up.
    widest : int
        Steps from all sets of equally many contours beyond which to give up.
    effort : float
        Travels looked at between two questions, at most, while steps are priced.
    capacity : Capacity
        What the sets and steps must fit into; where they do not, this gives up.
    """
    n, graph = len(problem), problem.graph
    reach, near = reaches(graph.pred_offsets, graph.preds)
    if n == 0 or not near:
        return None
    choices = choices_of(problem, apart=True)
    rules = IdealRules(reach, needs(graph.pred_offsets, graph.preds), slack_of(problem))
    ideals, steps = capacity.allocate(), 0
    at = reset(ideals)
    while at.level < n:
        at = make_ideals(ideals, choices, rules, at, max(1, min(_QUOTA, widest)), widest)
        made, steps = int(ideals.begin[at.first]) - steps, int(ideals.begin[at.first])
        if at.full or not go_on(made, 0.0):
            return None
    looks, first = _looks(ideals, at.first), 0
    while first < at.first:
        last = int(np.searchsorted(looks, looks[first] + effort, side="right")) - 1
        last = max(first + 1, last)
        price_steps(ideals, choices, rules, first, last)
        made = int(ideals.begin[last] - ideals.begin[first])
        if not go_on(made, looks[last] / looks[-1]) and last < at.first:
            return None
        first = last
    cost, order, chosen = trace(ideals, choices, at.first)
    choice, place = np.empty(n, np.int64), chosen - choices.offsets[order]
    choice[order] = place
    entries = np.ones(n, np.int64) if problem.seams is None else np.diff(problem.seams.offsets)
    entry_id = np.full(n, -1, np.int64)
    if problem.seams is not None:
        entry_id[entries > 1] = (problem.seams.offsets[:-1] + choice)[entries > 1]
    is_reversed = np.where(entries > 1, 0, choice)
    rounding = _ROUNDING * n
    bound = min(cost * (1.0 - rounding), cost * (1.0 + rounding))  # costs may be negative
    return Optimum(order, is_reversed.astype(np.uint8), entry_id.astype(np.int32), cost, bound)


def _looks(ideals: Ideals, count: int) -> Floats:
    """Return how many travels are looked at, at most, before each ideal is priced, (count + 1,)."""
    ports = ideals.ports[:count].astype(np.float64)
    choices = np.diff(ideals.base[ideals.begin[: count + 1]])
    return np.concatenate([[0.0], np.cumsum(1.0 + ports * (ports + choices))])


def slack_of(problem: OrderProblem) -> float:
    """Return by how much a detour may be cheaper than the direct travel.

    Two travels may each be short enough to go without retraction where one is not. Where travels
    over walls cost more, two may go round a wall that one crosses: by any amount.
    """
    pace = problem.pace
    if problem.costs is not None or (pace is not None and pace.over and pace.looks_at_walls):
        return float(np.inf)
    return 0.0 if pace is None else pace.hop_s
