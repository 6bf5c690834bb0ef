"""Dec-MCTS: one head's planner in a team (DESIGN of the field: Best et al. 2019).

Each head grows a tree over its own plans, judged together with plans of the
others drawn from what they last told, and tells in turn a few good plans and
how likely it is to follow each. No messages here: `iterate`, `distribution`
and `take` are all an agent needs. One head alone is the single-extruder mode.

References
----------
Best, Cliff, Patten, Mettu & Fitch 2019, "Dec-MCTS: Decentralized planning for
multi-robot active perception", IJRR 38(2-3), Algs. 1-3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.search.planners import plan_order
from decmcts.search.problem import OrderProblem
from decmcts.team.distribution import PlanDistribution
from decmcts.team.exchange import exchange, exchange_jointly
from decmcts.team.plans import POLICIES, encode, encode_serial
from decmcts.team.problem import TeamProblem
from decmcts.team.resolve import resolve
from decmcts.team.tree import ROOT, Tree

__all__ = ["DecMcts", "Parameters", "PlanDistribution", "Proposal"]

REMEMBERED = 50_000  # values of joint plans kept


@dataclass(frozen=True, slots=True)
class Parameters:
    """Values of the literature and its code, but for what depends on the number of updates.

    The literature does thousands of updates; a print of thousands of contours allows a
    hundred a minute, so steps are longer here and cooling is faster.
    """

    gamma: float = 0.9  # discount of old rewards
    exploration: float = 0.7071067811865476  # C_p
    alpha: float = 0.2  # step of the distribution
    beta: float = 1.0  # temperature at first
    cooling: float = 0.95  # of the temperature, each update
    coldest: float = 0.02  # temperature at last
    plans: int = 10  # |X̂|
    updates: int = 10  # τ, distribution updates of a round
    samples: int = 20  # tree samples of an update
    renew: int = 3  # samples of each plan of X̂ before another X̂ is chosen

    @staticmethod
    def for_contours(n: int) -> Parameters:
        """Return parameters that keep a round to about a second for a print of n contours."""
        samples = int(np.clip(60_000 // max(n, 1), 4, 200))
        updates = min(10, max(2, samples // 10))
        return Parameters(updates=updates, samples=max(2, samples // updates))


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """The best joint plan a head knows."""

    plans: Mapping[int, NDArray[np.int32]]
    makespan_s: float


class DecMcts:
    """The planner of head `head`; equal seeds and equal calls give equal plans."""

    def __init__(
        self, problem: TeamProblem, head: int, *, seed: int, parameters: Parameters | None = None
    ) -> None:
        if not 0 <= head < len(problem.machine.heads):
            raise InputError(f"head {head}, the machine has {len(problem.machine.heads)}")
        self.problem, self.head = problem, head
        self.parameters = parameters or Parameters.for_contours(len(problem.macro))
        self._seed = seed
        self._rng = np.random.default_rng([seed, head])
        self._others: dict[int, PlanDistribution] = {}
        self._best: dict[tuple[int, ...], Proposal] = {}
        self._known: dict[tuple[tuple[int, ...], bytes], float] = {}
        self._beta = self.parameters.beta
        self._rounds = self._tried = 0
        self._range = (np.inf, -np.inf)
        default = encode(problem.sides_of(head), 0, problem.n_macros)
        self._tree = self._new_tree(default)
        self._own = PlanDistribution.uniform((default,))
        self._mean, self._count = np.zeros(1), np.zeros(1)

    def _new_tree(self, root: NDArray[np.int32]) -> Tree:
        return Tree(root, gamma=self.parameters.gamma, exploration=self.parameters.exploration)

    @property
    def distribution(self) -> PlanDistribution:
        """What the other heads need to know."""
        return self._own

    def take(self, head: int, distribution: PlanDistribution) -> None:
        """Use another head's latest distribution from now on."""
        if head != self.head:
            self._others[head] = distribution

    def take_joint(self, plans: Mapping[int, NDArray[np.int32]], live: Sequence[int]) -> None:
        """Judge another head's best joint plan; keep it if it is the best here too."""
        team = _team(live)
        nothing = np.empty(0, np.int32)
        self._value({r: plans.get(r, nothing) for r in team}, team)

    def forget(self, head: int) -> None:
        """Drop what is known of another head."""
        self._others.pop(head, None)

    def best(self, live: Sequence[int]) -> Proposal:
        """Return the best joint plan found so far for these live heads."""
        team = _team(live)
        if team not in self._best:
            plans = {r: self._likeliest(r) for r in team}
            self._best[team] = Proposal(plans, resolve(self.problem, plans, team).makespan_s)
        return self._best[team]

    def _likeliest(self, head: int) -> NDArray[np.int32]:
        if head == self.head:
            return self._own.likeliest()
        if head in self._others:
            return self._others[head].likeliest()
        return encode(self.problem.sides_of(head), 0, self.problem.n_macros)

    def iterate(self, live: Sequence[int]) -> None:
        """Do one outer round: grow the tree and update the distribution, τ times.

        With no other head alive: search one order for everything instead.
        """
        team = _team(live)
        self._rounds += 1
        if team == (self.head,):
            self._plan_alone(team)
            return
        for _ in range(self.parameters.updates):
            for _ in range(self.parameters.samples):
                self._sample(team)
                self._improve(team)
            self._update(team)
        if self._rounds == 1 or self._count.min() >= self.parameters.renew:
            self._choose_plans()

    def _sample(self, team: tuple[int, ...]) -> None:
        """Grow the tree by one plan judged beside plans the others may follow."""
        others = self._draw(team)
        node = self._tree.descend()
        plan = self._child_plan(node)
        while self._rng.random() < 0.3:
            plan = exchange(self.problem, plan, self._rng)
        child = self._tree.expand(node, plan)
        reward = self._scaled(self._utility(plan, others, team))
        self._tree.backup(child, reward)

    def _improve(self, team: tuple[int, ...]) -> None:
        """Try one exchange on the best joint plan known; a better one joins the tree."""
        best = self.best(team)
        plans = self._next_joint(team, best)
        value = self._value(plans, team)
        if self._best[team].makespan_s < best.makespan_s:
            child = self._tree.expand(ROOT, plans[self.head])
            rest = {r: plan for r, plan in plans.items() if r != self.head}
            baseline = self._value(rest, tuple(rest))
            self._tree.backup(child, self._scaled(value - baseline))

    def _next_joint(self, team: tuple[int, ...], best: Proposal) -> dict[int, NDArray[np.int32]]:
        """Return the joint plan to try next: each policy for all heads once, then exchanges."""
        self._tried += 1
        if self._tried < len(POLICIES):
            problem = self.problem
            return {r: encode(problem.sides_of(r), self._tried, problem.n_macros) for r in team}
        return exchange_jointly(self.problem, best.plans, self._rng)

    def _child_plan(self, node: int) -> NDArray[np.int32]:
        """Return the plan of the next child: every policy at the root, then exchanges."""
        children = len(self._tree) - 1
        if node == ROOT and children < len(POLICIES) - 1:
            return encode(self.problem.sides_of(self.head), children + 1, self.problem.n_macros)
        return exchange(self.problem, self._tree.plans[node], self._rng)

    def _draw(self, team: tuple[int, ...]) -> dict[int, NDArray[np.int32]]:
        """Draw x⁻ʳ from the latest known distributions."""
        return {
            r: self._others[r].sample(self._rng) if r in self._others else self._likeliest(r)
            for r in team
            if r != self.head
        }

    def _utility(
        self, plan: NDArray[np.int32], others: dict[int, NDArray[np.int32]], team: tuple[int, ...]
    ) -> float:
        """Return the local utility fʳ = g(xʳ, x⁻ʳ) - g(∅ʳ, x⁻ʳ)."""
        rest = tuple(r for r in team if r != self.head)
        return self._value({**others, self.head: plan}, team) - self._value(others, rest)

    def _value(self, plans: dict[int, NDArray[np.int32]], team: tuple[int, ...]) -> float:
        """Return g, 1 for an instant print and 0 for one that takes twice the serial time."""
        key = (team, b"|".join(plans[r].tobytes() for r in team))
        if key not in self._known:
            if len(self._known) >= REMEMBERED:
                self._known.clear()
            try:
                makespan = resolve(self.problem, plans, team).makespan_s
            except InputError:
                makespan = np.inf  # these heads alone can not print everything
            self._known[key] = makespan
            self._keep(plans, team, makespan)
        serial = 2.0 * float(self.problem.visits.seconds.sum())
        return max(0.0, 1.0 - self._known[key] / serial) if serial > 0.0 else 0.0

    def _keep(
        self, plans: dict[int, NDArray[np.int32]], team: tuple[int, ...], makespan: float
    ) -> None:
        best = self._best.get(team)
        if np.isfinite(makespan) and (best is None or makespan <= best.makespan_s):
            self._best[team] = Proposal(dict(plans), makespan)

    def _scaled(self, utility: float) -> float:
        """Return the utility as a reward in [0, 1], relative to all seen so far."""
        low, high = min(self._range[0], utility), max(self._range[1], utility)
        self._range = (low, high)
        return (utility - low) / (high - low) if high > low else 0.5

    def _choose_plans(self) -> None:
        """Re-choose X̂: the best plans of the tree; q is reset when they change."""
        chosen = self._tree.best_plans(self.parameters.plans)
        if _same(chosen, self._own.sequences):
            return
        self._own = PlanDistribution.uniform(chosen)
        self._mean, self._count = np.zeros(len(chosen)), np.zeros(len(chosen))

    def _update(self, team: tuple[int, ...]) -> None:
        """Sample E[f|x] of one candidate and move q one step (Alg. 3)."""
        x = int(np.argmin(self._count))
        reward = self._scaled(self._utility(self._own.sequences[x], self._draw(team), team))
        self._count[x] += 1
        self._mean[x] += (reward - self._mean[x]) / min(self._count[x], 10.0)
        if self._count.min() > 0:
            parameters = self.parameters
            self._own = self._own.updated(self._mean, beta=self._beta, alpha=parameters.alpha)
            self._beta = max(self._beta * parameters.cooling, parameters.coldest)

    def _plan_alone(self, team: tuple[int, ...]) -> None:
        """Search one order for everything; the effort doubles with the rounds."""
        problem = self.problem
        effort = 100_000 * 2 ** min(self._rounds, 8)
        result = plan_order(
            OrderProblem.from_job(problem.job, problem.graph, "reversible"),
            planner="local",
            time_limit_s=1e9,
            max_iterations=effort,
            seed=self._seed + self._rounds,
        )
        plan = encode_serial(result.toolpath, problem.n_macros)
        self._value({self.head: plan}, team)
        self._own = PlanDistribution.uniform((self.best(team).plans[self.head],))
        self._mean, self._count = np.zeros(1), np.zeros(1)


def _team(live: Sequence[int]) -> tuple[int, ...]:
    return tuple(sorted({int(r) for r in live}))


def _same(a: Sequence[NDArray[np.int32]], b: Sequence[NDArray[np.int32]]) -> bool:
    return len(a) == len(b) and all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
