"""What joint plans are worth to one head: each is resolved once, the best are kept.

The work is counted in contours that are placed in joint orders, so shares of it are the
same on every host and in every run. Which plans are tried is decided in
`decmcts.team.dec_mcts.planner`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import blake2b

import numpy as np

from decmcts.arrays import Int32s
from decmcts.errors import InputError
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.plans import StatedOrder, decode
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve

REMEMBERED = 50_000  # makespans of joint plans kept
EACH = 200  # contours whose work all else in an evaluation is counted as

Plan = Int32s
TeamHeads = tuple[int, ...]  # heads, in order


@dataclass(frozen=True, slots=True, eq=False)
class BestJointPlan:
    """The best joint plan a head knows."""

    plans: Mapping[int, Plan]
    makespan_s: float


class JointValues:
    """Makespans of joint plans.

    `best` has the best joint plan of each team and `starts` the best without a stated
    order, `start_paths` what that resolves to. `placed` is the work of all evaluations so far:
    for each the contours it placed, and EACH more.
    """

    def __init__(self, problem: TeamProblem) -> None:
        self._problem = problem
        self._known: dict[tuple[TeamHeads, bytes], float] = {}
        self._unable: set[TeamHeads] = set()  # cannot print everything
        self._serial_s = float(problem.visits.seconds.max(axis=0).sum())
        self.best: dict[TeamHeads, BestJointPlan] = {}
        self.starts: dict[TeamHeads, BestJointPlan] = {}
        self.start_paths: dict[TeamHeads, tuple[Toolpath, ...]] = {}
        self.placed = 0

    def knows(self, plans: Mapping[int, Plan], team: TeamHeads) -> bool:
        """Whether this joint plan is resolved already."""
        return _key(plans, team) in self._known

    def makespan(self, plans: Mapping[int, Plan], team: TeamHeads) -> float:
        """Return the makespan of a joint plan, infinite where these heads cannot print all."""
        if team in self._unable:
            return np.inf
        key = _key(plans, team)
        if key not in self._known:
            if len(self._known) >= REMEMBERED:
                self._known.clear()
            self._known[key] = self._resolved(plans, team)
        return self._known[key]

    def value(self, plans: Mapping[int, Plan], team: TeamHeads) -> float:
        """Return g, 1 for an instant print and 0 for one that takes twice the serial time."""
        serial = 2.0 * self._serial_s
        return max(0.0, 1.0 - self.makespan(plans, team) / serial) if serial > 0.0 else 0.0

    def utility(self, head: int, plans: Mapping[int, Plan], team: TeamHeads) -> float:
        """Return the local utility of a head's plan, fʳ = g(xʳ, x⁻ʳ) - g(∅ʳ, x⁻ʳ)."""
        rest = {r: self._without_start(plans[r]) for r in team if r != head}
        return self.value(plans, team) - self.value(rest, tuple(rest))

    def _without_start(self, plan: Plan) -> Plan:
        """Return what a plan means for fewer heads: their order to begin with is that of all."""
        changes = decode(plan, self._problem.n_macros, len(self._problem.macro)).changes
        return plan if changes is None else plan[:0]

    def stated(self, plans: Mapping[int, Plan]) -> StatedOrder | None:
        """Return the order that some plan states."""
        n_macros, n = self._problem.n_macros, len(self._problem.macro)
        found = (decode(plan, n_macros, n).stated for plan in plans.values())
        return next((stated for stated in found if stated is not None), None)

    def _resolved(self, plans: Mapping[int, Plan], team: TeamHeads) -> float:
        try:
            resolved = resolve(self._problem, plans, team)
        except InputError:
            self._unable.add(team)
            return np.inf
        self.placed += len(self._problem.macro) + EACH
        makespan = resolved.makespan_s
        found = BestJointPlan(dict(plans), makespan)
        if team not in self.best or makespan <= self.best[team].makespan_s:
            self.best[team] = found
        worse = team in self.starts and makespan > self.starts[team].makespan_s
        if not worse and self.stated(plans) is None:
            self.starts[team], self.start_paths[team] = found, resolved.toolpaths
        return makespan


def _key(plans: Mapping[int, Plan], team: TeamHeads) -> tuple[TeamHeads, bytes]:
    return team, blake2b(b"|".join(plans[r].tobytes() for r in team)).digest()
