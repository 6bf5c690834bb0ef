"""What an agent needs of a planner: one head's Dec-MCTS search, and the shared `resolve`.

The agent loop (`agents.loop.agent`) sees nothing else of `decmcts.team`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from agents.messages.kinds import Distribution, Joint, MessageError, Plans, Proposal, Sequence32
from agents.planners.pack import Pack
from agents.planners.serial import joint_order, serial_plans
from decmcts.feasibility.digest import code_digest, team_digest
from decmcts.team.dec_mcts.parameters import RANGES, Parameters, changed
from decmcts.team.dec_mcts.planner import DecMcts, PlanDistribution
from decmcts.team.dec_mcts.warm_up import compile_rounds
from decmcts.team.engine.plans import decode, means_something
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import as_allowed


class DecMctsPlanner:
    """One head's planner.

    `take`, `offer` and `resolve` raise `MessageError` for plans that this problem can't have, since
    these come from outside. Every method that takes the live heads raises `InputError` if they
    cannot print everything.
    """

    def __init__(
        self, problem: TeamProblem, head: int, *, seed: int, parameters: Parameters | None = None
    ) -> None:
        self.problem = team_digest(problem.digest, problem.job, code=code_digest())
        self.names = problem.head_names
        self._team = problem
        # numbers in all plans of a message that may mean something for this problem
        stated = len(problem.head_names) * (len(problem.job.contours) + 2)
        started = 0 if problem.start is None else 3 * problem.start.n_macros
        of_macros = 1 + max(problem.n_macros, started)
        self.most_symbols = stated + int(RANGES["plans"][1]) * of_macros
        self._search = DecMcts(problem, head, seed=seed, parameters=parameters)

    @staticmethod
    def of_pack(pack: Pack, head: int, *, seed: int) -> DecMctsPlanner:
        """Build the problem of a pack and a planner for one head of it."""
        problem = build_team_problem(pack.job, pack.machine, pack.graph, pack.lags, pack.start)
        usual = Parameters.for_contours(len(problem.macro))
        parameters = changed(usual, pack.parameters)
        planner = DecMctsPlanner(problem, head, seed=seed, parameters=parameters)
        compile_rounds()  # before the clock runs
        planner.best(range(len(planner.names)))
        return planner

    def iterate(self, live: Sequence[int], spent: float = 1.0) -> None:
        """Do one round of planning for the live heads; `spent` of the time, 0..1, is over."""
        self._search.iterate(live, spent)

    def distribution(self) -> Distribution:
        """Return what peers need to know of our intentions."""
        own = self._search.distribution
        return Distribution(own.sequences, own.probabilities)

    def take(self, head: int, distribution: Distribution) -> None:
        """Use a peer's latest distribution."""
        self._require_known(distribution.sequences)
        received = PlanDistribution(distribution.sequences, distribution.probabilities)
        self._search.take(head, received)

    def forget(self, head: int) -> None:
        """Drop what is known of a peer."""
        self._search.forget(head)

    def best_joint(self, live: Sequence[int]) -> Joint:
        """Return the best joint plan known as it was judged, cheaply."""
        found = self._search.best(live)
        return Joint(tuple(live), found.plans, float(found.makespan_s))

    def offer(self, plans: Plans, live: Sequence[int]) -> None:
        """Judge a peer's joint plan; keep it if it is the best here too."""
        self._require_known(plans.values())
        self._search.take_joint(plans, live)

    def best(self, live: Sequence[int]) -> Proposal:
        """Return the best joint plan known for the live heads."""
        return self.resolve(self._search.best(live).plans, live)

    def resolve(self, plans: Plans, live: Sequence[int]) -> Proposal:
        """Return what plans resolve to; the same, bit for bit, on every agent.

        Of plans that state a serial order, the digest is of that order alone, and the order is
        checked, not computed.
        """
        self._require_known(plans.values())
        found = joint_order(self._team, plans, live)
        return Proposal(tuple(live), plans, found.makespan_s, found.digest)

    def serial(self, live: Sequence[int]) -> Proposal:
        """Return a joint plan that states who prints what in which order.

        What agents agree on when the same plans resolve differently on their hosts.
        """
        return replace(self.resolve(serial_plans(self._team, live), live), serial=True)

    def _require_known(self, sequences: Iterable[Sequence32]) -> None:
        """Raise MessageError for a plan that this problem can't have."""
        n_macros, n = self._team.n_macros, len(self._team.job.contours)
        for sequence in sequences:
            if not means_something(sequence, n_macros, n, len(self.names)):
                raise MessageError("a plan that means nothing for this problem")
            serial = decode(sequence, n_macros, n).serial
            if serial is not None and as_allowed(self._team, serial) is None:
                raise MessageError("a serial order that contradicts the precedence")
