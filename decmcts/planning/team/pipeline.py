"""Several heads, from problem to judged plan: the agents take the place of one head's search.

No output is written here. See ARCHITECTURE.md, which follows one planning round.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from functools import partial

import numpy as np

from agents.launch import LaunchResult
from agents.launch import launch as launch_agents
from agents.launching.status import AgentStatus, LaunchError
from decmcts.arrays import Flags
from decmcts.formats.gcode import refuse_for_heads, unprimed_note
from decmcts.formats.gcode.dialects.dialect import IDLE_MARK
from decmcts.planning.compiling import TEAM, finish_beside
from decmcts.planning.events import Begun, Heads, Note, Report, Sound, Step, Stop, never, unheard
from decmcts.planning.one_head.pipeline import search_alone
from decmcts.planning.options import Cut, Objective, PlannerName, Search, TeamSearch
from decmcts.planning.problem.first_check import refuse_unsound
from decmcts.planning.problem.planned import History, Planned, source_plan
from decmcts.planning.problem.print_problem import PrintProblem, named
from decmcts.planning.team.cutting import Swept, best_sweep
from decmcts.planning.team.joint import (
    Deciding,
    Outcome,
    Prepared,
    best_of,
    lines_of,
    sweep_plan,
    with_bound,
)
from decmcts.planning.worker import begun
from decmcts.planning.writing.heads import judge_beside, judged
from decmcts.print.cut import late_contours
from decmcts.print.lags_kernels import Lags, no_lags
from decmcts.print.machine_fit import require_printable
from decmcts.print.metrics import IdleMetrics, Metrics
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from decmcts.print.seam import SeamEntries
from decmcts.print.stands import practice_of, primed_before, stands_of
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.bounds.makespan import Bound, makespan_bound
from decmcts.team.engine.space import able_heads
from decmcts.team.schedule.cooling import find_lags, print_times
from decmcts.team.schedule.entries import (
    OrderChoices,
    agreed_job,
    biased_entries,
    entries_of,
    first_entries,
)
from sim.faults import Verdict

WELD_ROUNDS = 4  # of sweeps in which contours stay whole whose welds would be too old
ALONE_MOST_S = 10.0  # for the order of one head alone, and at most a third of the search time


Launch = Callable[..., LaunchResult]
"""Has the agents agree; `agents.launch.launch`, or in a test what stands for it."""


def plan_team(
    problem: PrintProblem,
    search: TeamSearch,
    *,
    writes: bool,
    report: Report = unheard,
    stop: Stop = never,
    agents: Launch = launch_agents,
) -> Planned:
    """Let the agents plan and agree, schedule, verify.

    With `writes` a print whose files could not be written is refused before the search, a note says
    what of its start code the heads' files leave out, and the plan comes with them. Raises
    InputError when the source's own order has faults, or no head reaches some contour,
    VerificationError when the judge refuses the plan.
    """
    whole = prepared(problem, search, writes=writes, report=report, stop=stop)
    ready = swept(whole, search, report)
    finish_beside(TEAM, report)  # so that agents load compiled kernels from the start
    started = time.perf_counter()
    report(Begun())
    outcome = _agreed(ready, search, report, stop, agents)
    seconds = {**problem.seconds, "plan": time.perf_counter() - started}
    with judge_beside(ready.problem, writes=writes) as beside:  # it loads while the plan is made
        chosen, after = best_of(ready, outcome, search, report)
        history = _history(outcome)
        planned = Planned(chosen.problem, whole.before, after, Verdict(()), history, seconds)
        planned = with_idling(judged(planned, beside, writes=writes, report=report))
    return with_bound(planned, chosen.bound, report)


def prepared(
    problem: PrintProblem,
    search: TeamSearch,
    *,
    writes: bool,
    report: Report = unheard,
    stop: Stop = never,
) -> Prepared:
    """Have the source's own order judged, and find all that must be known before agents plan."""
    rules, objective = problem.rules, search.objective
    orders = OrderChoices(rules.freedom.value, rules.seam.value, objective.value)
    entries = entries_of(problem.job, orders)
    bound = _bound(problem, entries)
    report(Step("the source's own order, one head"))
    before = source_plan(problem)
    limit_s = min(ALONE_MOST_S, search.time_limit_s / 3)
    local = Search(limit_s, search.seed, PlannerName.LOCAL, Objective.TIME)
    alone = begun(partial(search_alone, problem, local, before, stop=stop))  # beside the judge
    if writes:
        refuse_for_heads(problem.document, problem.job, problem.machine)
        if (note := unprimed_note(problem.document)) is not None:
            problem = replace(problem, job=replace(problem.job, notes=(*problem.job.notes, note)))
    job, machine, graph = problem.job, problem.machine, problem.graph
    with named(problem.path):  # some head may print each contour beside all that are parked
        able = able_heads(job, machine)
        require_printable(job.contours, machine, able, live=range(len(machine.heads)))
    refuse_unsound(problem, before)
    report(Sound())
    if not alone.done():
        report(Step("an order for one head alone"))
    lags, lone, lone_plan = alone.result()
    entry = first_entries(job, orders, lone)
    if entries is not None:
        report(Step("where loops begin"))
    entry = biased_entries(job, machine, graph, orders, entry, entries, lags)
    return Prepared(problem, before, lags, orders, lone, lone_plan, entry, bound)


def swept(ready: Prepared, search: TeamSearch, report: Report) -> Prepared:
    """Return what agents plan: with a sweep to begin with, of contours that may be cut for it.

    Where the age of welds is limited, only contours are cut whose welds the sweep prints in time.
    """
    if search.weld_limit_s is not None:
        return within_limit(ready, search, search.weld_limit_s, report)
    return cut_for(
        ready, best_sweep(ready.problem, search.cut, report, stagger_mm=search.stagger_mm)
    )


def within_limit(ready: Prepared, search: TeamSearch, limit_s: float, report: Report) -> Prepared:
    """Return what agents plan, with no contour cut whose weld the sweep would print too late."""
    problem, kept = ready.problem, np.zeros(len(ready.problem.job.contours), np.bool_)
    sweep = partial(best_sweep, problem, report=report, stagger_mm=search.stagger_mm)
    for _ in range(WELD_ROUNDS):
        cut = cut_for(ready, sweep(search.cut, kept=kept))
        if (late := _late_in(cut, limit_s)) is None:
            break
        if not late.any():
            cut = replace(cut, problem=replace(cut.problem, weld_limit_s=limit_s))
            break
        kept |= late
    else:
        cut, kept[:] = cut_for(ready, sweep(Cut.NONE)), True
    if kept.any():
        stays = len(kept) if cut.whole is None else int(kept.sum())
        report(Note(f"{stays} contours stay whole: their welds would be older than {limit_s:g} s"))
    return cut


def _late_in(cut: Prepared, limit_s: float) -> Flags | None:
    """Tell which contours the sweep welds too late, (contours of the source,); None: none is cut.

    All that are cut, where it cannot be printed.
    """
    pieces = cut.problem.job.contours
    if cut.whole is None:
        return None
    if (plan := sweep_plan(cut)) is None:
        return np.bincount(pieces.sources) > 1
    return late_contours(pieces, plan, limit_s)


def cut_for(ready: Prepared, found: Swept | None) -> Prepared:
    """Return what agents plan with a sweep to begin with."""
    if found is None:
        return ready
    problem = found.problem
    if problem.whole is None:
        return replace(ready, start=found.order)
    contours, lags = problem.job.contours, no_lags(len(problem.job.contours))
    if len(ready.lags.below):
        lags = lags_of(problem, source_plan(problem))
    return replace(
        ready,
        problem=problem,
        lags=lags,
        entry=np.where(contours.closed, ready.entry[contours.sources], 0),
        bound=_bound(problem, entries_of(problem.job, ready.orders)),
        start=found.order,
        whole=ready,
    )


def _bound(problem: PrintProblem, entries: SeamEntries | None) -> Future[Bound]:
    """Begin to find a bound; agents may have to share the processor with it."""
    bounded = partial(makespan_bound, problem.job, problem.machine, problem.graph, entries=entries)
    return begun(bounded, yielding=True)


def lags_of(problem: PrintProblem, before: PlanDocument) -> Lags:
    """Return the lags that cooling demands, by the source's own times."""
    times = print_times(before.plan.heads[0], len(problem.job.contours))
    return find_lags(problem.job.contours, [times], problem.min_layer_time_s)[0]


def _agreed(
    ready: Prepared, search: TeamSearch, report: Report, stop: Stop, agents: Launch
) -> Outcome:
    """Return what the agents agreed on; if that is nothing, one head prints alone."""
    problem, deciding = ready.problem, Deciding()

    def passed_on(states: tuple[AgentStatus, ...]) -> None:
        deciding.take(states)
        report(Heads(states, ready.bound_s))

    passed_on(())
    try:
        result = agents(
            agreed_job(problem.job, ready.orders, ready.entry),
            problem.machine,
            problem.graph,
            stopping=Stopping(search.time_limit_s, asked=stop),
            seed=search.seed,
            lags=ready.lags,
            start=ready.start,
            parameters=search.parameters,
            on_progress=passed_on,
        )
        outcome = Outcome(result, result.agreement.agents, decided=deciding.rows)
    except LaunchError as error:
        outcome = Outcome(None, error.agents, str(error))
    for line in lines_of(outcome.metrics()["team"]):
        report(Note(line))
    return outcome


def _history(outcome: Outcome) -> History:
    """Return the best makespan of any agent over time, (k, 2)."""
    best, history = float("inf"), []
    for seconds, makespan in sorted(h for a in outcome.agents for h in a.history):
        if makespan < best:
            best = makespan
            history.append((seconds, makespan))
    return np.array(history, np.float64).reshape(-1, 2)


_COOLS = re.compile(rb"^M104 [^\r\n]* " + re.escape(IDLE_MARK.encode()) + rb"\r?$", re.M)


def with_idling(planned: Planned) -> Planned:
    """Return a judged plan with the figures `idle`, where heads stand idle before beads.

    How often they cool is known only of files that are written.
    """
    rows = np.array(
        [_counts(planned, actions, h) for h, actions in enumerate(planned.after.plan.heads)]
    )
    waits, seconds, pulled, primed = rows.sum(axis=0).tolist()
    if not waits and not primed:
        return planned
    idle: IdleMetrics = {
        "waits": int(waits), "waits_s": seconds, "pulled": int(pulled), "primed": int(primed)
    }  # fmt: skip
    if planned.head_files:
        idle["cooled"] = sum(len(_COOLS.findall(text)) for text in planned.head_files)
    metrics: Metrics = {**planned.after.metrics, "idle": idle}
    return replace(planned, after=replace(planned.after, metrics=metrics))


def _counts(planned: Planned, actions: HeadActions, h: int) -> tuple[float, float, float, float]:
    """Return of a head: idle waits, their seconds, how many it is pulled back for, times primed."""
    job, machine = planned.problem.job, planned.after.machine
    if not (actions.kind == ActionKind.PRINT).any():
        return 0, 0.0, 0, 0
    idle = machine.heads[h].idle
    practice, settings = practice_of(actions, job, idle)
    stands = stands_of(actions, h, job.contours.epoch, idle.after_s)
    further = practice.retract_mm > settings.retract_mm
    primed = primed_before(actions, idle.after_s).sum() if practice.prime_mm else 0
    seconds = sum(stand.seconds for stand in stands.values())
    return len(stands), seconds, len(stands) * further, int(primed)
