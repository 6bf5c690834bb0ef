"""The best joint order a planner has found, and how long it may go on looking.

For planners other than Dec-MCTS. All joint orders are judged by the same engine.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.arguments import checked
from decmcts.arrays import Int32s
from decmcts.errors import InputError
from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.incumbent import whole_order
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import as_stated

Clock = Callable[[], float]


@dataclass(frozen=True, slots=True)
class Budget:
    """What a planner may spend."""

    stopping: Stopping  # iterations are joint orders tried, of which there is always one
    clock: Clock = time.process_time


@dataclass(frozen=True, slots=True)
class Found:
    """What a planner found; `decmcts.team.schedule.joint_plan` makes the exact plan of it."""

    toolpaths: tuple[Toolpath, ...]  # one per head of the machine
    makespan_s: float  # estimate of the engine, as of `decmcts.team.engine.resolve`
    orders: int  # joint orders tried
    history: tuple[tuple[float, float], ...]  # seconds and makespan whenever it got better


class TeamIncumbent:
    """The best joint order so far, of a print for several heads.

    Parameters
    ----------
    problem : TeamProblem
        The print, the machine, what must come before what, and who may print what
        (`problem.space.eligible`, (n, heads)).
    budget : Budget
        How long to search.
    """

    def __init__(self, problem: TeamProblem, budget: Budget) -> None:
        self.problem = problem
        self._budget, self._started = budget, budget.clock()
        self._toolpaths: tuple[Toolpath, ...] = ()
        self._history: list[tuple[float, float]] = []
        self.makespan_s = np.inf
        self.orders = 0

    @property
    def seconds(self) -> float:
        """Seconds spent so far."""
        return self._budget.clock() - self._started

    @property
    def over(self) -> bool:
        """Whether the search has ended."""
        return self._budget.stopping.ends(self.seconds, self.orders)

    @property
    def found(self) -> Found:
        """The best so far; something was offered."""
        return Found(self._toolpaths, self.makespan_s, self.orders, tuple(self._history))

    def offer_toolpaths(self, toolpaths: Sequence[Toolpath], makespan_s: float) -> None:
        """Keep a joint order judged elsewhere if it is the best."""
        self.orders += 1
        if makespan_s < self.makespan_s:
            self.makespan_s, self._toolpaths = makespan_s, tuple(toolpaths)
            self._history.append((self.seconds, makespan_s))

    @checked
    def offer_order(
        self,
        order: Int32s,
        head: Int32s,
        reversed: Int32s | None = None,  # noqa: A002 - the project's word
    ) -> float:
        """Keep a joint order if it is the best, and return its makespan by the engine, s.

        Parameters
        ----------
        order : Int32s
            (n,) contours; where two heads want the same space, the first in this order goes
            first.
        head : Int32s
            (n,) which head prints each of them.
        reversed : Int32s | None
            (n,) 1 for those printed from their last point; None: none is.

        Returns
        -------
        float
            Infinite where the order breaks precedence, a head may not print what it shall, or
            heads block each other.

        Raises
        ------
        InputError
            If `order` has not each contour once, or shapes or heads are wrong.
        """
        n, heads = len(self.problem.job.contours), len(self.problem.machine.heads)
        order, head = whole_order(order, n), np.asarray(head)
        turned = np.zeros(n, np.bool_) if reversed is None else np.asarray(reversed) > 0
        for name, given in (("head", head), ("reversed", turned)):
            if given.shape != (n,):
                raise InputError(f"{name} has shape {given.shape}, expected ({n},)")
        if not np.isin(head, np.arange(heads)).all():
            raise InputError(f"head names one outside 0..{heads - 1}")
        stated = StatedOrder(order, turned, head.astype(np.int64))
        found = as_stated(self.problem, stated, range(heads))
        makespan_s = np.inf if found is None else found.makespan_s
        self.offer_toolpaths(() if found is None else found.toolpaths, makespan_s)
        return float(makespan_s)
