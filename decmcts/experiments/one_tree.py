"""One central Monte Carlo tree over joint plans, and the windows of the heads' search."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.exchange import exchange_jointly
from decmcts.team.dec_mcts.planner import DecMcts
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve


class OneTree(DecMcts):
    """One Monte Carlo tree over joint plans in place of a tree and a distribution a head."""

    def _sample(self, team: tuple[int, ...]) -> None:
        """Grow the tree by one joint plan."""
        if self._joint is None:
            self._joint = [self._values.starts[team].plans]
            self._tree = self._new_tree(np.zeros(1, np.int32))
        node = self._tree.descend()
        plans = exchange_jointly(self.problem, self._joint[node], self._rng)
        while self._rng.random() < 0.3:
            plans = exchange_jointly(self.problem, plans, self._rng)
        self._joint.append(plans)
        child = self._tree.expand(node, np.array([len(self._joint)], np.int32))
        makespan = self._values.makespan(plans, team)
        self._utilities.append(-makespan)
        low, high = float(np.median(self._utilities)), max(self._utilities)
        reward = max(0.0, -makespan - low) / (high - low) if high > low else 0.5
        self._tree.backup(child, reward)

    _joint: list[Any] | None = None

    def _combine(self, team: tuple[int, ...]) -> None:
        """Leave all to the tree."""

    def _update(self, team: tuple[int, ...]) -> None:
        """Have no distribution."""


def plan(problem: TeamProblem, stopping: Stopping, *, seed: int) -> tuple[Toolpath, ...]:
    """Return what one host finds that knows all and plans for all; iterations are rounds."""
    live = range(len(problem.machine.heads))
    began, rounds = time.process_time(), 0
    tree = OneTree(problem, 0, seed=seed)
    while not rounds or not stopping.ends(time.process_time() - began, rounds):
        tree.iterate(live, stopping.spent(time.process_time() - began, rounds))
        rounds += 1
    return resolve(problem, tree.best(live).plans, live).toolpaths
