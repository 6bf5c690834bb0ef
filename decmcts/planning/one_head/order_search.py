"""The search for one head: the planner it begins with, and how it takes account of cooling."""

from __future__ import annotations

from dataclasses import dataclass, replace

from decmcts._kernels.engine.lags import Lags
from decmcts.planning.compiling.begin import begin_with, can_begin
from decmcts.planning.compiling.parts import FIRST
from decmcts.planning.events import Begun, Report, Step, Stop
from decmcts.planning.one_head.cooling import Run, search_cooled
from decmcts.planning.options import Search
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.toolpath import Toolpath
from decmcts.search.planners import SearchResult, keeps_lags, plan_order
from decmcts.search.sequence.planner import Planner
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sequence.timed_lags import TimedLags
from decmcts.team.schedule.cooling import cooled


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

    def _run(self, chosen: str | Planner) -> Run:
        """Return the search as a function of the timed lags it keeps and of what ends it."""

        def run(kept: TimedLags | None, stopping: Stopping) -> SearchResult:
            return plan_order(
                replace(self.problem, timed_lags=kept), planner=chosen,
                stopping=stopping, seed=self.asked.seed, progress=self.report, bound=self.bound,
            )  # fmt: skip

        return run


def source_toolpath(problem: OrderProblem) -> Toolpath:
    """Return the source's own order, loops entered as sliced or where the seam policy says."""
    sliced, seams = Toolpath.as_sliced(len(problem)), problem.seams
    if seams is None:
        return sliced
    return replace(sliced, entry=seams.vertices[seams.offsets[:-1]])
