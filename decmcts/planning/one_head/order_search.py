"""The search for one head: the planner it begins with, and how it takes account of cooling.

Cooling is no edge of the dependency graph. A search can keep timed lags between contours that
lie on each other. Where its clock was wrong, or it kept none, waits are added to its order. Of
the orders found the one that ends first is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from decmcts.feasibility.graph import DependencyGraph
from decmcts.planning.compiling.begin import begin_with, can_begin
from decmcts.planning.compiling.parts import FIRST
from decmcts.planning.events import Begun, Report, Step, Stop
from decmcts.planning.options import Search
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.toolpath import Toolpath
from decmcts.search.planners import SearchResult, keeps_lags, plan_order
from decmcts.search.sequence.planner import Planner
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sequence.timed_lags import TimedLags
from decmcts.team.schedule.cooling import TimedOrder, cooled

PROBE = 0.1  # share of the search time, for a first search that ignores cooling
CLOSE = 1e-3  # share of the print time by which the clock of a search may be wrong
LITTLE = 1e-3  # share of the print time; shorter waits cost less than keeping lags would

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

    def ready(self) -> bool:
        """Say whether what it begins with is compiled."""
        return can_begin(self.problem, self.asked.planner, at_once=self._repeats)

    def compile_cooling(self) -> None:
        """Compile what times orders with cooling, so that it takes none of the search time."""
        if self.timed_lags is not None:
            given = self.print_problem
            sliced = source_toolpath(self.problem)
            cooled(given.job, given.machine, given.graph, self.lags, sliced)

    def begin(self, stop: Stop) -> str | Planner:
        """Return the planner to begin with, compiled."""
        return begin_with(self.problem, self.asked.planner, stop, at_once=self._repeats)

    @property
    def _repeats(self) -> bool:
        """Whether equal seeds are to give equal orders, whatever is compiled."""
        return self.asked.max_iterations is not None

    def search(self, chosen: str | Planner, stopping: Stopping) -> SearchResult:
        """Search, for an order whose spots cool in time where there is such a rule."""
        asked, given = self.asked, self.print_problem
        self.report(Begun())
        if not stopping.is_asked():
            as_asked = chosen in (asked.planner, asked.name)
            began = "" if as_asked else f"; with {FIRST}, while the rest is compiled"
            self.report(Step(f"searching ({asked.name}, {asked.time_limit_s:g} s{began})"))
        if self.timed_lags is None:
            return self._run(chosen)(None, stopping)
        return search_cooled(
            given.job, given.machine, given.graph, self.lags,
            self.timed_lags if keeps_lags(chosen) else None, self._run(chosen),
            source_toolpath(self.problem), stopping=stopping, report=self.report,
        )  # fmt: skip

    def _run(self, chosen: str | Planner) -> RunSearch:
        """Return the search as a function of the timed lags it keeps and of what ends it."""

        def run(kept: TimedLags | None, stopping: Stopping) -> SearchResult:
            return plan_order(
                replace(self.problem, timed_lags=kept), planner=chosen,
                stopping=stopping, seed=self.asked.seed, progress=self.report, bound=self.bound,
            )  # fmt: skip

        return run


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
