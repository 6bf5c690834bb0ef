"""A team's print planned in one process: the same at equal seeds and rounds, and judged."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from decmcts.experiments.kinds import Key, Row, stopping_of
from decmcts.experiments.prints import Point, is_own, print_file
from decmcts.formats.machines.machine_file import load_machine, rail_machine
from decmcts.planning.events import unheard
from decmcts.planning.options import Cut, Rules
from decmcts.planning.problem.own_tools import team_problem
from decmcts.planning.problem.planned import document_of, require_passed, source_plan
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.planning.problem.source import read
from decmcts.planning.team.cutting import best_sweep
from decmcts.planning.team.pipeline import lags_of
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.dec_mcts.warm_up import compile_rounds
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.joint_plan import schedule
from sim.verify import verify_plan

PlanFunction = Callable[..., tuple[Toolpath, ...]]  # (problem, stopping, *, seed)


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """A print and what heads plan of it."""

    problem: PrintProblem  # with contours cut, if any are
    lags: Lags  # that cooling demands
    team: TeamProblem

    @property
    def whole(self) -> PrintProblem:
        """The print before contours were cut."""
        return self.problem.whole or self.problem


def machine_for(key: Key, heads: int, length_mm: float) -> tuple[Machine, Point]:
    """Return a machine with so many heads in a row, and where prints made by code lie on it.

    For one's own prints of two heads it is `dual-gantry` as it is.
    """
    pair = load_machine("dual-gantry")
    middle = length_mm / 2.0, (pair.bed_min[1] + pair.bed_max[1]) / 2.0
    own = is_own(key) and heads == 2
    return pair if own else rail_machine(pair, heads, length_mm), middle


def given(key: Key, heads: int, length_mm: float, cut: Cut) -> Given:
    """Read a print for so many heads, and cut it where they then share it sooner.

    InputError as of `launch`.
    """
    machine, middle = machine_for(key, heads, length_mm)
    with print_file(key, middle) as path:
        source = read(path, machine)
        problem = team_problem(source, Rules(), unheard)
    return given_by(problem, cut)


def given_by(problem: PrintProblem, cut: Cut = Cut.NONE) -> Given:
    """Return what heads plan of a problem, cut where they then share it sooner."""
    found = best_sweep(problem, cut, unheard)
    problem = problem if found is None else found.problem
    lags = lags_of(problem, source_plan(problem))
    start = None if found is None else found.order
    job, machine, graph = problem.job, problem.machine, problem.graph
    return Given(problem, lags, build_team_problem(job, machine, graph, lags, start))


def in_one_process(problem: TeamProblem, stopping: Stopping, *, seed: int) -> tuple[Toolpath, ...]:
    """Return what all heads' Dec-MCTS find in turn; its iterations are rounds."""
    heads = range(len(problem.machine.heads))
    proposal = plan_in_turn(problem, stopping=stopping, seed=seed, clock=time.process_time)
    return resolve(problem, proposal.plans, heads).toolpaths


def planned(what: Given, key: Key, by: PlanFunction = in_one_process) -> PlanDocument:
    """Return the joint plan that a planner finds; raises VerificationError unless it is safe."""
    compile_rounds()
    by(what.team, Stopping(iterations=1), seed=0)  # compiles, or loads what is compiled
    return exact(what, by(what.team, stopping_of(key), seed=int(key["seed"])))


def exact(what: Given, toolpaths: tuple[Toolpath, ...]) -> PlanDocument:
    """Return the exact plan of toolpaths; raises VerificationError unless the judge passes it."""
    problem = what.problem
    plan = schedule(problem.job, problem.machine, problem.graph, toolpaths, lags=what.lags)
    document = document_of(problem, plan, {})
    require_passed(verify_plan(document, source=what.whole.job))
    return document


def bound_s(what: Given) -> float:
    """Return the makespan that no joint plan can beat, s."""
    problem = what.problem
    return makespan_bound(problem.job, problem.machine, problem.graph).bound_s


def figures(what: Given, document: PlanDocument) -> Row:
    """Return makespan, bound, and what share of their time heads wait or have nothing left."""
    plan, bound = document.plan, bound_s(what)
    heads, end = len(plan.heads), plan.makespan_s
    busy = sum(document.metrics["busy_s_per_head"])
    until = sum(float(head.end_s[-1]) for head in plan.heads if len(head))
    return {
        "contours": len(what.whole.job.contours),
        "makespan_s": round(end, 2),
        "bound_s": round(bound, 2),
        "over_bound": round(end / bound, 4),
        "waits": round((until - busy) / (heads * end), 4),
        "idle": round(1.0 - until / (heads * end), 4),
    }


def printing_s(document: PlanDocument) -> float:
    """Return how long all beads of a plan take."""
    heads = document.plan.heads
    return float(sum((h.end_s - h.begin_s)[h.kind == ActionKind.PRINT].sum() for h in heads))
