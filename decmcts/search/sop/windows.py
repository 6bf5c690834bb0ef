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

from decmcts.random_kernels import below, log_uniform, uniform
from decmcts.search.sequence.annealing import TemperatureSchedule
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sop.annealing import Annealer, LubyAnnealer, quenched

_NODES = (20, 300)  # of a window, log-uniform
_HOT = (0.4, 1.0)  # first temperature in a window, in scales, log-uniform
_COLD = 0.05  # last temperature
_LENGTH = 3000  # proposals a node of the window
_WORSE = 0.07  # temperature at which a worse window is accepted, in scales; falls to 0
_ENDS = 0.95  # share of the budget at which it is 0
_BEHIND = 10.0  # of those temperatures; further behind, it goes on from the incumbent


@dataclass(slots=True, kw_only=True)
class WindowAnnealer(Annealer):
    """Window after window of one sequence, each anywhere, accepted by the Metropolis rule."""

    scale: float  # of temperatures
    began: float  # budget spent when it began
    _schedule: TemperatureSchedule | None = None  # in the present window
    _nodes: NDArray[np.int32] | None = None  # its nodes as they were
    _kept: float = np.inf  # cost of the sequence before it
    _worse: float = 0.0  # temperature at which a worse window is accepted

    @staticmethod
    def after(annealer: LubyAnnealer, incumbent: Incumbent) -> WindowAnnealer:
        """Take the place of an annealer, and go on from the incumbent."""
        windows = WindowAnnealer(
            bare=annealer.bare, shares=annealer.shares, state=annealer.state,
            scale=annealer.scale, began=incumbent.spent,
        )  # fmt: skip
        windows._restart(incumbent)
        return windows

    def work(self, quota: int, spent: float) -> int:
        """Make `quota` proposals, in as many windows as that takes."""
        share = (spent - self.began) / max(_ENDS - self.began, 1e-9)
        self._worse = _WORSE * self.scale * max(1.0 - share, 0.0)
        return Annealer.work(self, quota, spent)

    def temperature(self, spent: float) -> float:
        """Return the temperature at which the present window goes on; choose one if there is none.

        Then mutates the generator.
        """
        if self._schedule is None:
            self._schedule = self._begin()
        return quenched(self._schedule, self.done / self.length)

    def meet(self, incumbent: Incumbent) -> None:
        """Offer the best sequence seen; go on from the incumbent if far behind it."""
        Annealer.meet(self, incumbent)
        if incumbent.cost < self._kept - _BEHIND * self._worse:
            self._restart(incumbent)

    def _restart(self, incumbent: Incumbent) -> None:
        self.take(incumbent.order, incumbent.cost)
        self.best = self._kept = incumbent.cost
        self._schedule = None

    def _begin(self) -> TemperatureSchedule:
        """Choose the next window; return its temperatures."""
        state, order = self.state, self.bare.order
        nodes = min(int(log_uniform(state, *_NODES)), len(order) - 1)
        self.first = int(below(state, len(order) - nodes))
        self.last = self.first + nodes
        self.length, self.done = _LENGTH * nodes, 0
        self._nodes = order[self.first : self.last + 1].copy()
        self._kept = self.cost
        hot = log_uniform(state, *_HOT)
        return TemperatureSchedule(hot * self.scale, _COLD * self.scale)

    def end(self, spent: float) -> None:
        """Keep what the window has become, or put it back."""
        nodes, rise = self._nodes, self.cost - self._kept
        assert nodes is not None
        self._schedule = None
        if rise > 0.0 and rise >= -self._worse * math.log(uniform(self.state)):
            self.take(nodes, self._kept, at=self.first)
        self._kept = self.cost
