"""Races of whole sequences, one a thread, from unlike starts.

What annealing ends in depends on what it begins with, and no start is best for all
prints. One thread begins with the best sequence so far, or with that of the trees. The
others begin with the plain start, by turns at a high temperature (`hot`) and at a lower
one that keeps some of the start's structure (`mild`). Where there is a layered start they
begin with what annealing within layers has made of it so far, at the high one. Once that
wins a race, every thread stays within layers, and the first begins at the lower
temperature. Were the best shared with all threads, their results would be alike.

After each race what all so far ended in is joined stretch by stretch: where layers
follow each other strictly, that has the best that was found of each. Then what the
best and the next best still differ in is annealed, the rest fused to runs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.search.hybrid.fusing import merge
from decmcts.search.hybrid.lanes import Lanes, anneal_rivals
from decmcts.search.hybrid.pieces import Sequence
from decmcts.search.hybrid.structure import Trees
from decmcts.search.sequence.annealing import Cooling
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.starts.layerwise import layer_runs


@dataclass(frozen=True, slots=True)
class Races:
    """How many races there are, and how hot: in mean travels before the first of them."""

    always: int = 1000  # contours up to which races beat sharing one sequence out,
    at_most: int = 6000  # or up to this many,
    least: float = 15_000.0  # if a lane has time for so many steps for each
    until: float = 0.65  # share of the budget at which they end
    steps: float = 3000.0  # of a lane in a race, for each contour and entry
    most: int = 8  # races
    settling: float = 0.2  # share of a race for what the best and a rival differ in; 0: none
    fused: float = 1.0  # temperature that begins with, in mean travels of what is not fused
    hot: float = 1.5
    mild: float = 0.7  # from here on some of the structure stays
    cold: float = 0.03

    def __post_init__(self) -> None:
        if min(self.steps, self.most) < 1:
            raise ValueError("steps and most: expected 1 or more")
        if min(self.hot, self.mild, self.cold, self.fused) <= 0.0:
            raise ValueError("hot, mild, cold and fused: expected more than 0")

    def suit(self, incumbent: Incumbent, lanes: Lanes) -> bool:
        """Tell whether whole sequences, one a thread, end better than one shared out."""
        n, enough = len(incumbent.problem), lanes.steps(incumbent.budget) / self.least
        return n <= self.always or n <= min(self.at_most, enough)

    def run(
        self,
        incumbent: Incumbent,
        near: NDArray[np.int32],
        lanes: Lanes,
        layered: Sequence | None,
        trees: Trees,
    ) -> bool:
        """Hold all races; return whether to stop. What is best is the incumbent's."""
        plain, ahead = Sequence.best_of(incumbent, near), False  # ahead: the layered one
        layers = layer_runs(incumbent.problem.layer)
        began, races = incumbent.spent, self._count(incumbent, lanes)
        length = (self.until - began) / races
        mean = incumbent.cost / len(incumbent.problem)  # of all races, lest they begin cooler
        ends: list[Sequence] = []  # of all lanes in all races,
        in_layers: list[Sequence] = []  # and of those that stayed within layers
        for number in range(races):
            other, best = plain if layered is None else layered, Sequence.best_of(incumbent, near)
            rivals = [other.copy() if ahead else best, *(other.copy() for _ in lanes.states[1:])]
            due = number in (0, races // 2) and not ahead
            if due and trees.turn(incumbent, lanes, rivals[0]):
                return True
            until = began + length * (number + 1)
            heats = self._heats(number, layered is not None, ahead, len(rivals))
            groups = _groups(layers, layered is not None, ahead, len(rivals))
            if incumbent.cost == 0.0:
                return True
            coolings = [Cooling(heat * mean, self.cold * mean) for heat in heats]
            race_ends = until - self.settling * length
            if anneal_rivals(incumbent, rivals, lanes, coolings, race_ends, groups=groups):
                return True
            ends += rivals
            found = lanes.join([Sequence.best_of(incumbent, near), *ends])
            found.settle()
            incumbent.offer(found.order, found.flip, found.seat)
            if layered is not None and len(rivals) > 1:
                in_layers += rivals[0 if ahead else 1 :]
                layered = lanes.join([layered, *in_layers])
                layered.settle()
                incumbent.offer(layered.order, layered.flip, layered.seat)
                ahead = ahead or rivals[-1].cost < rivals[0].cost
            if self._settle(incumbent, Sequence.best_of(incumbent, near), rivals, lanes, until):
                return True
        return False

    def _count(self, incumbent: Incumbent, lanes: Lanes) -> int:
        """Return how many races there is time for."""
        choices, seams = len(incumbent.problem), incumbent.problem.seams
        if seams is not None:
            choices += int((np.diff(seams.offsets) - 1).clip(0).sum())
        steps = lanes.steps(incumbent.budget) * (self.until - incumbent.spent)
        return int(min(max(1.0, steps / (self.steps * choices)), self.most))

    def _heats(self, number: int, has_layered: bool, ahead: bool, count: int) -> list[float]:
        """Return how hot each of `count` lanes begins, in mean travels."""
        other = self.mild if number % 2 and not has_layered else self.hot
        return [self.mild if ahead else self.hot, *[other] * (count - 1)]

    def _settle(
        self,
        incumbent: Incumbent,
        best: Sequence,
        rivals: list[Sequence],
        lanes: Lanes,
        until: float,
    ) -> bool:
        """Anneal what the best sequence and the next best differ in; return whether to stop."""
        others = [rival for rival in rivals if rival.cost > best.cost]
        if not others or self.settling == 0.0:
            return False
        fused = merge(best, min(others, key=lambda rival: rival.cost))
        if len(fused.problem) < 2:
            return False
        starts = [fused.start() for _ in lanes.states]
        mean = starts[0].cost / len(fused.problem)
        coolings = [Cooling(self.fused * mean, self.cold * mean) for _ in starts]
        return mean > 0.0 and anneal_rivals(incumbent, starts, lanes, coolings, until, fused=fused)


def _groups(
    layers: NDArray[np.int32], has_layered: bool, ahead: bool, count: int
) -> list[NDArray[np.int32]]:
    """Return what the moves of each of `count` lanes stay within: layers, or the whole."""
    whole = np.zeros_like(layers)
    return [layers if ahead else whole, *[layers if has_layered else whole] * (count - 1)]
