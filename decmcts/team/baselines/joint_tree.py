"""One Monte Carlo tree over joint actions, for all heads at once.

The first action is a policy; every further one gives a macro-action to the head that
has least to do. What is left is given by chance, near to how the heads would share it
by default, and the heads dispatch what they own in that order. Nodes seen often get
more children (progressive widening).

References
----------
Kocsis & Szepesvári 2006, "Bandit based Monte-Carlo planning", ECML.
Couëtoux et al. 2011, "Continuous upper confidence trees", LION 5: progressive widening.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from decmcts._kernels.engine.joint import Units
from decmcts.team.baselines.incumbent import Budget, Found, Incumbent
from decmcts.team.baselines.lists import dispatched
from decmcts.team.engine.plans import POLICIES
from decmcts.team.engine.problem import TeamProblem

EXPLORATION = 0.7071067811865476  # C_p
NEAR = 0.4  # chance that the next macro-action in the default order is passed over
ASTRAY = 0.1  # chance that a head takes one of another's side


@dataclass(slots=True)
class Node:
    """A joint action and what was seen below it."""

    children: dict[int, Node] = field(default_factory=dict)  # by action
    visits: int = 0
    total: float = 0.0  # of rewards


class Handout:
    """Macro-actions given to heads one after the other."""

    def __init__(self, problem: TeamProblem, rng: np.random.Generator) -> None:
        self._rng = rng
        n, heads = problem.n_macros, len(problem.machine.heads)
        seconds = problem.visits.seconds.min(axis=0)
        self._work = np.bincount(problem.macro, weights=seconds, minlength=n)
        may = np.ones((n, heads), np.int8)
        np.minimum.at(may, problem.macro, problem.space.eligible.astype(np.int8))
        self._may = may.astype(np.bool_)
        side = np.zeros(n, np.int64)
        side[problem.macro] = problem.side_of()
        self._side = side
        self.owner = np.full(n, -1)
        self.rank = np.zeros(n)
        self._load, self._given = np.zeros(heads), 0

    @property
    def head(self) -> int:
        """Return who gets the next macro-action: the head with least to do that may do any."""
        left = self._may[self.owner < 0]
        return int(np.where(left.any(axis=0), self._load, np.inf).argmin())

    @property
    def over(self) -> bool:
        """Whether nothing is left that some head may do as a whole."""
        return not self._may[self.owner < 0].any()

    def by_chance(self) -> int:
        """Return a macro-action for the next head: an early one, of its own side if there is."""
        head = self.head
        left = np.flatnonzero((self.owner < 0) & self._may[:, head])
        own = left[self._side[left] == head]
        if len(own) and self._rng.random() >= ASTRAY:
            left = own
        return int(left[min(int(self._rng.geometric(1.0 - NEAR)), len(left)) - 1])

    def give(self, macro: int) -> None:
        """Give a macro-action to the next head."""
        head = self.head
        self.owner[macro], self.rank[macro] = head, self._given
        self._load[head] += self._work[macro]
        self._given += 1


def carried_out(problem: TeamProblem, policy: int, handout: Handout) -> Units:
    """Dispatch everything; what no single head may do as a whole goes to any that may."""
    heads = len(problem.machine.heads)
    owner = handout.owner[problem.macro]
    mine = (owner[:, None] == np.arange(heads)[None]) | (owner < 0)[:, None]
    place = handout.rank / max(len(handout.rank), 1)
    keys = np.repeat((place[problem.macro] + 1e-3 * problem.progress)[None], heads, axis=0)
    weights = np.repeat(POLICIES[policy][None], heads, axis=0)
    return dispatched(problem, weights, keys=keys, eligible=mine & problem.space.eligible)


class JointTree:
    """The tree; grows in place."""

    def __init__(self, problem: TeamProblem, rng: np.random.Generator) -> None:
        self._problem, self._rng = problem, rng
        self._root = Node()
        self._range = (math.inf, -math.inf)  # of makespans

    def sample(self, best: Incumbent) -> None:
        """Descend, add one node, roll out and back up."""
        handout = Handout(self._problem, self._rng)
        path, policy = [self._root], -1
        while True:
            node = path[-1]
            if policy >= 0 and handout.over:
                break
            widened = len(node.children) ** 2 <= node.visits
            action = self._new_action(node, policy, handout) if widened else self._chosen(node)
            added = action not in node.children
            path.append(node.children.setdefault(action, Node()))
            if policy < 0:
                policy = action
            else:
                handout.give(action)
            if added:
                break
        while not handout.over:
            handout.give(handout.by_chance())
        makespan = best.offer(carried_out(self._problem, policy, handout))
        self._back_up(path, makespan)

    def _new_action(self, node: Node, policy: int, handout: Handout) -> int:
        if policy < 0:
            return min(len(node.children), len(POLICIES) - 1)
        return handout.by_chance()

    def _chosen(self, node: Node) -> int:
        """Return the action of largest upper confidence bound."""
        log = math.log(max(node.visits, 1))

        def bound(item: tuple[int, Node]) -> float:
            child = item[1]
            mean = child.total / child.visits
            return mean + 2.0 * EXPLORATION * math.sqrt(log / child.visits)

        return max(node.children.items(), key=bound)[0]

    def _back_up(self, path: list[Node], makespan: float) -> None:
        low, high = min(self._range[0], makespan), max(self._range[1], makespan)
        self._range = (low, high)
        reward = (high - makespan) / (high - low) if high > low else 0.5
        for node in path:
            node.visits += 1
            node.total += reward


def plan(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return the best joint order of all samples."""
    best = Incumbent(budget, len(problem.machine.heads))
    tree = JointTree(problem, np.random.default_rng(seed))
    while not best.ended:
        tree.sample(best)
    return best.found
