"""One head, from problem to judged plan: order, bound, schedule, verify.

No output is written here. See ARCHITECTURE.md, which follows one print through it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from decmcts.formats.gcode.controller.duration import FileTime
from decmcts.planning.compiling import PRINT, is_compiled
from decmcts.planning.events import Note, Report, Sound, Step, Stop, never, unheard
from decmcts.planning.one_head.certificate import SHARE, certify, early_bound
from decmcts.planning.one_head.detours import WallRule
from decmcts.planning.one_head.order_search import (
    OrderSearch,
    compile_search,
    searched_beside,
    source_toolpath,
)
from decmcts.planning.options import AvoidWalls, Freedom, Objective, Search
from decmcts.planning.problem import first_check
from decmcts.planning.problem.first_check import refuse_unsound, refuse_unwritable
from decmcts.planning.problem.planned import Planned, check, document_of, source_plan
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.planning.worker import worker
from decmcts.planning.writing.file_times import source_time
from decmcts.print.lags_kernels import Lags
from decmcts.print.metrics import Metrics
from decmcts.print.plan import ActionKind, JointPlan, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.search.planners import SearchResult, toolpath_cost
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.search.sequence.timed_lags import TimedLags
from decmcts.team.engine.alone import lone_machine
from decmcts.team.schedule.cooling import (
    cooled,
    find_lags,
    print_times,
    source_times,
    timed_lags_of,
)
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.waits import add_waits

BESIDE_FROM = 20_000  # contours: the text of their own order is judged while the search runs
Judge = Callable[[], PlanDocument]
"""Returns the plan of the source's own order once it was judged; InputError if it has faults."""


def plan_one_head(
    problem: PrintProblem,
    search: Search,
    *,
    writes: bool,
    report: Report = unheard,
    stop: Stop = never,
    compiled: Callable[[str], bool] = is_compiled,
    refuse: Callable[..., None] = refuse_unsound,
    refuse_text: Callable[..., tuple[str, ...]] = refuse_unwritable,
) -> Planned:
    """Have the source's own order judged and find a better one.

    With `writes` a print whose G-code could not be written is refused before the search, or while
    it runs: the text of a large print takes as long to judge as many a search. If the judge is not
    `compiled` yet, compiling it takes longer than compiling a first search. Then the search begins
    while the source's own order is judged. Raises InputError when the judge refuses the source's
    own order (`refuse` its plan, `refuse_text` its text), and so every other, VerificationError
    when the judge refuses the plan.
    """

    def judged() -> PlanDocument:
        before = source_plan(problem)
        refuse(problem, before)
        if writes:
            _warn(refuse_text(problem, before), report)
        report(Sound())
        return before

    if not compiled(PRINT):
        return plan_judged(problem, search, judge=judged, report=report, stop=stop)
    report(Step("the source's own order, judged before anything is searched"))
    if not writes or len(problem.job.contours) < BESIDE_FROM:
        return plan_judged(problem, search, before=judged(), report=report, stop=stop)
    with worker(first_check.__name__) as beside:
        before = source_plan(problem)
        text = beside.call(refuse_text, problem, before)
        refuse(problem, before)
        report(Sound())

        def until() -> bool:
            return stop() or (text.done() and text.exception() is not None)

        planned = plan_judged(problem, search, before=before, report=report, stop=until)
        if not text.done():
            report(Step("the text of the source's own order, judged before anything is written"))
        _warn(text.result(), report)
    return planned


def _warn(lines: tuple[str, ...], report: Report) -> None:
    for line in lines:
        report(Note(f"the source drives the head into the print, which is kept: {line}"))


def search_alone(
    problem: PrintProblem, search: Search, before: PlanDocument, *, stop: Stop = never
) -> tuple[Lags, Toolpath, JointPlan]:
    """Return the lags that cooling demands, and the order that `search` finds for one head.

    Also its plan, for one head that reaches everything. `before` is the plan of the source's own
    order, which is returned where it ends sooner. The order lets spots cool as long as the lags
    say, or waits little for it.
    """
    given = problem.for_one_head(search.objective)
    lags, estimated, timed_lags = _lags(problem, before)
    order = OrderSearch(problem, given, estimated, timed_lags, search, unheard)
    compile_search(given, search.planner, stop)
    order.compile_cooling()
    stopping = Stopping(search.time_limit_s, search.max_iterations, stop)
    found = order.search(search.planner, stopping).toolpath
    job, graph, machine = problem.job, problem.graph, lone_machine(problem.machine)
    best = cooled(job, problem.machine, graph, lags, found).toolpath
    plan = schedule(job, machine, graph, [best], lags=lags)
    if plan.makespan_s > before.plan.makespan_s:
        sliced = source_toolpath(given)
        own = schedule(job, machine, graph, [sliced], lags=lags)
        if own.makespan_s < plan.makespan_s:
            return lags, sliced, own
    return lags, best, plan


def plan_judged(
    problem: PrintProblem,
    search: Search,
    *,
    before: PlanDocument | None = None,
    judge: Judge | None = None,
    sliced: FileTime | None = None,
    report: Report = unheard,
    stop: Stop = never,
) -> Planned:
    """Plan one head: search, bound the travel, schedule, verify.

    `before` is the plan of the source's own order, where that was judged already; else `judge`
    makes it while the search begins. Without both, that order is scheduled and not judged.
    `sliced` is the source's file, where that was looked at already.
    Once `stop` returns True nothing more is searched, proven, or compiled for these.
    """
    if before is None and judge is None:
        before = source_plan(problem)
    order_problem = problem.for_one_head(search.objective)
    if sliced is None and problem.rules.avoid_walls != AvoidWalls.NEVER:
        report(Step("the source's travel over outer walls"))
        sliced = source_time(problem)
    walls = WallRule.of(problem, sliced)
    stopping = Stopping(search.time_limit_s, search.max_iterations, stop)
    bound = early_bound(order_problem, search, stopping, report)
    report(Step("preparing the search"))
    started = time.perf_counter()
    before, lags, result = _searched(
        problem, walls.priced(order_problem), search, bound, before, judge, stopping, report
    )
    seconds = {**problem.seconds, "plan": time.perf_counter() - started}
    report(Step("safe travels and times"))
    plan, toolpath = _scheduled(problem, result.toolpath, lags, walls), result.toolpath
    if search.objective == Objective.TIME or len(lags.below):
        own = source_toolpath(order_problem)
        plan, toolpath = _no_slower(problem, before, (plan, toolpath), own, lags, walls)
    same = problem.source.regrouped is None and _as_sliced(plan)
    extra: Metrics = {**_search_metrics(problem, search, result), "as_sliced": same}
    if walls.over:
        extra["walls_priced"] = walls.over
    if search.certificate:
        if not stop():
            report(Step("proving how far from optimal this is at most"))
        started = time.perf_counter()
        travel = toolpath_cost(order_problem, toolpath)
        proof = Stopping(SHARE * search.time_limit_s, asked=stop)
        known = None if walls.over else result.bound  # that is of dearer travels
        certificate = certify(order_problem, travel, stopping=proof, known=known)
        extra = {**extra, **certificate.metrics()}
        seconds["bound"] = time.perf_counter() - started
    after = document_of(problem, plan, extra)
    planned = check(problem, before, after, result.history, seconds, report)
    return replace(planned, sliced=sliced)


def _searched(
    problem: PrintProblem,
    order_problem: OrderProblem,
    search: Search,
    bound: float | None,
    before: PlanDocument | None,
    judge: Judge | None,
    stopping: Stopping,
    report: Report,
) -> tuple[PlanDocument, Lags, SearchResult]:
    """Return the plan of the source's own order, the lags by its times, and what was found."""
    lags, estimated, timed_lags = _lags(problem, before)
    order = OrderSearch(problem, order_problem, estimated, timed_lags, search, report, bound)
    found: SearchResult | None = None
    if before is None:
        assert judge is not None  # one of the two is given
        order.compile_cooling()
        report(Step("the source's own order, judged while the search begins"))
        with searched_beside(order, stopping=stopping, report=report) as searched:
            before = judge()
            found = searched()
        lags, _, _ = _lags(problem, before)
    return before, lags, found or order.search(order.begin(stopping.is_asked), stopping)


def _search_metrics(problem: PrintProblem, search: Search, result: SearchResult) -> Metrics:
    rules = problem.rules
    return {
        "planner": search.name,
        "objective": search.objective.value,
        "freedom": rules.freedom.value,
        **({"seam": rules.seam.value} if rules.freedom == Freedom.SEAM else {}),
        "seed": search.seed,
        "time_limit_s": search.time_limit_s,
        "iterations": result.iterations,
    }


def _scheduled(problem: PrintProblem, order: Toolpath, lags: Lags, walls: WallRule) -> JointPlan:
    """Schedule an order for one head, with waits where spots must cool.

    Its travels keep off outer walls as `walls` has it.
    """
    detours = walls.detours(problem, order)
    plan = schedule(problem.job, problem.machine, problem.graph, [order], detours=detours)
    return add_waits(problem.job, problem.machine, plan, lags)


def _no_slower(
    problem: PrintProblem,
    before: PlanDocument,
    found: tuple[JointPlan, Toolpath],
    sliced: Toolpath,
    lags: Lags,
    walls: WallRule,
) -> tuple[JointPlan, Toolpath]:
    """Return what was found, or the source's own order where that ends sooner.

    A search prices neither all lifts nor all waits, so its order may turn out slower.
    """
    if found[0].makespan_s <= before.plan.makespan_s:
        return found
    own = _scheduled(problem, sliced, lags, walls)
    return (own, sliced) if own.makespan_s < found[0].makespan_s else found


def _as_sliced(plan: JointPlan) -> bool:
    """Say whether a plan for one head prints as sliced: order, directions and entries."""
    actions = plan.heads[0]
    prints = actions.kind == ActionKind.PRINT
    moved = actions.reversed[prints] | (actions.entry[prints] != 0)
    return bool((np.diff(actions.contour[prints]) > 0).all()) and not bool(moved.any())


def _lags(
    problem: PrintProblem, source: PlanDocument | None
) -> tuple[Lags, Lags, TimedLags | None]:
    """Return the lags that cooling demands: by the source plan's times, and estimated twice.

    The second are by the times that a search estimates, the third are those as a search keeps
    them, None where nothing has to cool. Without a `source` plan the first are estimated too.
    """
    job, rule, n = problem.job, problem.min_layer_time_s, len(problem.job.contours)
    none = np.zeros(n), np.zeros(n)
    times = source_times(job, problem.machine, problem.graph) if rule else none
    exact = times if source is None else print_times(source.plan.heads[0], n)
    made_of = problem.source.regrouped
    left_s = None if made_of is None else made_of.left_s
    lags, estimated = find_lags(job.contours, [exact, times], rule, left_s)
    return lags, estimated, timed_lags_of(estimated, *times) if len(estimated.below) else None
