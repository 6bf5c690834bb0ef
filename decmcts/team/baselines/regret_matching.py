"""Regret matching over sampled plans, in the place of Dec-MCTS' step of q.

Every head has candidate plans, drawn as Dec-MCTS draws them: each policy once, then
exchanges. In each step all heads draw a plan by their regrets, which gives a joint plan.
One head, each in turn, compares its plan with another candidate of its own, and adds the
difference in makespan to that candidate's regret. After RENEWED comparisons of a head the
candidate regretted least is replaced by its plan in the best joint plan, changed by one move.

References
----------
Hart & Mas-Colell 2000, "A simple adaptive procedure leading to correlated
equilibrium", Econometrica 68(5), 1127-1150.
A-MCTS (arXiv 2407.08254) uses it among robots with trees of their own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.team.baselines.incumbent import Budget, Found, Incumbent
from decmcts.team.dec_mcts.exchange import exchange
from decmcts.team.engine.plans import POLICIES, encode
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve

CANDIDATES = 10  # plans of a head
RENEWED = 10  # comparisons of a head between two new candidates

Plan = NDArray[np.int32]


class Chooser:
    """One head's candidates and how much it regrets not having taken each."""

    def __init__(self, problem: TeamProblem, head: int, rng: np.random.Generator) -> None:
        self._problem, self._head, self._rng = problem, head, rng
        rows = rng.permutation(len(POLICIES))[:CANDIDATES]
        self.plans = [encode(int(k), problem.n_macros) for k in rows]
        self.regret = np.zeros(len(self.plans))
        self.compared = 0

    def draw(self) -> int:
        """Draw a candidate in proportion to what it is regretted, any if none is."""
        hope = np.maximum(self.regret, 0.0)
        total = float(hope.sum())
        k = len(hope)
        return int(self._rng.choice(k, p=hope / total if total > 0.0 else np.full(k, 1.0 / k)))

    def compare(self, candidate: int, gain: float) -> None:
        """Note what `candidate` would have gained over the plan that was drawn."""
        self.regret[candidate] += gain
        self.compared += 1

    def renew(self, best: Plan) -> None:
        """Put an exchange of `best` in the place of the candidate regretted least."""
        worst = int(np.argmin(self.regret))
        self.plans[worst] = exchange(self._problem, self._head, best, self._rng)
        self.regret[worst] = max(0.0, float(self.regret.mean()))


class Judge:
    """Makespans of joint plans, each resolved once."""

    def __init__(self, problem: TeamProblem, best: Incumbent) -> None:
        self._problem, self._best = problem, best
        self._known: dict[bytes, float] = {}
        self.plans: list[Plan] = []  # the best joint plan

    def makespan(self, plans: list[Plan]) -> float:
        """Return the makespan of a joint plan."""
        key = b"|".join(plan.tobytes() for plan in plans)
        if key not in self._known:
            resolved = resolve(self._problem, dict(enumerate(plans)), range(len(plans)))
            if resolved.makespan_s < self._best.makespan_s:
                self.plans = list(plans)
            self._best.offer_toolpaths(resolved.toolpaths, resolved.makespan_s)
            self._known[key] = resolved.makespan_s
        return self._known[key]


def plan(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return the best joint plan that was drawn or compared."""
    rng, heads = np.random.default_rng(seed), len(problem.machine.heads)
    best = Incumbent(budget, heads)
    judge = Judge(problem, best)
    choosers = [Chooser(problem, r, rng) for r in range(heads)]
    r = 0
    while not best.ended:
        drawn = [chooser.draw() for chooser in choosers]
        joint = [chooser.plans[k] for chooser, k in zip(choosers, drawn, strict=True)]
        makespan = judge.makespan(joint)
        mine = choosers[r]
        other = int(rng.integers(len(mine.plans)))
        joint[r] = mine.plans[other]
        mine.compare(other, (makespan - judge.makespan(joint)) / max(makespan, 1e-12))
        if mine.compared % RENEWED == 0:
            mine.renew(judge.plans[r])
        r = (r + 1) % heads
    return best.found
