"""What a maker asks of an order besides safety, as the command line offers it.

Edges (shells and what is anchored in them, a limit to how far a part may run
ahead) go into the graph. Cooling is no edge: a search keeps the time between what
lies on each other where that matters, what it could not foresee is waited for, and
of all orders found the one that is done first is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from decmcts._kernels.engine.lags import Lags
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.search.planners import SearchResult
from decmcts.search.sequence.spacing import Spacing
from decmcts.team.schedule.cooling import Timed, cooled

PROBE = 0.1  # share of the search time for finding out whether cooling costs any
CLOSE = 1e-3  # share of the print time by which the clock of a search may be wrong
LITTLE = 1e-3  # share of the print time: waits that cost less than a search heeding time would

Search = Callable[[Spacing | None, float], SearchResult]


@dataclass(frozen=True, slots=True)
class Quality:
    """What was asked for; None leaves it to the machine and the source."""

    edges: bool | None = None  # None: on, but not for the paper's machine
    min_layer_time_s: float | None = None  # None: the slicer's own rule
    max_layers_ahead: int | None = None  # None: no limit

    def holds(self, machine: Machine) -> bool:
        """Whether shells and anchors keep their order; the paper's model knows of none."""
        return machine.bead_width if self.edges is None else self.edges

    def rule_s(self, job: PrintJob, machine: Machine) -> float:
        """Return the seconds no spot is printed over in; 0: no rule."""
        if self.min_layer_time_s is not None:
            return self.min_layer_time_s
        return job.settings.min_layer_time_s if self.holds(machine) else 0.0


def search_cooled(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    lags: Lags,
    spacing: Spacing | None,
    search: Search,
    sliced: Toolpath,
    *,
    time_limit_s: float,
    announce: Callable[[str], None],
) -> SearchResult:
    """Return the order with the least time, waits included.

    A short search without regard to cooling shows whether it costs much. If so, one
    that heeds `spacing`, time between what lies on each other, gets the rest; else, or
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

    probed = keep(search(None, PROBE * time_limit_s))
    if probed.at_first_s <= LITTLE * probed.seconds:
        spacing = None
    if spacing is not None:
        announce("searching orders that let spots cool")
    keep(search(spacing, (1.0 - PROBE) * time_limit_s))
    seconds, result = min(tries, key=lambda one: one[0])
    bound = max((r.bound for _, r in tries if r.bound is not None), default=None)
    if seconds > (1.0 + CLOSE) * cooled(job, machine, graph, lags, sliced).seconds:
        result = replace(tries[0][1], toolpath=sliced, cost=result.source_cost)
    return replace(result, bound=bound)


def cooling_line(document: PlanDocument) -> str | None:
    """Return one line on how long a plan waits for cooling; None where no rule was asked for."""
    rule, metrics = document.min_layer_time_s, document.metrics
    if rule <= 0.0:
        return None
    count = metrics["waits"]
    waits = f"waits {metrics['waits_s']:,.1f} s for cooling in {count} place{'s' * (count != 1)}"
    due = f"a spot is printed over after {rule:g} s, or as soon as in the source"
    if metrics.get("as_sliced"):
        return f"the source's own order was the fastest ({due}; --min-layer-time 0 drops this rule)"
    return f"{waits if count else 'no wait for cooling'}: {due}"
