"""One central Monte Carlo tree over joint plans, and the windows of the heads' search."""

from __future__ import annotations

from typing import Any

import numpy as np

from decmcts.team.dec_mcts.exchange import exchange_jointly
from decmcts.team.dec_mcts.planner import DecMcts
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve
from decmcts.team.incumbent import Budget, Found, JointIncumbent


class OneTree(DecMcts):
    """One Monte Carlo tree over joint plans in place of a tree and a distribution a head."""

    def _sample(self, team: tuple[int, ...]) -> None:
        """Grow the tree by one joint plan."""
        if self._joint is None:
            self._joint = [self._values.starts[team].plans]
            self._tree = self._new_tree(np.zeros(1, np.int32))
        node = self._tree.descend()
        plans = exchange_jointly(self.problem, self._joint[int(node.plan[0])], self._rng)
        while self._rng.random() < 0.3:
            plans = exchange_jointly(self.problem, plans, self._rng)
        child = self._tree.expand(node, np.array([len(self._joint)], np.int32))
        self._joint.append(plans)
        makespan = self._values.makespan(plans, team)
        self._utilities.append(-makespan)
        low, high = float(np.median(self._utilities)), max(self._utilities)
        reward = max(0.0, -makespan - low) / (high - low) if high > low else 0.5
        self._tree.backup(child, reward)

    _joint: list[Any] | None = None  # of each node; its plan is the place here

    def _combine(self, team: tuple[int, ...]) -> None:
        """Leave all to the tree."""

    def _update(self, team: tuple[int, ...]) -> None:
        """Have no distribution."""


def plan(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return what one host finds that knows all and plans for all; iterations are rounds."""
    live = range(len(problem.machine.heads))
    best, rounds = JointIncumbent(budget, len(live)), 0
    tree = OneTree(problem, 0, seed=seed)
    while not rounds or not budget.stopping.ends(best.seconds, rounds):
        tree.iterate(live, budget.stopping.spent(best.seconds, rounds))
        rounds += 1
    found = resolve(problem, tree.best(live).plans, live)
    best.offer_toolpaths(found.toolpaths, found.makespan_s)
    return best.found
