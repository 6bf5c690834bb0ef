"""Several starts (multistart): whole sequences, one a thread, from unlike beginnings.

How good the result of annealing is depends on the start, and no start is best for all
prints. In each round the first thread begins with the best sequence so far. The other threads
do not, since their results would be like that of the first. They begin:

- where there is no layered start, with the best of the first starts, by turns at a high
  temperature (`hot`) and at a lower one that keeps some of its structure (`mild`);
- where there is a layered start, with what annealing within layers has made of it so
  far, at the high temperature. Once this wins a round every thread stays within layers,
  and the first begins at the lower temperature.

After each round the results of all rounds so far are crossed (partition crossover,
`decmcts.search.decomposition.blocks.crossover`). Where layers follow each other strictly this
takes the best result of each layer.

**Partition**: prints too large for several starts are one sequence shared among all threads. On the
largest prints a layered start is annealed within layers first. Then come a fast annealing and a
long one. The long one has long blocks while hot, when long moves decide the large structure, and
many short ones while cold. Where there is time enough it ends early, to leave some for windows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from decmcts.search.decomposition.blocks import Sequence, crossover
from decmcts.search.decomposition.threads import anneal_blocks, anneal_sequences
from decmcts.search.hybrid.search import HybridSearch
from decmcts.search.sequence.greedy import layer_runs
from decmcts.search.sequence.stopping import DESCENT_FROM, TemperatureSchedule


@dataclass(frozen=True, slots=True)
class Multistart:
    """How many rounds there are, and their temperatures, in mean travels before the first."""

    always: int = 1000  # contours up to which several starts beat a partition of one sequence,
    at_most: int = 6000  # or up to this many,
    least: float = 3_000.0  # if a thread has time for so many steps for each
    until: float = 0.85  # share at which they end
    steps: float = 3000.0  # of a thread in a round, for each contour and entry
    most: int = 8  # rounds
    hot: float = 1.5
    mild: float = 0.7  # below this some of the start's structure stays
    cold: float = 0.03

    def suits(self, search: HybridSearch) -> bool:
        """Tell whether one whole sequence a thread is better than a partition of one among them."""
        n, steps = len(search.incumbent.problem), search.threads.steps(search.incumbent.stopping)
        return n <= self.always or n <= min(self.at_most, steps / self.least)

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Anneal all starts, round by round; offer what is found."""
        incumbent, threads = search.incumbent, search.threads
        plain, layered = search.best(), search.layered
        layers, layered_won = layer_runs(incumbent.problem.layer), False
        whole = np.zeros_like(layers)
        began, rounds = incumbent.spent, self.rounds(search)
        length = (self.until - began) / rounds
        mean = incumbent.cost / len(incumbent.problem)  # the same in all rounds
        ends: list[Sequence] = []  # results of all threads in all rounds,
        in_layers: list[Sequence] = []  # and of those that stayed within layers
        for number in range(rounds):
            other, best = plain if layered is None else layered, search.best()
            sequences = [
                other.copy() if layered_won else best,
                *(other.copy() for _ in threads.states[1:]),
            ]
            until = began + length * (number + 1)
            first_hot = self.mild if layered_won else self.hot
            other_hot = self.mild if number % 2 and layered is None else self.hot
            schedules = [
                TemperatureSchedule(hot * mean, self.cold * mean)
                for hot in (first_hot, *[other_hot] * (len(sequences) - 1))
            ]
            groups = [layers if layered_won else whole]
            groups += [whole if layered is None else layers] * (len(sequences) - 1)
            yield from anneal_sequences(
                incumbent, sequences, threads, schedules, until, groups=groups
            )
            ends += sequences
            found = crossover([search.best(), *ends])
            found.choose_entries()
            found.offer_to(incumbent)
            if layered is not None and len(sequences) > 1:
                in_layers += sequences[0 if layered_won else 1 :]
                layered = crossover([layered, *in_layers])
                layered.choose_entries()
                layered.offer_to(incumbent)
                layered_won = layered_won or sequences[-1].cost < sequences[0].cost

    def rounds(self, search: HybridSearch) -> int:
        """Return how many rounds there is time for."""
        incumbent, problem = search.incumbent, search.incumbent.problem
        choices = len(problem)
        if problem.seams is not None:
            choices += int((np.diff(problem.seams.offsets) - 1).clip(0).sum())
        steps = search.threads.steps(incumbent.stopping) * (self.until - incumbent.spent)
        return int(min(max(1.0, steps / (self.steps * choices)), self.most))


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

    def affords_windows(self, search: HybridSearch) -> bool:
        """Tell whether, at the pace so far, there is time for windows."""
        incumbent = search.incumbent
        steps_each = incumbent.iterations / (incumbent.spent * len(incumbent.problem))
        return steps_each >= self.for_windows

    def run(self, search: HybridSearch) -> Iterator[None]:
        """Anneal the best sequence on all threads together."""
        incumbent, threads = search.incumbent, search.threads
        large = len(incumbent.problem) >= self.layers_from
        if large and search.layered is not None:
            yield from self._within_layers(search, search.layered)
        long, short = self.blocks
        fast = search.schedule(self.hot, self.cold)
        until = incumbent.spent + self.first
        yield from anneal_blocks(incumbent, search.best(), threads, fast, until, blocks=long)
        sequence = search.best()
        hot = search.schedule(self.hot, self.warm)
        cold = search.schedule(self.warm, self.cold)  # of the same mean travel
        yield from anneal_blocks(incumbent, sequence, threads, hot, self.half_way, blocks=long)
        if incumbent.cost < sequence.cost:  # found by the first annealing
            sequence = search.best()
        ends = self.windows_from if self.affords_windows(search) else self.until
        yield from anneal_blocks(incumbent, sequence, threads, cold, ends, blocks=short)

    def _within_layers(self, search: HybridSearch, layered: Sequence) -> Iterator[None]:
        """Anneal within layers on each thread, and cross the results."""
        incumbent, threads = search.incumbent, search.threads
        sequences, until = [layered.copy() for _ in threads.states], incumbent.spent + self.layers
        schedules = [search.schedule(self.hot, self.cold)] * len(sequences)
        groups = [layer_runs(incumbent.problem.layer)] * len(sequences)
        yield from anneal_sequences(incumbent, sequences, threads, schedules, until, groups=groups)
        found = crossover(sequences)
        found.choose_entries()
        found.offer_to(incumbent)
        yield
