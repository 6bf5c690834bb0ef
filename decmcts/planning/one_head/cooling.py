"""Orders in which what is printed over has cooled.

Cooling is no edge of the graph: a search keeps the time between what lies on each
other where that matters, what it could not foresee is waited for, and of all orders
found the one that is done first is taken.
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

PROBE = 0.1  # share of the search time for finding out whether cooling costs any
CLOSE = 1e-3  # share of the print time by which the clock of a search may be wrong
LITTLE = 1e-3  # share of the print time: waits that cost less than a search heeding time would

Run = Callable[[TimedLags | None, Stopping], SearchResult]
"""Searches with the time lags to heed, until it is to end."""


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
    """Return the order with the least time, waits included.

    `stopping` is of both searches together, but each may make all iterations.
    A short search without regard to cooling shows whether it costs much. If so, one
    that heeds `timed_lags`, time between what lies on each other, gets the rest; else, or
    where that is None, another one without. `sliced`, the source's own order, waits for
    nothing, so the result is never slower than it but for what the clock of a search may
    be wrong by. Its cost is that of the search, before anything was moved to make use of
    waits; its bound holds with cooling and without.
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
