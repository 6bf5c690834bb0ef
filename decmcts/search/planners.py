"""The planners by name, and the function that runs them.

This is the composition root of the search: it runs a planner on a problem until the
search is to end, and prices toolpaths. Each planner lives in a module of its own.

`Meanwhile` begins with another planner until what it needs itself is ready. On a computer where
nothing is compiled yet the search begins with a planner that needs few kernels. When the kernels of
the other planner are there, that one goes on from the best sequence with the time that is left.
Phases of it whose share of the time has passed by then are left out.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from decmcts.arrays import Floats
from decmcts.print.toolpath import Toolpath
from decmcts.search.baselines.local import Layerwise, Local
from decmcts.search.baselines.mcts import Mcts
from decmcts.search.hybrid.phases import Hybrid
from decmcts.search.sequence.entries_kernels import visits_cost
from decmcts.search.sequence.greedy import Greedy
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.planner import Planner
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Progress, Stopping


@dataclass(frozen=True, slots=True)
class SourceOrder:
    """Leaves everything as it was sliced."""

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Do nothing: the incumbent starts as the source."""
        incumbent.tick()


PLANNERS: Mapping[str, Planner] = MappingProxyType(
    {
        "slicer": SourceOrder(),
        "layerwise": Layerwise(),
        "greedy": Greedy(),
        "local": Local(),
        "mcts": Mcts(),
        "hybrid": Hybrid(),
    }
)

KEEP_LAGS = ("layerwise", "local", "hybrid")
"""Planners that find orders which keep a problem's time lags."""


def keeps_lags(planner: str | Planner) -> bool:
    """Tell whether a planner, by name or not, finds orders that keep a problem's time lags."""
    if isinstance(planner, Meanwhile):
        return keeps_lags(planner.first) and keeps_lags(planner.then)
    return planner in KEEP_LAGS or planner in [PLANNERS[name] for name in KEEP_LAGS]


@dataclass(frozen=True, slots=True)
class SearchResult:
    """What a search found; never worse than the source."""

    toolpath: Toolpath
    cost: float  # of the travels the search found, in `unit`
    source_cost: float  # of the travels of the source
    unit: str  # "mm", "s", or "" for bare costs
    iterations: int
    history: Floats  # (k, 3) seconds, iterations, cost at each improvement
    planner: str
    seed: int
    bound: float | None = None  # no sequence of the problem costs less, if known


def plan_order(
    problem: OrderProblem,
    *,
    planner: str | Planner,
    stopping: Stopping,
    seed: int,
    clock: Callable[[], float] = time.monotonic,
    progress: Callable[[Progress], None] | None = None,
    bound: float | None = None,
) -> SearchResult:
    """Search for a sequence whose travels cost little, in mm, seconds or bare costs.

    However the search ends, the result is the best sequence so far.

    Equal seeds and equal limits of iterations give equal results, provided nothing else
    ends the search.

    Parameters
    ----------
    planner : str | Planner
        One of `PLANNERS` by name, or a planner of your own making.
    stopping : Stopping
        What ends the search. A limit of seconds may be exceeded by a fraction of one
        second and the time of one greedy pass.
    clock : Callable[[], float]
        Seconds; only differences matter. Threads ask it at the same time.
    bound : float | None
        A cost that no sequence is below, if known; part of what `progress` is called with.
        Where the planner proves a higher one, the result has that.

    Raises
    ------
    ValueError
        If the planner is unknown.
    """
    chosen = PLANNERS.get(planner) if isinstance(planner, str) else planner
    if chosen is None:
        raise ValueError(f"planner {planner!r} is unknown, expected one of {', '.join(PLANNERS)}")
    incumbent = Incumbent(problem, clock=clock, stopping=stopping, report=progress, bound=bound)
    chosen.plan(incumbent, seed=seed)
    return SearchResult(
        _toolpath(incumbent),
        incumbent.cost,
        incumbent.source_cost,
        problem.unit,
        incumbent.iterations,
        incumbent.history,
        planner if isinstance(planner, str) else type(planner).__name__.lower(),
        seed,
        incumbent.bound,
    )


def toolpath_cost(problem: OrderProblem, toolpath: Toolpath) -> float:
    """Return what the travels of a toolpath for all contours cost, in the problem's unit.

    Raises
    ------
    ValueError
        If it enters a contour where the problem has no entry.
    """
    n, order, seams = len(problem), toolpath.order, problem.seams
    is_reversed, entry_id = np.zeros(n, np.uint8), np.full(n, -1, np.int32)
    is_reversed[order] = toolpath.reversed
    if seams is not None:
        entry = np.zeros(n, np.int64)
        entry[order] = toolpath.entry
        most = 1 + max(int(seams.vertices.max(initial=0)), int(entry.max(initial=0)))
        possible = seams.owner.astype(np.int64) * most + seams.vertices
        wanted = np.arange(n) * most + entry
        place = np.searchsorted(possible, wanted)
        if not (np.append(possible, -1)[place] == wanted).all():
            raise ValueError("a contour is entered where it has no entry")
        entry_id = np.where(np.diff(seams.offsets) > 1, place, -1).astype(np.int32)
    return float(visits_cost(problem.metric(), order, is_reversed, entry_id))


def _toolpath(incumbent: Incumbent) -> Toolpath:
    """Return the best sequence as a toolpath."""
    order, seams = incumbent.order, incumbent.problem.seams
    toolpath = Toolpath.of(order, incumbent.reversed[order].astype(np.bool_))
    if seams is None:
        return toolpath
    possible = np.where(incumbent.entry_id >= 0, incumbent.entry_id, seams.offsets[:-1])
    return replace(toolpath, entry=np.ascontiguousarray(seams.vertices[possible][order], np.int32))


@dataclass(frozen=True, slots=True)
class Meanwhile:
    """Let `first` search until `ready`, then `then`."""

    first: Planner
    then: Planner
    ready: Callable[[], bool]

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the budget."""
        if not self.ready():
            with incumbent.ending_when(self.ready):
                self.first.plan(incumbent, seed=seed)
            if incumbent.over or not self.ready():
                return
        self.then.plan(incumbent, seed=seed)
