"""The search for one head: what it begins with, and how it heeds what must cool."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from decmcts._kernels.engine.lags import Lags
from decmcts.cli.ahead import FIRST
from decmcts.cli.begin import begin_with, can_begin
from decmcts.cli.beside import Stop
from decmcts.cli.quality import search_cooled
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.toolpath import Toolpath
from decmcts.search.planners import KEEP_TIME, Planner, SearchResult, plan_order
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.spacing import Spacing
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.schedule.cooling import cooled


@dataclass(frozen=True, slots=True)
class OrderSearch:
    """The search for one head, as it is begun and run."""

    job: PrintJob
    machine: Machine
    graph: DependencyGraph
    problem: OrderProblem
    lags: Lags  # by the times a search estimates
    spacing: Spacing | None
    planner: str
    time_limit_s: float
    seed: int
    announce: Callable[[str], None]
    hooks: dict[str, Any]

    def ready(self) -> bool:
        """Say whether what it begins with is compiled."""
        return can_begin(self.problem, self.planner)

    def compile_cooling(self) -> None:
        """Compile what times orders in which something must cool, off the clock."""
        if self.spacing is not None:
            sliced = source_toolpath(self.problem)
            cooled(self.job, self.machine, self.graph, self.lags, sliced)

    def begin(self, stop: Stop) -> str | Planner:
        """Return the planner to begin with, compiled."""
        return begin_with(self.problem, self.planner, stop)

    def search(self, chosen: str | Planner, stop: Stop) -> SearchResult:
        """Search, with an eye to cooling where there is such a rule."""
        if not stop():
            began = "" if chosen == self.planner else f"; with {FIRST}, while the rest is compiled"
            self.announce(f"searching ({self.planner}, {self.time_limit_s:g} s{began})")

        def run(heeded: Spacing | None, limit_s: float) -> SearchResult:
            spaced = replace(self.problem, spacing=heeded)
            return plan_order(
                spaced, planner=chosen, stopping=Stopping(seconds=limit_s, asked=stop),
                seed=self.seed, **self.hooks,
            )  # fmt: skip

        if self.spacing is None:
            return run(None, self.time_limit_s)
        return search_cooled(
            self.job, self.machine, self.graph, self.lags,
            self.spacing if chosen in KEEP_TIME else None, run, source_toolpath(self.problem),
            time_limit_s=self.time_limit_s, announce=self.announce,
        )  # fmt: skip


def source_toolpath(problem: OrderProblem) -> Toolpath:
    """Return the source's own order, with the seams where a policy names them."""
    sliced, seams = Toolpath.as_sliced(len(problem)), problem.seams
    if seams is None:
        return sliced
    return replace(sliced, entry=seams.vertices[seams.offsets[:-1]])
