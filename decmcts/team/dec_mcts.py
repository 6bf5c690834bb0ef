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
from hashlib import blake2b
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.search.planners import plan_order
from decmcts.search.problem import OrderProblem
from decmcts.team.distribution import PlanDistribution
from decmcts.team.exchange import exchange, exchange_jointly
from decmcts.team.parameters import Parameters
from decmcts.team.plans import (
    MOST_STATED,
    StatedOrder,
    decode,
    encode,
    encode_serial,
    encode_stated,
)
from decmcts.team.polish import Polish
from decmcts.team.problem import TeamProblem
from decmcts.team.resolve import resolve
from decmcts.team.tree import ROOT, Tree

__all__ = ["DecMcts", "Parameters", "PlanDistribution", "Proposal"]

REMEMBERED = 50_000  # values of joint plans kept
AT_ONCE = 200_000  # contours put when policies are tried, about a second's work
ROOT_POLICIES = 8  # with which the tree begins
BETTER = 0.997  # share of its start's makespan that a better start must have
NOTHING = np.empty(0, np.int32)  # the plan of a head that leaves all to the others


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """The best joint plan a head knows."""

    plans: Mapping[int, NDArray[np.int32]]
    makespan_s: float


class _Line(NamedTuple):
    """A joint order being polished."""

    team: tuple[int, ...]
    polish: Polish
    began_s: float  # makespan of the plans it began with


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
        self._rounds = 0
        self._last_s = np.inf  # makespan of the joint plan valued last
        self._policies: dict[tuple[int, ...], dict[int, float]] = {}  # makespans of those tried
        self._start: dict[tuple[int, ...], Proposal] = {}  # best joint plan of macro-actions
        self._line: _Line | None = None
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
        told = {r: plans.get(r, NOTHING) for r in team}
        self._value(told, team)
        stated = self._stated(told)
        if stated is not None and self._line is not None and self._line.team == team:
            self._line.polish.take(stated)
            self._keep_polished(self._line)

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
        self.best(team)  # raises where these heads can not print everything
        if not self._try_policies(team):
            return
        for _ in range(self.parameters.updates):
            for _ in range(self.parameters.samples):
                self._sample(team)
                self._improve(team)
            self._update(team)
        if self.parameters.windows and len(self.problem.macro) <= MOST_STATED:
            self._refine(team)
        if self._rounds == 1 or self._count.min() >= self.parameters.renew:
            self._choose_plans()

    def _try_policies(self, team: tuple[int, ...]) -> bool:
        """Try some policies for all heads at once; True when this head's share is done."""
        count = self.parameters.policies
        mine = range(team.index(self.head) % count, count, len(team))
        values = self._policies.setdefault(team, {})
        most = max(8, AT_ONCE // max(1, len(self.problem.macro)))
        for k in [k for k in mine if k not in values][:most]:
            self._value({r: self._by_policy(r, k) for r in team}, team)
            values[k] = self._last_s
        return len(values) == len(mine)

    def _by_policy(self, head: int, policy: int) -> NDArray[np.int32]:
        return encode(self.problem.sides_of(head), policy, self.problem.n_macros)

    def _sample(self, team: tuple[int, ...]) -> None:
        """Grow the tree by one plan judged beside plans the others may follow."""
        others = self._draw(team)
        node = self._tree.descend()
        plan = self._child_plan(node, team)
        while self._rng.random() < 0.3:
            plan = self._exchange(plan)
        child = self._tree.expand(node, plan)
        reward = self._scaled(self._utility(plan, others, team))
        self._tree.backup(child, reward)

    def _improve(self, team: tuple[int, ...]) -> None:
        """Try one exchange on the best plans of macro-actions; a better one joins the tree."""
        best = self._start[team]
        plans = exchange_jointly(
            self.problem, best.plans, self._rng, policies=self.parameters.policies
        )
        value = self._value(plans, team)
        if self._start[team].makespan_s < best.makespan_s:
            child = self._tree.expand(ROOT, plans[self.head])
            rest = {r: plan for r, plan in plans.items() if r != self.head}
            baseline = self._value(rest, tuple(rest))
            self._tree.backup(child, self._scaled(value - baseline))

    def _child_plan(self, node: int, team: tuple[int, ...]) -> NDArray[np.int32]:
        """Return the plan of the next child: the best policies at the root, then exchanges."""
        children, values = len(self._tree) - 1, self._policies[team]
        if node == ROOT and children < min(ROOT_POLICIES, len(values)):
            return self._by_policy(self.head, sorted(values, key=values.__getitem__)[children])
        return self._exchange(self._tree.plans[node])

    def _exchange(self, plan: NDArray[np.int32]) -> NDArray[np.int32]:
        return exchange(self.problem, plan, self._rng, policies=self.parameters.policies)

    def _refine(self, team: tuple[int, ...]) -> None:
        """Polish the best joint order; begin anew from a better start."""
        start, line = self._start[team], self._line
        if line is None or line.team != team or start.makespan_s < BETTER * line.began_s:
            stated = StatedOrder.of(resolve(self.problem, start.plans, team).toolpaths)
            seed = self._seed * len(self.problem.machine.heads) + self.head
            line = _Line(team, Polish(self.problem, stated, seed=seed), start.makespan_s)
            self._line = line
        line.polish.improve(self.parameters.windows)
        self._keep_polished(line)

    def _keep_polished(self, line: _Line) -> None:
        """Judge what was polished, as a plan of this head that states what all do."""
        best = self._best.get(line.team)
        if best is None or line.polish.best_s < best.makespan_s:
            heads, n_macros = len(self.problem.machine.heads), self.problem.n_macros
            plan = encode_stated(line.polish.best, heads, n_macros)
            self._value({r: plan if r == self.head else NOTHING for r in line.team}, line.team)

    def _stated(self, plans: Mapping[int, NDArray[np.int32]]) -> StatedOrder | None:
        """Return the order that some plan states."""
        n_macros, n = self.problem.n_macros, len(self.problem.macro)
        found = (decode(plan, n_macros, n).stated for plan in plans.values())
        return next((stated for stated in found if stated is not None), None)

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
        key = (team, blake2b(b"|".join(plans[r].tobytes() for r in team)).digest())
        if key not in self._known:
            if len(self._known) >= REMEMBERED:
                self._known.clear()
            try:
                makespan = resolve(self.problem, plans, team).makespan_s
            except InputError:
                makespan = np.inf  # these heads alone can not print everything
            self._known[key] = makespan
            self._keep(plans, team, makespan)
        self._last_s = self._known[key]
        serial = 2.0 * float(self.problem.visits.seconds.sum())
        return max(0.0, 1.0 - self._known[key] / serial) if serial > 0.0 else 0.0

    def _keep(
        self, plans: dict[int, NDArray[np.int32]], team: tuple[int, ...], makespan: float
    ) -> None:
        best = self._best.get(team)
        if not np.isfinite(makespan):
            return
        if best is None or makespan <= best.makespan_s:
            self._best[team] = Proposal(dict(plans), makespan)
        start = self._start.get(team)
        better = start is None or makespan <= start.makespan_s
        if better and self._stated(plans) is None:
            self._start[team] = Proposal(dict(plans), makespan)

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
