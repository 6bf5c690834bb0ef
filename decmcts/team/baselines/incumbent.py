"""The best joint order a baseline has found, and how long it may go on looking.

Seconds of every baseline are processor time, so they compare at equal cost whatever
else the computer does. All are judged by the same engine.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from decmcts._kernels.engine.joint import Units
from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.engine.plans import StatedOrder

Clock = Callable[[], float]
PROCESSOR: Clock = time.process_time


@dataclass(frozen=True, slots=True)
class Budget:
    """What a baseline may spend."""

    stopping: Stopping  # iterations are joint orders tried, of which there is always one
    clock: Clock = PROCESSOR


@dataclass(frozen=True, slots=True)
class Found:
    """What a baseline found; `decmcts.team.schedule.joint_plan` makes the exact plan of it."""

    toolpaths: tuple[Toolpath, ...]  # one per head of the machine
    makespan_s: float  # estimate of the engine, as of `decmcts.team.engine.resolve`
    orders: int  # joint orders tried
    history: tuple[tuple[float, float], ...]  # seconds and makespan whenever it got better


class Incumbent:
    """The best joint order so far."""

    def __init__(self, budget: Budget, heads: int) -> None:
        self._budget, self._heads = budget, heads
        self._started = budget.clock()
        self._toolpaths: tuple[Toolpath, ...] = ()
        self._history: list[tuple[float, float]] = []
        self.makespan_s = np.inf
        self.orders = 0

    @property
    def seconds(self) -> float:
        """Seconds spent so far."""
        return self._budget.clock() - self._started

    @property
    def share(self) -> float:
        """Share of the budget that is spent, 0..1."""
        return min(1.0, self._budget.stopping.spent(self.seconds, self.orders))

    @property
    def ended(self) -> bool:
        """Whether the budget is spent."""
        return self.orders > 0 and self._budget.stopping.ends(self.seconds, self.orders)

    def offer(self, units: Units) -> float:
        """Keep the order that units were put in if it is the best; returns its makespan."""
        makespan = float(units.end[: int(units.used[0])].max(initial=0.0))
        better = self._counted(makespan)
        if better:
            self._toolpaths = tuple(stated_of(units).toolpaths(self._heads))
        return makespan

    def offer_toolpaths(self, toolpaths: Sequence[Toolpath], makespan_s: float) -> None:
        """Keep a joint order judged elsewhere if it is the best."""
        if self._counted(makespan_s):
            self._toolpaths = tuple(toolpaths)

    def _counted(self, makespan_s: float) -> bool:
        self.orders += 1
        better = makespan_s < self.makespan_s
        if better:
            self.makespan_s = makespan_s
            self._history.append((self.seconds, makespan_s))
        return better

    @property
    def found(self) -> Found:
        """The best so far; something was offered."""
        return Found(self._toolpaths, self.makespan_s, self.orders, tuple(self._history))


def stated_of(units: Units) -> StatedOrder:
    """Return the joint order in which units were put."""
    used = int(units.used[0])
    row = np.flatnonzero(units.contour[:used] >= 0)
    head = units.head[row].astype(np.int64)
    return StatedOrder(units.contour[row].astype(np.int32), units.reversed[row], head)
