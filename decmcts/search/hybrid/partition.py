"""A partition of one sequence among all threads, for prints too large for several starts.

On the largest prints a layered start is annealed within layers first. Then come a fast
annealing and a long one. The long one has long blocks while hot, when long moves decide the
large structure, and many short ones while cold. Where there is time enough it ends early, to
leave some for windows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.decomposition.threads import anneal_blocks, anneal_sequences
from decmcts.search.hybrid.search import HybridSearch
from decmcts.search.sequence.annealing import DESCENT_FROM, TemperatureSchedule
from decmcts.search.sequence.greedy import layer_runs


@dataclass(frozen=True, slots=True)
class Partition:
    """Shares of the search, and temperatures in multiples of the mean travel."""

    layers_from: int = 6000  # contours from which a layered start is annealed first
    layers: float = 0.06  # share for that
    first: float = 0.05  # share for a first, fast annealing
    half_way: float = 0.5  # share at which blocks become short
    windows_from: float = 0.85  # share at which windows begin,
    for_windows: float = 2000.0  # if there are so many steps for each contour in all
    until: float = DESCENT_FROM  # else share at which the long annealing ends
    blocks: tuple[int, int] = (1, 4)  # of each thread, hot and cold; 0: whole sequences alone
    hot: float = 1.5
    warm: float = 0.2  # below this the large structure stays
    cold: float = 0.03

    def __post_init__(self) -> None:
        if min(self.hot, self.warm, self.cold) <= 0.0:
            raise ValueError("hot, warm and cold: expected more than 0")

    def affords_windows(self, search: HybridSearch) -> bool:
        """Tell whether, at the pace so far, there is time for windows."""
        incumbent = search.incumbent
        steps_each = incumbent.iterations / (incumbent.spent * len(incumbent.problem))
        return steps_each >= self.for_windows

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Anneal the best sequence on all threads together."""
        large = len(search.incumbent.problem) >= self.layers_from
        if large and search.layered is not None:
            yield from self._within_layers(search, search.layered)
        long, short = self.blocks
        fast = search.schedule(self.hot, self.cold)
        until = search.incumbent.spent + self.first
        yield from self._anneal(search, search.best(), fast, until, long)
        sequence = search.best()
        hot = search.schedule(self.hot, self.warm)
        cold = search.schedule(self.warm, self.cold)  # of the same mean travel
        yield from self._anneal(search, sequence, hot, self.half_way, long)
        if search.incumbent.cost < sequence.cost:  # found by the first annealing
            sequence = search.best()
        ends = self.windows_from if self.affords_windows(search) else self.until
        yield from self._anneal(search, sequence, cold, ends, short)

    def _anneal(
        self,
        search: HybridSearch,
        sequence: Sequence,
        schedule: TemperatureSchedule,
        until: float,
        blocks: int,
    ) -> Iterator[None]:
        """Anneal the sequence in blocks, shared out among the threads."""
        yield from anneal_blocks(
            search.incumbent, sequence, search.threads, schedule, until, blocks=blocks
        )

    def _within_layers(self, search: HybridSearch, layered: Sequence) -> Iterator[None]:
        """Anneal within layers on each thread, and cross the results."""
        incumbent, threads = search.incumbent, search.threads
        sequences, until = [layered.copy() for _ in threads.states], incumbent.spent + self.layers
        schedules = [search.schedule(self.hot, self.cold)] * len(sequences)
        groups = [layer_runs(incumbent.problem.layer)] * len(sequences)
        yield from anneal_sequences(incumbent, sequences, threads, schedules, until, groups=groups)
        found = threads.join(sequences)
        found.choose_entries()
        found.offer_to(incumbent)
        yield
