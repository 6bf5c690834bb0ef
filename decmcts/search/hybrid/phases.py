"""The planner `hybrid`: phases, one after the other, until the search is over.

Prints whose layers have few contours are solved exactly, if there is time.
Else what follows depends on size and time: several starts annealed as whole sequences
(`multistart`), or blocks of one sequence shared out among the threads (`partition`); and
then windows put in their best order (`windows`). Last comes a descent. Where a problem has
time lags, annealing takes the place of all that: the other phases do not look at when a
contour is printed, so they would break lags.

References
----------
Gambardella & Dorigo 2000 (moves).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from decmcts.search.bounds.exact import WIDEST, Patience, solve_exactly
from decmcts.search.decomposition.threads import anneal_rounds, descend_fully, open_threads
from decmcts.search.hybrid.multistart import Multistart
from decmcts.search.hybrid.partition import Partition
from decmcts.search.hybrid.search import HybridSearch, SearchPhase
from decmcts.search.hybrid.starts import LayeredStart, Starts
from decmcts.search.hybrid.windows import Windows
from decmcts.search.sequence.annealing import DESCENT_FROM
from decmcts.search.sequence.incumbent import Incumbent


@dataclass(frozen=True, slots=True)
class Exact:
    """An exact solution, given up soon where it would take too long; times in shares."""

    probe: float = 0.15  # for finding out how long an exact solution would take
    share: float = 0.75  # the longest it may take; 0: no exact solutions

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Solve the problem if it can be solved in time; then the search is over."""
        incumbent = search.incumbent
        if self.share > 0.0:
            patience, widest = Patience(lambda: incumbent.spent, self.probe, self.share), WIDEST
            if incumbent.stopping.iterations is not None:
                widest = min(widest, 1 + int(self.probe * incumbent.stopping.iterations))

            def go_on(made: int, share: float) -> bool:
                incumbent.tick(made)
                return not incumbent.over and patience.lasts(share)

            optimum = solve_exactly(incumbent.problem, go_on, widest=widest)
            if optimum is not None:
                incumbent.offer(optimum.order, optimum.reversed, optimum.entry_id)
                incumbent.prove(optimum.bound)
                incumbent.finish()
        incumbent.tick()
        yield


@dataclass(frozen=True, slots=True)
class Lagged:
    """Annealing that keeps time lags, of a whole sequence on each thread.

    It begins with the source's own order, which keeps them. Temperatures are in mean travels.
    """

    rounds: tuple[float, ...] = (0.1, DESCENT_FROM)  # shares at which rounds end
    hot: float = 0.5
    cold: float = 0.03

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Anneal in rounds."""
        search.incumbent.tick()
        yield
        yield from anneal_rounds(
            search.incumbent, search.near, search.threads, self.rounds, hot=self.hot, cold=self.cold
        )


@dataclass(frozen=True, slots=True)
class Descent:
    """The last of each search: the nearest local optimum, directions and entries that suit it."""

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Take moves that gain, as long as there are any."""
        incumbent = search.incumbent
        incumbent.offer_order(incumbent.order)
        descend_fully(incumbent, search.near)
        incumbent.offer_order(incumbent.order)
        yield


@dataclass(frozen=True, slots=True)
class Hybrid:
    """The phases, each with its parameters, and the number of threads."""

    starts: Starts = field(default_factory=Starts)
    exact: Exact = field(default_factory=Exact)
    layered: LayeredStart = field(default_factory=LayeredStart)
    multistart: Multistart = field(default_factory=Multistart)
    partition: Partition = field(default_factory=Partition)
    windows: Windows = field(default_factory=Windows)
    descent: Descent = field(default_factory=Descent)
    lagged: Lagged = field(default_factory=Lagged)  # where there are time lags
    crosses: bool = True  # whether results of threads are crossed; else the best is taken
    threads: int = 2  # fixed, so that results do not depend on the machine

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise ValueError("threads: expected 1 or more")

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Run the phases until the search is over, at the latest when no travel is left."""
        if len(incumbent.problem) < 2:
            return
        with open_threads(self.threads, seed, crosses=self.crosses) as threads:
            for _ in self._steps(HybridSearch(incumbent, threads)):
                if incumbent.over:
                    break

    def _steps(self, search: HybridSearch) -> Iterator[None]:
        """Yield wherever the search may end."""
        for phase in self.phases(search):
            yield from phase.run(search)
            yield

    def phases(self, search: HybridSearch) -> Iterator[SearchPhase]:
        """Yield the phases; each is chosen when it is due."""
        if search.incumbent.problem.timed_lags is not None:
            yield self.lagged
            yield self.descent
            return
        yield self.starts
        yield self.exact
        yield self.layered
        if self.multistart.suits(search):
            yield self.multistart
            yield self.windows
        else:
            yield self.partition
            if self.partition.affords_windows(search):
                yield self.windows
        yield self.descent
