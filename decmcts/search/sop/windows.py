"""Annealing of a bare sequence window by window, once a long annealing has ended.

Where a print goes from part to part is decided while it is hot, and a cold sequence cannot
change it any more. Each window is heated and cooled alone, so a bad place is mended
without putting the good ones at risk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.random import below, log_uniform, uniform
from decmcts.search.sequence.annealing import TemperatureSchedule
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sop.annealing import AnnealedSequence, quenched

_NODES = (20, 300)  # of a window, log-uniform
_HOT = (0.4, 1.0)  # first temperature in a window, in scales, log-uniform
_COLD = 0.05  # last temperature
_LENGTH = 3000  # proposals a node of the window
_WORSE = 0.07  # temperature at which a worse window is accepted, in scales; falls to 0
_ENDS = 0.95  # share of the budget at which it is 0
_BEHIND = 10.0  # of those temperatures; further behind, it goes on from the incumbent


@dataclass(slots=True)
class WindowThread:
    """Window after window of one sequence, each anywhere, accepted by the Metropolis rule."""

    sequence: AnnealedSequence
    scale: float  # of temperatures
    began: float  # budget spent when it began
    _schedule: TemperatureSchedule | None = None  # in the present window
    _nodes: NDArray[np.int32] | None = None  # its nodes as they were
    _cost: float = np.inf  # of the sequence before it
    _worse: float = 0.0  # temperature at which a worse window is accepted

    @staticmethod
    def of(sequence: AnnealedSequence, scale: float, incumbent: Incumbent) -> WindowThread:
        """Go on from the incumbent."""
        sequence.take(incumbent.order, incumbent.cost)
        sequence.best = incumbent.cost
        return WindowThread(sequence, scale, incumbent.spent, _cost=incumbent.cost)

    @property
    def best(self) -> float:
        """Least cost seen where the temperature changes."""
        return self.sequence.best

    def work(self, quota: int, spent: float) -> int:
        """Make `quota` proposals, in as many windows as that takes."""
        left, sequence = quota, self.sequence
        share = (spent - self.began) / max(_ENDS - self.began, 1e-9)
        self._worse = _WORSE * self.scale * max(1.0 - share, 0.0)
        while left > 0:
            if self._schedule is None:
                self._schedule = self._begin()
            left -= sequence.anneal(quenched(self._schedule, sequence.done / sequence.length), left)
            if sequence.ended:
                self._end()
        return quota

    def meet(self, incumbent: Incumbent) -> None:
        """Offer the best sequence seen; go on from the incumbent if far behind it."""
        self.sequence.offer_to(incumbent)
        if incumbent.cost < self._cost - _BEHIND * self._worse:
            self.sequence.take(incumbent.order, incumbent.cost)
            self.sequence.best = self._cost = incumbent.cost
            self._schedule = None

    def _begin(self) -> TemperatureSchedule:
        """Choose the next window; return its temperatures."""
        sequence, state = self.sequence, self.sequence.state
        order = sequence.bare.order
        nodes = min(int(log_uniform(state, *_NODES)), len(order) - 1)
        sequence.first = int(below(state, len(order) - nodes))
        sequence.last = sequence.first + nodes
        sequence.length, sequence.done = _LENGTH * nodes, 0
        self._nodes = order[sequence.first : sequence.last + 1].copy()
        self._cost = sequence.cost
        hot = log_uniform(state, *_HOT)
        return TemperatureSchedule(hot * self.scale, _COLD * self.scale)

    def _end(self) -> None:
        """Keep what the window has become, or put it back."""
        sequence, nodes = self.sequence, self._nodes
        assert nodes is not None
        self._schedule = None
        rise = sequence.cost - self._cost
        if rise > 0.0 and rise >= -self._worse * math.log(uniform(sequence.state)):
            sequence.take(nodes, self._cost, at=sequence.first)
        self._cost = sequence.cost
