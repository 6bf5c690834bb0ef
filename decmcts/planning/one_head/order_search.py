"""The search for one head: compiled, begun, and how it takes account of cooling.

Searching tiny problems compiles the kernels that a real search needs. While those of `hybrid` are
compiled in another process, another planner begins.

Cooling is no edge of the dependency graph. A search can keep timed lags between contours that
lie on each other. Where its clock was wrong, or it kept none, waits are added to its order. Of
the orders found the one that ends first is taken.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from decmcts.feasibility.graph import DependencyGraph
from decmcts.jit.kernel import compiled_first, giving_way
from decmcts.planning.compiling import FIRST, compiled_beside, is_compiled, mark_compiled, part_of
from decmcts.planning.events import Begun, Report, Step, Stop, never
from decmcts.planning.options import Search
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.toolpath import Toolpath
from decmcts.search.bounds.ideals_kernels import WINDOW
from decmcts.search.planners import PLANNERS, Meanwhile, SearchResult, keeps_lags, plan_order
from decmcts.search.sequence.planner import Planner
from decmcts.search.sequence.problem import OrderProblem, Seams
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sequence.timed_lags import TimedLags, no_timed_lags
from decmcts.team.schedule.cooling import TimedOrder, cooled

PROBE = 0.1  # share of the search time, for a first search that ignores cooling
CLOSE = 1e-3  # share of the print time by which the clock of a search may be wrong
LITTLE = 1e-3  # share of the print time; shorter waits cost less than keeping lags would
POLL_S = 0.05  # how often it is asked whether a search can begin
STILL = "the source's own order, judged before anything is written"

RunSearch = Callable[[TimedLags | None, Stopping], SearchResult]
"""Searches with these lags, or ignoring cooling, until it is to end."""


@dataclass(frozen=True, slots=True)
class OrderSearch:
    """The search for one head, as it is begun and run."""

    print_problem: PrintProblem
    problem: OrderProblem
    lags: Lags  # by the times a search estimates
    timed_lags: TimedLags | None
    asked: Search
    report: Report
    bound: float | None = None  # no order costs less, if known

    @property
    def first(self) -> str | Planner:
        """The planner to begin with: `FIRST` while kernels of `hybrid` are compiled beside it.

        With `max_iterations` it is the one asked for: then results repeat, whatever is compiled.
        """
        planner = self.asked.planner
        if planner != "hybrid" or self.asked.max_iterations is not None:
            return planner
        part = part_of(self.problem, "hybrid")
        return FIRST if compiled_beside(part) and not is_compiled(part) else planner

    def ready(self) -> bool:
        """Say whether what it begins with is compiled."""
        first = self.first
        return not isinstance(first, str) or is_compiled(part_of(self.problem, first))

    def compile_cooling(self) -> None:
        """Compile what times orders with cooling, so that it takes none of the search time."""
        if self.timed_lags is not None:
            given = self.print_problem
            sliced = source_toolpath(self.problem)
            cooled(given.job, given.machine, given.graph, self.lags, sliced)

    def begin(self, stop: Stop) -> str | Planner:
        """Compile what it begins with and return that; it changes over when the rest is compiled.

        Once `stop` returns True it is `slicer`, which does not search.
        """
        first, planner = self.first, self.asked.planner
        if isinstance(first, str):
            compile_search(self.problem, first, stop)
        if stop():
            return "slicer"
        if first == planner:
            return planner
        part = part_of(self.problem, "hybrid")
        return Meanwhile(PLANNERS[FIRST], PLANNERS["hybrid"], lambda: is_compiled(part))

    def search(self, chosen: str | Planner, stopping: Stopping) -> SearchResult:
        """Search, for an order whose spots cool in time where there is such a rule."""
        asked, given = self.asked, self.print_problem
        self.report(Begun())
        if not stopping.is_asked():
            as_asked = chosen in (asked.planner, asked.name)
            began = "" if as_asked else f"; with {FIRST}, while the rest is compiled"
            self.report(Step(f"searching ({asked.name}, {asked.time_limit_s:g} s{began})"))

        def run(kept: TimedLags | None, stopping: Stopping) -> SearchResult:
            return plan_order(
                replace(self.problem, timed_lags=kept), planner=chosen,
                stopping=stopping, seed=asked.seed, progress=self.report, bound=self.bound,
            )  # fmt: skip

        if self.timed_lags is None:
            return run(None, stopping)
        return search_cooled(
            given.job, given.machine, given.graph, self.lags,
            self.timed_lags if keeps_lags(chosen) else None, run,
            source_toolpath(self.problem), stopping=stopping, report=self.report,
        )  # fmt: skip


def search_cooled(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    lags: Lags,
    timed_lags: TimedLags | None,
    search: RunSearch,
    sliced: Toolpath,
    *,
    stopping: Stopping,
    report: Report,
) -> SearchResult:
    """Return the order that ends first, waits for cooling included.

    A short search that ignores cooling shows how long its order would wait. If that is
    long, a search that keeps `timed_lags` has the rest of the time; else, or where these are
    None, a second search that ignores cooling. `stopping` is of both searches together, but each
    may make all iterations.

    The result is at most `CLOSE` slower than `sliced`, the source's own order, which needs no
    waits. Its `cost` is the search's, before contours were moved into waits. Its `bound` is
    the highest found: each holds with cooling and without.
    """
    tries: list[tuple[float, SearchResult]] = []

    def keep(result: SearchResult) -> TimedOrder:
        found = cooled(job, machine, graph, lags, result.toolpath)
        tries.append((found.seconds, replace(result, toolpath=found.toolpath)))
        return found

    probed = keep(search(None, stopping.shortened(PROBE)))
    if probed.at_first_s <= LITTLE * probed.seconds:
        timed_lags = None
    if timed_lags is not None:
        report(Step("searching orders that let spots cool"))
    keep(search(timed_lags, stopping.shortened(1.0 - PROBE)))
    seconds, result = min(tries, key=lambda one: one[0])
    bound = max((r.bound for _, r in tries if r.bound is not None), default=None)
    if seconds > (1.0 + CLOSE) * cooled(job, machine, graph, lags, sliced).seconds:
        result = replace(tries[0][1], toolpath=sliced, cost=result.source_cost)
    return replace(result, bound=bound)


def source_toolpath(problem: OrderProblem) -> Toolpath:
    """Return the source's own order, loops entered as sliced or where the seam policy says."""
    sliced, seams = Toolpath.as_sliced(len(problem)), problem.seams
    if seams is None:
        return sliced
    return replace(sliced, entry=seams.vertices[seams.offsets[:-1]])


def compile_search(problem: OrderProblem, planner: str | Planner, stop: Stop = never) -> None:
    """Search tiny problems, so that the planner's kernels are compiled before its clock starts.

    Each needs other kernels: the first is solved exactly, the second is too large for that
    and is annealed, the third has timed lags. Ends early once `stop` returns True.
    """
    ahead = ((3, None, 100), (2 * WINDOW, None, 500), (3, no_timed_lags(3), 100))
    for n, timed_lags, iterations in ahead:
        if stop():
            return
        row = row_of(n, loops=problem.seams is not None)
        small = replace(row, pace=problem.pace, timed_lags=timed_lags)
        plan_order(
            small, planner=planner, stopping=Stopping(iterations=iterations, asked=stop), seed=0,
        )  # fmt: skip
    if isinstance(planner, str) and not stop():
        mark_compiled(part_of(problem, planner))


def row_of(n: int, *, loops: bool = False) -> OrderProblem:
    """Return `n` contours in a row; the last one lies above and depends on the first.

    With `loops` each may be entered at either of its two ends.
    """
    start = np.zeros((n, 3))
    start[:, 0] = np.arange(n)
    start[-1, 2] = 0.2
    graph = DependencyGraph.from_pairs(n, np.array([[0, n - 1]], np.int32))
    layer = (start[:, 2] > 0.0).astype(np.int32)
    end, either = start[::-1].copy(), np.ones(n, np.bool_)
    if not loops:
        return OrderProblem(start, end, either, layer, graph)
    ends = np.stack([start, end], axis=1).reshape(-1, 3)
    seams = Seams(2 * np.arange(n + 1), ends, ends.copy(), np.tile([0, 1], n).astype(np.int32))
    return OrderProblem(start, start.copy(), ~either, layer, graph, seams=seams)


@contextmanager
def searched_beside(
    order: OrderSearch, *, stopping: Stopping, report: Report
) -> Iterator[Callable[[], SearchResult | None]]:
    """Search in a thread beside the body of a `with`, from when `order` is ready.

    This is done only where schedule, judge and writer must still be compiled: another process
    compiles what the first search needs, and is done sooner. The judge stays in the main thread,
    where signals arrive. See docs/adr/0007-compiled-at-first-use.md.

    Yields a function that waits for the search and returns its result, or None if the search
    had not begun when the function was called. If the body raises, the search ends.
    """
    wanted, failed = threading.Event(), threading.Event()
    until = replace(stopping, asked=lambda: failed.is_set() or stopping.is_asked())

    def run() -> SearchResult | None:
        while not order.ready():
            if wanted.wait(POLL_S) or failed.is_set():
                return None
        with compiled_first():
            chosen = order.begin(until.is_asked)
        found = order.search(chosen, until)
        if not (wanted.is_set() or failed.is_set()):
            report(Step(STILL))
        return found

    def result() -> SearchResult | None:
        wanted.set()
        return future.result()

    with ThreadPoolExecutor(1, thread_name_prefix="search") as pool:
        future = pool.submit(run)
        try:
            with giving_way():
                yield result
        except BaseException:
            failed.set()
            raise
        finally:
            wanted.set()
