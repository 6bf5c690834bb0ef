"""One head prints everything, in the order `hybrid` finds; others do what it cannot reach."""

from __future__ import annotations

from decmcts.print.toolpath import Toolpath
from decmcts.search.planners import plan_order
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.baselines.incumbent import Budget, Found, Incumbent
from decmcts.team.engine.plans import encode_serial
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve

STEPS = 1000  # of the search, for each joint order of a budget that counts these


def hybrid_order(problem: TeamProblem, budget: Budget, share: float, seed: int) -> Toolpath:
    """Return the order of everything that `hybrid` finds in a share of the budget."""
    seconds, orders = budget.stopping.seconds, budget.stopping.iterations
    return plan_order(
        OrderProblem.from_job(problem.job, problem.graph, "reversible"),
        planner="hybrid",
        stopping=Stopping(
            seconds=None if seconds is None else share * seconds,
            iterations=None if orders is None else STEPS * orders,
        ),
        clock=budget.clock,
        seed=seed,
    ).toolpath


def plan(problem: TeamProblem, budget: Budget, *, seed: int) -> Found:
    """Return the order `hybrid` finds in this time, shared out where no head reaches it all."""
    heads = len(problem.machine.heads)
    best = Incumbent(budget, heads)
    order = hybrid_order(problem, budget, 1.0, seed)
    serial = {0: encode_serial(order, problem.n_macros)}
    resolved = resolve(problem, serial, range(heads))
    best.offer_toolpaths(resolved.toolpaths, resolved.makespan_s)
    return best.found
