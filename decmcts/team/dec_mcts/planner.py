"""Dec-MCTS: one head's planner in a team (Best et al. 2019).

Each head grows a tree over its own plans. A plan is judged together with plans of
the other heads, drawn from the distributions these last sent. In turn the head sends a
few good plans of its own and how likely it is to follow each. No messages here: `iterate`,
`distribution` and `take` are all an agent needs. One head alone is the
single-extruder mode.

Policies are tried first. Then each round has a share of work for tree and
distribution, and the rest for windows of the best joint order. Work is counted in
contours that are placed in joint orders (`decmcts.team.engine.values`).

References
----------
Best, Cliff, Patten, Mettu & Fitch 2019, "Dec-MCTS: Decentralized planning for
multi-robot active perception", IJRR 38(2-3), Algs. 1-3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from decmcts.errors import InputError
from decmcts.print.machine_fit import require_printable
from decmcts.search.planners import plan_order
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.distribution import Candidates, PlanDistribution
from decmcts.team.dec_mcts.exchange import exchange, exchange_jointly, rearranges
from decmcts.team.dec_mcts.parameters import SMALL_SHARE, Parameters
from decmcts.team.dec_mcts.policy_trials import PolicyTrials
from decmcts.team.dec_mcts.polish import FEW, Polish
from decmcts.team.dec_mcts.tree import Node, Tree
from decmcts.team.engine.plans import (
    MOST_STATED,
    Changes,
    StatedOrder,
    encode,
    encode_changes,
    encode_serial,
    encode_stated,
)
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import fleet_for, is_allowed, resolve
from decmcts.team.engine.values import EACH, BestJointPlan, JointValues, Plan, TeamHeads

__all__ = ["BestJointPlan", "DecMcts", "Parameters", "PlanDistribution"]

AT_ONCE = 200_000  # contours placed when policies are tried, about a second's work
# Where so many policies all end this much later than the order to begin with no more are tried.
ENOUGH, FAR = 4, 1.05
UNPOLISHED = 100_000  # contours placed in a round without polishing
WINDOW = 3_000  # contours placed that a window of polishing counts for
ROOT_POLICIES = 8  # with which the tree begins
# Polishing begins anew from a better start if that is better by this share of what polishing
# has gained. In as long again the order polished now would gain about this share more; the new
# one would first gain as much as this one has.
ANEW = 0.4
BEHIND = 0.998  # a head goes on with an order that is shorter than this share of its own
NOTHING = np.empty(0, np.int32)  # the plan of a head that leaves all to the others


class _Polishing(NamedTuple):
    """A joint order being polished."""

    team: TeamHeads
    polish: Polish
    start_s: float  # makespan of the best plans of macro-actions when it began
    gained_s: float = 0.0  # by which the order it began with was shorter than those

    def outdone_by(self, start: BestJointPlan) -> bool:
        """Whether to polish this start instead."""
        gained = self.gained_s + self.polish.began_s - self.polish.best_s
        return start.makespan_s < self.start_s - max(ANEW * gained, 1e-3 * self.start_s)


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
        self._values = JointValues(problem)
        self._trials: dict[TeamHeads, PolicyTrials] = {}
        self._polishing: _Polishing | None = None
        self._polishings = self._alone = 0  # joint orders polished, rounds without another head
        self._refined = 0  # rounds in which windows were improved
        self._steps = self._tried = 0  # of tree and distribution; joint plans tried
        self._credit = 0  # contours that tree and distribution may place
        self._utilities: list[float] = []  # of all samples
        default = self._by_policy(0)
        self._tree = self._new_tree(default)
        self._own = Candidates((default,), self.parameters)

    def _new_tree(self, root: Plan) -> Tree:
        p = self.parameters
        return Tree(root, gamma=p.gamma, exploration=p.exploration)

    @property
    def distribution(self) -> PlanDistribution:
        """What the other heads need to know."""
        return self._own.distribution

    def take(self, head: int, distribution: PlanDistribution) -> None:
        """Use another head's latest distribution from now on."""
        if head != self.head:
            self._others[head] = distribution

    def take_joint(self, plans: Mapping[int, Plan], live: Sequence[int]) -> None:
        """Judge another head's best joint plan; keep it if it is the best here too."""
        team = _team(live)
        received = {r: plans.get(r, NOTHING) for r in team}
        self._values.makespan(received, team)
        stated = self._values.stated(received)
        if stated is None or not is_allowed(self.problem, stated, fleet_for(self.problem, team)[1]):
            return
        if self._polishing is not None and self._polishing.team == team:
            self._polishing.polish.take(stated)
            self._keep_polished(self._polishing)
            self._follow(stated, self._values.makespan(received, team), team)

    def knows_less_than(self, proposal: BestJointPlan, live: Sequence[int]) -> bool:
        """Whether another head's joint plan claims to be better than all known here."""
        known = self._values.best.get(_team(live))
        return known is not None and proposal.makespan_s < known.makespan_s

    def forget(self, head: int) -> None:
        """Drop what is known of another head."""
        self._others.pop(head, None)

    def best(self, live: Sequence[int]) -> BestJointPlan:
        """Return the best joint plan found so far for these live heads."""
        team = _team(live)
        if team not in self._values.best:
            plans = {r: self._likeliest(r) for r in team}
            found = BestJointPlan(plans, resolve(self.problem, plans, team).makespan_s)
            self._values.best[team] = found
        return self._values.best[team]

    def _likeliest(self, head: int) -> Plan:
        if head == self.head:
            return self._own.distribution.likeliest()
        if head in self._others:
            return self._others[head].likeliest()
        return self._by_policy(0)

    def _by_policy(self, policy: int) -> Plan:
        return encode(policy, self.problem.n_macros)

    def iterate(self, live: Sequence[int], spent: float = 1.0) -> None:
        """Do one outer round: grow the tree and update the distribution, then improve windows.

        `spent` is the share of the time for planning that is over, 0..1; windows of the best
        joint order are improved from `Parameters.first` on: recreated till
        `Parameters.recreate`, then polished. Where the order to begin with ends sooner than all
        policies there is little for a tree: windows are improved from the first round on,
        recreated and polished in turn. With no other head alive: search one order for everything
        instead.
        """
        team = _team(live)
        if team == (self.head,):
            self._plan_alone(team)
            return
        if self._try_policies(team):
            return  # heads send each other the best policy before they polish
        p, few = self.parameters, len(self.problem.macro) <= FEW
        ahead = self._begins_ahead(team)
        polished = p.windows > 0 and p.share < 1.0 and len(self.problem.macro) <= MOST_STATED
        if not polished or (p.share and spent < p.first and not few and not ahead):
            self._search(team, UNPOLISHED if p.share else 0)
            return
        self._search(team, self._work(min(p.share, SMALL_SHARE) if ahead else p.share))
        self._refined += 1
        self._refine(team, recreate=self._refined % 2 == 1 if ahead else spent < p.recreate)

    def _try_policies(self, team: TeamHeads) -> bool:
        """Try some policies for all heads at once; False when this head has tried all its own."""
        if team not in self._trials:
            eligible = fleet_for(self.problem, team)[1]
            require_printable(self.problem.job.contours, self.problem.machine, eligible, live=team)
            turn = team.index(self.head)
            self._trials[team] = PolicyTrials(turn, len(team), tries=self.parameters.tries)
            self._start_s(team)  # the first that is tried
        trials = self._trials[team]
        if trials.next() is None:
            return False
        # the first round is short: by the longest so far peers judge how long we may be silent
        work = AT_ONCE if trials.makespans else AT_ONCE // 8
        for _ in range(max(1, work // max(1, len(self.problem.macro)))):
            policy = trials.next()
            if policy is None:
                break
            plans = dict.fromkeys(team, self._by_policy(policy))
            trials.note(policy, self._values.makespan(plans, team))
        if len(trials.makespans) >= ENOUGH and self._start_s(team) * FAR < self._policies_s(team):
            trials.stop()
        if trials.next() is None and self.parameters.share:
            self._begin_tree(team)
        return True

    def _begin_tree(self, team: TeamHeads) -> None:
        """Have a tree and X̂ of the best that was tried: an order to begin with, or policies."""
        trials = self._trials[team]
        best = [self._by_policy(k) for k in trials.best(self.parameters.plans)]
        if self._begins_ahead(team):
            best = [self._as_begun()]
        if rearranges(self.problem, best[0]) != rearranges(self.problem, self._tree.root.plan):
            self._tree = self._new_tree(best[0])
        self._own.renew(self._with_start(best, team))

    def _policies_s(self, team: TeamHeads) -> float:
        """Return the makespan of the best policy tried."""
        return min(self._trials[team].makespans.values())

    def _as_begun(self) -> Plan:
        """Return the plan to do as in the order that heads begin with."""
        return encode_changes(Changes(*np.zeros((3, 0), np.int64)), self.problem.n_macros)

    def _start_s(self, team: TeamHeads) -> float:
        """Return the makespan of the order to begin with; infinite if these heads have none."""
        eligible = fleet_for(self.problem, team)[1]
        start = self.problem.start
        if start is None or not is_allowed(self.problem, start.stated, eligible):
            return np.inf
        return self._values.makespan(dict.fromkeys(team, self._as_begun()), team)

    def _search(self, team: TeamHeads, work: int) -> None:
        """Grow the tree and move q by steps that place so many contours; what is left is kept."""
        self._credit += work
        order = len(self.problem.macro) + EACH
        least = order // 4  # what a step costs that resolves nothing
        while self._credit >= order:
            before = self._values.placed
            if self._steps % (self.parameters.samples + 1) < self.parameters.samples:
                self._sample(team)
                self._combine(team)
            else:
                self._update(team)
            self._steps += 1
            self._credit -= max(least, self._values.placed - before)

    def _begins_ahead(self, team: TeamHeads) -> bool:
        """Whether no policy tried ends sooner than the order to begin with."""
        return self._start_s(team) <= self._policies_s(team)

    def _work(self, share: float) -> int:
        """Return the contours that tree and distribution may place in a round with polishing."""
        return int(share / (1.0 - share) * self.parameters.windows * WINDOW)

    def _sample(self, team: TeamHeads) -> None:
        """Grow the tree by one plan judged beside plans the others may follow."""
        others = self._draw(team)
        node = self._tree.descend()
        plan = self._child_plan(node, team)
        while self._rng.random() < 0.3:
            plan = exchange(self.problem, self.head, plan, self._rng)
        child = self._tree.expand(node, plan)
        self._tree.backup(child, self._reward({**others, self.head: plan}, team))

    def _combine(self, team: TeamHeads) -> None:
        """Try one joint plan; where it is the best of macro-actions it is added to the tree.

        In turn one plan of each head's X̂ together, and one exchange on the best joint plan;
        the exchange also where those plans were tried together before.
        """
        best = self._values.starts[team]
        self._tried += 1
        plans = self._combination(team) if self._tried % 2 else None
        if plans is None or self._values.knows(plans, team):
            plans = exchange_jointly(self.problem, best.plans, self._rng)
        self._values.makespan(plans, team)
        if self._values.starts[team].makespan_s < best.makespan_s:
            child = self._tree.expand(self._tree.root, plans[self.head])
            self._tree.backup(child, self._reward(plans, team))

    def _combination(self, team: TeamHeads) -> dict[int, Plan]:
        """Draw one plan of each head's X̂."""
        return {**self._draw(team), self.head: self._own.distribution.sample(self._rng)}

    def _child_plan(self, node: Node, team: TeamHeads) -> Plan:
        """Return the plan of the next child: the best policies at the root, then exchanges."""
        children = len(node.children)
        best = self._trials[team].best(ROOT_POLICIES)
        begun = rearranges(self.problem, node.plan)
        if node is self._tree.root and children < len(best) and not begun:
            return self._by_policy(best[children])
        return exchange(self.problem, self.head, node.plan, self._rng)

    def _reward(self, plans: Mapping[int, Plan], team: TeamHeads) -> float:
        """Return the utility from 0, the median of all seen or worse, to 1, the best."""
        utility = self._values.utility(self.head, plans, team)
        self._utilities.append(utility)
        low, high = float(np.median(self._utilities)), max(self._utilities)
        return max(0.0, utility - low) / (high - low) if high > low else 0.5

    def _update(self, team: TeamHeads) -> None:
        """Sample E[f|x] of each of X̂ beside the same plans of the others, and move q (Alg. 3).

        When each was sampled often enough X̂ is chosen anew from the tree.
        """
        if self._own.sampled.min() >= self.parameters.renew:
            chosen = self._tree.best_plans(self.parameters.plans)
            self._own.renew(self._with_start(chosen, team))
        others = self._draw(team)
        joint = [{**others, self.head: plan} for plan in self._own.distribution.sequences]
        utilities = [self._values.utility(self.head, plans, team) for plans in joint]
        self._own.update(np.array(utilities))

    def _with_start(self, plans: Sequence[Plan], team: TeamHeads) -> list[Plan]:
        """Return plans for X̂: this head's in the best joint plan, then these."""
        chosen = {p.tobytes(): p for p in (self._values.starts[team].plans[self.head], *plans)}
        return list(chosen.values())[: self.parameters.plans]

    def _refine(self, team: TeamHeads, *, recreate: bool) -> None:
        """Recreate windows of the best joint order, or polish it; go over to a better start."""
        polishing = self._polishing
        first = polishing is None or polishing.team != team
        if polishing is None or first or polishing.outdone_by(self._values.starts[team]):
            begun = StatedOrder.of(self._values.start_paths[team])
            polishing = self._polishing = self._new_polishing(begun, team)
        best = self._values.stated(self.best(team).plans) if first else None
        if best is not None:
            polishing.polish.take(best)
        if recreate and len(self.problem.macro) > FEW:
            polishing.polish.recreate(self.parameters.windows)
        else:
            polishing.polish.improve(self.parameters.windows)
        self._keep_polished(polishing)

    def _new_polishing(
        self, stated: StatedOrder, team: TeamHeads, gained_s: float = 0.0
    ) -> _Polishing:
        """Return a joint order to polish; each has random numbers of its own."""
        seed = self._seed * len(self.problem.machine.heads) + self.head
        seed += len(self.problem.machine.heads) * self._polishings
        self._polishings += 1
        polish = Polish(self.problem, stated, seed=seed, live=team)
        return _Polishing(team, polish, self._values.starts[team].makespan_s, gained_s)

    def _follow(self, stated: StatedOrder, makespan_s: float, team: TeamHeads) -> None:
        """Polish another head's order from now on if it is well ahead of the one polished here."""
        polishing = self._polishing
        if polishing is not None and makespan_s < polishing.polish.began_s:
            gained = self._values.starts[team].makespan_s - makespan_s
            theirs = self._new_polishing(stated, team, gained)
            if theirs.polish.began_s < BEHIND * polishing.polish.best_s:
                self._polishing = theirs

    def _keep_polished(self, polishing: _Polishing) -> None:
        """Judge what was polished, as a plan of this head that states what all do."""
        if polishing.polish.best_s < self.best(polishing.team).makespan_s:
            heads, n_macros = len(self.problem.machine.heads), self.problem.n_macros
            plan = encode_stated(polishing.polish.best, heads, n_macros)
            plans = {r: plan if r == self.head else NOTHING for r in polishing.team}
            self._values.makespan(plans, polishing.team)

    def _draw(self, team: TeamHeads) -> dict[int, Plan]:
        """Draw x⁻ʳ from the latest known distributions."""
        return {
            r: self._others[r].sample(self._rng) if r in self._others else self._likeliest(r)
            for r in team
            if r != self.head
        }

    def _plan_alone(self, team: TeamHeads) -> None:
        """Search one order for everything; the effort doubles with the rounds."""
        problem = self.problem
        self._alone += 1
        effort = 100_000 * 2 ** min(self._alone, 8)
        result = plan_order(
            OrderProblem.from_job(problem.job, problem.graph, "reversible"),
            planner="local",
            stopping=Stopping(iterations=effort),
            seed=self._seed + self._alone,
        )
        plan = encode_serial(result.toolpath, problem.n_macros)
        self._values.makespan({self.head: plan}, team)
        self._own = Candidates((self.best(team).plans[self.head],), self.parameters)


def _team(live: Sequence[int]) -> TeamHeads:
    return tuple(sorted({int(r) for r in live}))
