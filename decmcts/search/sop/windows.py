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
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import TemperatureSchedule
from decmcts.search.sop.annealing import SHARES, Annealer, LubyAnnealer, quenched
from decmcts.search.sop.annealing_kernels import Bare, anneal_bare

_NODES = (20, 300)  # of a window, log-uniform
_HOT = (0.4, 1.0)  # first temperature in a window, in scales, log-uniform
_COLD = 0.05  # last temperature
_LENGTH, _STEPS = 3000, 100  # proposals a node of the window, and temperatures
_WORSE = 0.07  # temperature at which a worse window is accepted, in scales; falls to 0
_BEHIND = 10.0  # of those temperatures; further behind, it goes on from the incumbent


def worse_at(scale: float, share: float) -> float:
    """Return the temperature at which a worse window is accepted at a share of the time."""
    return _WORSE * scale * max(1.0 - share, 0.0)


def anneal_window(
    bare: Bare,
    state: NDArray[np.uint64],
    scale: float,
    worse: float,
    first: int,
    last: int,
) -> tuple[int, float]:
    """Anneal a random window between two positions; return the proposals and the cost's change.

    A window that gets worse is put back, or kept by the Metropolis rule at the temperature `worse`.
    Mutates the generator.
    """
    nodes = min(int(log_uniform(state, *_NODES)), last - first)
    at = first + int(below(state, last - first - nodes + 1))
    hot = log_uniform(state, *_HOT)
    schedule = TemperatureSchedule(hot * scale, _COLD * scale)
    before, rise = bare.order[at : at + nodes + 1].copy(), 0.0
    step = max(_LENGTH * nodes // _STEPS, 1)
    for k in range(_STEPS):
        temperature = quenched(schedule, k / _STEPS)
        rise += anneal_bare(bare, SHARES, state, temperature, step, at, at + nodes)
    if rise > 0.0 and rise >= -worse * math.log(uniform(state)):
        bare.order[at : at + nodes + 1] = before
        bare.position[before] = np.arange(at, at + nodes + 1)
        rise = 0.0
    return step * _STEPS, rise


@dataclass(slots=True, kw_only=True)
class WindowAnnealer(Annealer):
    """Window after window of one sequence, each anywhere."""

    scale: float  # of temperatures
    began: float  # budget spent when it began
    _worse: float = 0.0  # temperature at which a worse window is accepted

    @staticmethod
    def after(annealer: LubyAnnealer, incumbent: Incumbent) -> WindowAnnealer:
        """Take the place of an annealer, and go on from the incumbent."""
        windows = WindowAnnealer(
            bare=annealer.bare, state=annealer.state, scale=annealer.scale, began=incumbent.spent
        )
        windows._restart(incumbent)
        return windows

    def work(self, quota: int, spent: float) -> int:
        """Anneal windows until `quota` proposals are made; return how many were."""
        self._worse = worse_at(self.scale, (spent - self.began) / max(1.0 - self.began, 1e-9))
        made, last = 0, len(self.bare.order) - 1
        while made < quota:
            proposals, change = anneal_window(
                self.bare, self.state, self.scale, self._worse, 0, last
            )
            made += proposals
            self.cost += change
            if self.cost < self.best:
                self.best, self._found = self.cost, self.bare.order.copy()
        return made

    def meet(self, incumbent: Incumbent) -> None:
        """Offer the best sequence seen; go on from the incumbent if far behind it."""
        Annealer.meet(self, incumbent)
        if incumbent.cost < self.cost - _BEHIND * self._worse:
            self._restart(incumbent)

    def _restart(self, incumbent: Incumbent) -> None:
        self.take(incumbent.order, incumbent.cost)
        self.best = incumbent.cost
