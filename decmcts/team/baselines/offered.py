"""The best joint order of a planner of one's own: it offers some, and those that hold are kept."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.arguments import checked
from decmcts.errors import InputError
from decmcts.team.baselines.incumbent import Budget, Incumbent
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import as_stated


class TeamIncumbent(Incumbent):
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
        super().__init__(budget, len(problem.machine.heads))
        self.problem = problem

    @property
    def over(self) -> bool:
        """Whether the search has ended."""
        return self._budget.stopping.ends(self.seconds, self.orders)

    @checked
    def offer_order(
        self,
        order: NDArray[np.int32],
        head: NDArray[np.int32],
        reversed: NDArray[np.int32] | None = None,  # noqa: A002 - the project's word
    ) -> float:
        """Keep a joint order if it is the best, and return its makespan by the engine, s.

        Parameters
        ----------
        order : NDArray[np.int32]
            (n,) contours; where two heads are in each other's way, the first in this order goes
            first.
        head : NDArray[np.int32]
            (n,) which head prints each of them.
        reversed : NDArray[np.int32] | None
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
        n, heads = len(self.problem.job.contours), self._heads
        order, head = np.asarray(order), np.asarray(head)
        turned = np.zeros(n, np.bool_) if reversed is None else np.asarray(reversed) > 0
        if not np.array_equal(np.sort(order, axis=None), np.arange(n)):
            raise InputError(f"order has not each of {n} contours once")
        for name, given in (("head", head), ("reversed", turned)):
            if given.shape != (n,):
                raise InputError(f"{name} has shape {given.shape}, expected ({n},)")
        if not np.isin(head, np.arange(heads)).all():
            raise InputError(f"head names one outside 0..{heads - 1}")
        stated = StatedOrder(order.astype(np.int32), turned, head.astype(np.int64))
        found = as_stated(self.problem, stated, range(heads))
        makespan_s = np.inf if found is None else found.makespan_s
        self.offer_toolpaths(() if found is None else found.toolpaths, makespan_s)
        return float(makespan_s)
