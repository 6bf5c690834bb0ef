"""The best sequence so far, how it came about, and whether the search is over.

Planners offer sequences and count their work here. So every planner can be stopped at
any time, and its result is never worse than the source. `Incumbent.over` says whether
the search has ended, and is the only thing that does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.arguments import checked
from decmcts.arrays import Floats, Int32s
from decmcts.errors import InputError
from decmcts.search.sequence.entries_kernels import visits_cost
from decmcts.search.sequence.metric_kernels import respects
from decmcts.search.sequence.problem import OrderProblem, Seams
from decmcts.search.sequence.stopping import Progress, Stopping


class Incumbent:
    """Best sequence of one search; starts as the source's own order.

    Parameters
    ----------
    clock : Callable[[], float]
        Seconds; only differences matter.
    stopping : Stopping
        When the search ends; looked at after every piece of work.
    report : Callable[[Progress], None] | None
        Called with the progress after every piece of work.
    bound : float | None
        A cost that no sequence is below, if known; part of the progress.
    started : float | None
        When the search began by the clock, if preparations count; None: now.
    """

    def __init__(
        self,
        problem: OrderProblem,
        *,
        clock: Callable[[], float],
        stopping: Stopping,
        report: Callable[[Progress], None] | None = None,
        bound: float | None = None,
        started: float | None = None,
    ) -> None:
        self.problem = problem
        self.stopping = stopping
        self.metric = problem.metric()
        self.order: Int32s = np.arange(len(problem), dtype=np.int32)
        self.reversed: NDArray[np.uint8] = np.zeros(len(problem), np.uint8)
        seams = problem.seams
        self.entry_id: Int32s = (
            np.full(len(problem), -1, np.int32) if seams is None else seams.sliced
        )
        self.source_cost = visits_cost(self.metric, self.order, self.reversed, self.entry_id)
        self.cost = self.source_cost
        self.iterations = 0
        self.found_by = ""  # which part of the planner found the best sequence, if it says so
        self._clock, self._report = clock, report
        self._ended = False  # as `stopping` says
        self._finished = False  # as the planner says
        self.bound = bound  # a cost that no sequence is below, if known
        self._started, self._improved_at_s = clock() if started is None else started, 0.0
        self._history: list[tuple[float, int, float]] = [(0.0, 0, self.cost)]

    @property
    def seconds(self) -> float:
        """Seconds since the search began."""
        return self._clock() - self._started

    @property
    def progress(self) -> Progress:
        """Where the search stands now."""
        return Progress(self.seconds, self.iterations, self.cost, self._improved_at_s, self.bound)

    @property
    def spent(self) -> float:
        """Share used of what the search may use, 1 or more at the end."""
        return self.stopping.spent(self.seconds, self.iterations)

    @property
    def over(self) -> bool:
        """Whether the search has ended: by its limits, proven optimal, or with no travel left."""
        return self._finished or self._ended or self.cost == 0.0

    @property
    def history(self) -> Floats:
        """Seconds, iterations and best cost at each improvement, (k, 3)."""
        return np.array(self._history, np.float64)

    def offer(
        self,
        order: Int32s,
        is_reversed: NDArray[np.uint8],
        entry_id: Int32s | None = None,
        *,
        by: str = "",
    ) -> bool:
        """Take the sequence if it is better; `is_reversed` is by contour. Returns whether it was.

        `entry_id` is the entry each contour is entered by, see `Seams`; None: as sliced. `by`
        names the part of the planner that found it. A
        sequence that does not keep the problem's time lags is not taken, and that is no
        fault: not all planners look at lags.

        Raises
        ------
        InputError
            If `order` has not each contour once, or a shape is wrong.
        RuntimeError
            If a better sequence breaks the dependency graph: a fault of the planner.
        """
        seams = self.problem.seams
        if entry_id is None:
            entry_id = self.entry_id if seams is None else seams.sliced
        order = whole_order(order, len(self.problem))
        for name, given in (("is_reversed", is_reversed), ("entry_id", entry_id)):
            if given.shape != order.shape:
                raise InputError(f"{name} has shape {given.shape}, expected {order.shape}")
        return self._take(order, is_reversed, entry_id, by)

    def _take(
        self, order: Int32s, is_reversed: NDArray[np.uint8], entry_id: Int32s, by: str = "",
    ) -> bool:  # fmt: skip
        """Take a sequence that is whole if it is better, as `offer` does."""
        seams = self.problem.seams
        cost = visits_cost(self.metric, order, is_reversed, entry_id)
        if cost >= self.cost:
            return False
        graph = self.problem.graph
        if not respects(order, graph.succ_offsets, graph.succs):
            raise RuntimeError("a planner offered a sequence that is no linear extension")
        if self.problem.timed_lags is not None and not self.problem.timed_lags.keeps(order):
            return False
        if (is_reversed.astype(np.bool_) & ~self.problem.reversible).any():
            raise RuntimeError("a planner reversed a contour that may not be reversed")
        if seams is not None and not _allowed(entry_id, seams):
            raise RuntimeError("a planner entered a contour where it may not")
        self.order, self.reversed, self.entry_id = order.copy(), is_reversed.copy(), entry_id.copy()
        self.cost, self.found_by = cost, by
        self._improved_at_s = self.seconds
        self._history.append((self._improved_at_s, self.iterations, cost))
        return True

    @checked
    def offer_order(self, order: Int32s) -> bool:
        """Offer an order, (n,), with the directions and entries that suit it best.

        Raises
        ------
        InputError
            If it has not each contour once.
        """
        order = whole_order(order, len(self.problem))
        return self._take(order, *self.problem.visits_for(self.metric, order))

    def prove(self, bound: float) -> None:
        """Take a bound that the planner has proven, if it is higher than the one known."""
        self.bound = bound if self.bound is None else max(self.bound, bound)

    def finish(self) -> None:
        """End the search: nothing better is left."""
        self._finished = True

    def tick(self, iterations: int = 0) -> None:
        """Count `iterations`, report, and end the search if it is time."""
        self.iterations += iterations
        now = self.progress
        if self._report is not None:
            self._report(now)
        self._ended = self._ended or self.stopping.ends(now.seconds, now.iterations)

    @contextmanager
    def ending_when(self, asked: Callable[[], bool]) -> Iterator[None]:
        """Within a `with`, end the search also when `asked` returns True."""
        usual = self.stopping
        before = usual.asked or (lambda: False)
        self.stopping = replace(usual, asked=lambda: asked() or before())
        try:
            yield
        finally:
            self.stopping, self._ended = usual, usual.ends(self.seconds, self.iterations)


def whole_order(order: Int32s, n: int) -> Int32s:
    """Return an order of n contours as kernels read it.

    Raises
    ------
    InputError
        If it has not each of them once.
    """
    given = np.asarray(order)
    if given.shape != (n,) or not np.array_equal(np.sort(given), np.arange(n)):
        raise InputError(f"order has not each of {n} contours once")
    return given.astype(np.int32)


def _allowed(entry_id: Int32s, seams: Seams) -> bool:
    """Say whether contours with a choice have an entry of their own, and all others none."""
    choice = np.diff(seams.offsets) > 1
    within = (entry_id >= seams.offsets[:-1]) & (entry_id < seams.offsets[1:])
    return bool(np.where(choice, within, entry_id == -1).all())
