"""Annealing where contours that lie on each other must be some time apart.

The other phases do not look at when a contour is printed, so they would break lags.
Here each thread anneals a whole sequence with moves that keep the lags. It begins with
the source's own order, which keeps them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from decmcts.search.decomposition.threads import anneal_sequences
from decmcts.search.hybrid.search import Search
from decmcts.search.sequence.annealing import DESCENT_FROM, descend_fully, tour_of


@dataclass(frozen=True, slots=True)
class Lagged:
    """Rounds of annealing, each from the best so far; temperatures in mean travels."""

    rounds: tuple[float, ...] = (0.1, DESCENT_FROM)  # shares at which rounds end
    hot: float = 0.5
    cold: float = 0.03

    def run(self, search: Search) -> Iterator[None]:
        """Anneal in rounds, and descend."""
        incumbent, threads = search.incumbent, search.threads
        incumbent.tick()
        yield
        for until in self.rounds:
            sequences = [search.best() for _ in threads.states]
            schedules = [search.schedule(self.hot, self.cold)] * len(sequences)
            yield from anneal_sequences(incumbent, sequences, threads, schedules, until)
        descend_fully(incumbent, tour_of(incumbent, search.near))
        incumbent.offer_order(incumbent.order)
