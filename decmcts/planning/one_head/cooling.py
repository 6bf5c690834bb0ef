"""Searching an order in which no spot is printed over too soon.

Cooling is no edge of the dependency graph. A search can keep timed lags between contours that
lie on each other. Where its clock was wrong, or it kept none, waits are added to its order. Of
the orders found the one that ends first is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from decmcts._kernels.engine.lags import Lags
from decmcts.feasibility.graph import DependencyGraph
from decmcts.planning.events import Report, Step
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.toolpath import Toolpath
from decmcts.search.planners import SearchResult
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sequence.timed_lags import TimedLags
from decmcts.team.schedule.cooling import Timed, cooled

PROBE = 0.1  # share of the search time, for a first search that ignores cooling
CLOSE = 1e-3  # share of the print time by which the clock of a search may be wrong
LITTLE = 1e-3  # share of the print time; shorter waits cost less than keeping lags would

Run = Callable[[TimedLags | None, Stopping], SearchResult]
"""Searches with these lags, or ignoring cooling, until it is to end."""


def search_cooled(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    lags: Lags,
    timed_lags: TimedLags | None,
    search: Run,
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

    def keep(result: SearchResult) -> Timed:
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
