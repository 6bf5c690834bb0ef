"""One print from file to checked plan: read, build the graph, order, schedule, verify.

No output is written here and nothing is printed; `steps` are announced through
the `Announce` callback so that the console can show them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from decmcts import __version__
from decmcts._kernels.engine.lags import Lags
from decmcts.cli.ahead import bound_part, is_compiled, unit_for
from decmcts.cli.begin import compile_search
from decmcts.cli.beside import Stop, searched_beside
from decmcts.cli.bound import EARLY_FROM_S, certify, early_bound
from decmcts.cli.order_search import OrderSearch, source_toolpath
from decmcts.cli.quality import Quality
from decmcts.cli.slicing import Slicing
from decmcts.errors import InputError, VerificationError
from decmcts.feasibility.digest import problem_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.feasibility.rules import order_rules
from decmcts.formats.gcode import GcodeDocument, read_gcode
from decmcts.formats.machine_file import check_fits, load_machine
from decmcts.formats.mesh import MESH_SUFFIXES, SliceOptions, read_sliced, slice_mesh
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, JointPlan, OrderRules, PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.search.planners import (
    Planner,
    SearchResult,
    plan_order,
    toolpath_cost,
)
from decmcts.search.sequence.pace import pace_of
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.spacing import Spacing
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.engine.alone import lone_machine
from decmcts.team.schedule.cooling import find_lags, print_times, source_times, spacing_of
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.metrics import plan_metrics
from decmcts.team.schedule.waits import add_waits
from sim.faults import Verdict
from sim.verify import verify_plan

Announce = Callable[[str], None]

PARK_ABOVE_MM = 5.0
NO_QUALITY = Quality(edges=False, min_layer_time_s=0.0)


@dataclass(frozen=True, slots=True)
class Loaded:
    """An input, the machine it is for, and what must come before what."""

    path: Path
    job: PrintJob
    document: GcodeDocument
    machine: Machine
    graph: DependencyGraph
    seconds: dict[str, float]  # time of each step
    own_limits: bool = True  # the motion limits the source states count, not the machine's
    min_layer_time_s: float = 0.0  # no spot is printed over sooner; 0: no such rule
    sliced_by: str = ""  # what made the G-code of a mesh
    rules: OrderRules | None = None  # what was asked of the order besides safety

    @property
    def problem(self) -> str:
        """Digest that identifies contours, order constraints and machine."""
        return problem_digest(self.job.contours, self.graph, self.machine)


@dataclass(frozen=True, slots=True)
class Planned:
    """A plan that passed verification, with the source's own order beside it."""

    loaded: Loaded
    before: PlanDocument
    after: PlanDocument
    verdict: Verdict
    history: Any  # (k, 3) seconds, iterations, cost
    seconds: dict[str, float]


def read_input(
    path: Path, options: SliceOptions, sliced: Path | None = None
) -> tuple[PrintJob, GcodeDocument]:
    """Read G-code, or slice a mesh; raises InputError when neither works.

    `sliced` is G-code that was made of the mesh at `path`.
    """
    if not path.exists():
        raise InputError("no such file", path=path)
    if sliced is not None:
        return read_sliced(sliced, path)
    if path.suffix.lower() in MESH_SUFFIXES:
        return slice_mesh(path, options)
    return read_gcode(path)


@contextmanager
def named(path: Path) -> Iterator[None]:
    """Name the file in what is refused by those who know its contours only."""
    try:
        yield
    except InputError as error:
        raise InputError(error.what, path=path, line=error.line, advice=error.advice) from error


def load(
    path: Path,
    machine: str | Machine,
    *,
    process_order: str,
    options: SliceOptions,
    announce: Announce,
    own_limits: bool = True,
    quality: Quality = NO_QUALITY,
    freedom: str = "reversible",
    slicing: Slicing | None = None,
) -> Loaded:
    """Read `path`, check that it fits the machine and build its dependency graph.

    `slicing` makes G-code of a mesh, in place of the built-in slicer with `options`.
    With `own_limits` the motion limits a source states replace the machine's. With
    freedom `seam` the graph knows what loops lay down wherever they begin.
    """
    seconds: dict[str, float] = {}
    chosen = load_machine(machine) if isinstance(machine, str) else machine
    sliced, sliced_by = None, ""
    if slicing is not None and path.suffix.lower() in MESH_SUFFIXES and path.exists():
        started = time.perf_counter()
        sliced_by = slicing.chosen.name
        announce(f"slicing {path.name} with {sliced_by}")
        sliced = slicing.slice_for(path, chosen)
        seconds["slice"] = time.perf_counter() - started
    started = time.perf_counter()
    announce(f"reading {path.name}")
    job, document = read_input(path, options, sliced)
    seconds["read"] = time.perf_counter() - started
    if own_limits:
        chosen = replace(chosen, limits=chosen.limits.under(job.limits))
    started = time.perf_counter()
    announce(f"dependency graph of {len(job.contours)} contours for {chosen.name}")
    with named(path):
        check_fits(job.contours, chosen)
        chosen = parked_above(chosen, job.contours)
        graph = order_rules(
            job,
            chosen,
            process_order=process_order,  # type: ignore[arg-type]  # typer checked the choice
            quality=quality.holds(chosen),
            free_seams=freedom == "seam",
            max_layers_ahead=quality.max_layers_ahead,
        )
    seconds["graph"] = time.perf_counter() - started
    rule = quality.rule_s(job, chosen)
    rules = OrderRules(process_order, quality.holds(chosen), quality.max_layers_ahead, freedom)
    return Loaded(
        path, job, document, chosen, graph, seconds, own_limits, rule, sliced_by, rules
    )  # fmt: skip


def document_of(loaded: Loaded, plan: JointPlan, extra: dict[str, Any]) -> PlanDocument:
    """Wrap a plan with all that is needed to check and draw it."""
    metrics = {**plan_metrics(loaded.job, plan), **extra, "version": __version__}
    return PlanDocument(
        loaded.problem, loaded.machine, loaded.job.contours, loaded.graph.pairs(), plan, metrics,
        loaded.min_layer_time_s, loaded.rules,
    )  # fmt: skip


def source_plan(loaded: Loaded) -> PlanDocument:
    """Schedule the source's own order, the yardstick every result is compared with.

    Of a machine with several heads the first prints it alone, as if it reached everything.
    """
    machine = loaded.machine if len(loaded.machine.heads) == 1 else lone_machine(loaded.machine)
    sliced = Toolpath.as_sliced(len(loaded.job.contours))
    plan = schedule(loaded.job, machine, loaded.graph, [sliced])
    extra = {"planner": "slicer", "objective": "travel", "freedom": "fixed", "seed": 0}
    return document_of(replace(loaded, machine=machine), plan, extra)


def search(
    loaded: Loaded,
    *,
    planner: str | Planner,
    freedom: str,
    time_limit_s: float,
    seed: int,
    seam: str = "nearest",
    objective: str = "travel",
    **hooks: Any,
) -> SearchResult:
    """Find an order for one head; never worse than the source in what it minimises."""
    problem = problem_of(loaded, freedom=freedom, seam=seam, objective=objective)
    compile_search(problem, planner)
    return plan_order(
        problem, planner=planner, stopping=Stopping(seconds=time_limit_s), seed=seed, **hooks
    )


def problem_of(loaded: Loaded, *, freedom: str, seam: str, objective: str) -> OrderProblem:
    """Return what a search for one head has to solve."""
    problem = OrderProblem.from_job(loaded.job, loaded.graph, freedom, seam)  # type: ignore[arg-type]
    pace = pace_of(loaded.job, loaded.machine.limits) if objective == "time" else None
    return replace(problem, pace=pace)


def plan_single(
    loaded: Loaded,
    *,
    planner: str,
    freedom: str,
    time_limit_s: float,
    seed: int,
    announce: Announce,
    seam: str = "nearest",
    certificate: bool = False,
    objective: str = "travel",
    before: PlanDocument | None = None,
    judged: Callable[[], PlanDocument] | None = None,
    stop: Stop = lambda: False,
    **hooks: Any,
) -> Planned:
    """Plan one head: search, bound the travel if `certificate`, schedule, verify.

    `before` is the plan of the source's own order, where it was made already; else `judged`
    makes it, while the search begins. Once `stop` says so there is no more searching or
    proving, nor compiling for it.
    """
    if before is None and judged is None:
        before = source_plan(loaded)
    problem = problem_of(loaded, freedom=freedom, seam=seam, objective=objective)
    knows_bound = is_compiled(bound_part(unit_for(problem)))
    if certificate and time_limit_s >= EARLY_FROM_S and knows_bound and not stop():
        announce("a first bound on the travel")
        hooks["bound"] = early_bound(problem, time_limit_s=time_limit_s)
    announce("preparing the search")
    started = time.perf_counter()
    lags, guess, spacing = _lags(loaded, before)
    sliced = source_toolpath(problem)
    order = OrderSearch(
        loaded.job, loaded.machine, loaded.graph, problem, guess, spacing,
        planner, time_limit_s, seed, announce, hooks,
    )  # fmt: skip
    found: SearchResult | None = None
    if before is None:
        assert judged is not None
        order.compile_cooling()
        announce("the source's own order, judged while the search begins")
        with searched_beside(order, stop=stop, announce=announce) as searched:
            before = judged()
            found = searched()
        lags, _, _ = _lags(loaded, before)
    result = found or order.search(order.begin(stop), stop)
    seconds = {**loaded.seconds, "plan": time.perf_counter() - started}
    announce("safe travels and times")
    plan, toolpath = _scheduled(loaded, result.toolpath, lags), result.toolpath
    if objective == "time" or len(lags.below):
        plan, toolpath = _no_slower(loaded, before, (plan, toolpath), sliced, lags)
    bound: dict[str, Any] = {}
    if certificate:
        if not stop():
            announce("proving how far from optimal this is at most")
        started = time.perf_counter()
        travel = toolpath_cost(problem, toolpath)
        bound = certify(
            problem, travel, time_limit_s=time_limit_s, known=result.bound, stopped=stop()
        )
        seconds["bound"] = time.perf_counter() - started
    extra = {
        "planner": planner,
        "objective": objective,
        "freedom": freedom,
        **({"seam": seam} if freedom == "seam" else {}),
        "seed": seed,
        "time_limit_s": time_limit_s,
        "iterations": result.iterations,
        "as_sliced": _as_sliced(plan),
        **bound,
    }
    after = document_of(loaded, plan, extra)
    return check(loaded, before, after, result.history, seconds, announce)


def _scheduled(loaded: Loaded, order: Toolpath, lags: Lags) -> JointPlan:
    """Schedule an order for one head, with waits for what must cool."""
    plan = schedule(loaded.job, loaded.machine, loaded.graph, [order])
    return add_waits(loaded.job, loaded.machine, plan, lags)


def _no_slower(
    loaded: Loaded,
    before: PlanDocument,
    found: tuple[JointPlan, Toolpath],
    sliced: Toolpath,
    lags: Lags,
) -> tuple[JointPlan, Toolpath]:
    """Return what was found, or the source's order where lifts and waits make that quicker.

    A search sees neither all lifts nor all waits.
    """
    if found[0].makespan_s <= before.plan.makespan_s:
        return found
    own = _scheduled(loaded, sliced, lags) if sliced.entry.any() else before.plan
    return (own, sliced) if own.makespan_s < found[0].makespan_s else found


def _as_sliced(plan: JointPlan) -> bool:
    """Say whether a plan for one head prints as sliced: order, directions and entries."""
    lane = plan.heads[0]
    prints = lane.kind == ActionKind.PRINT
    moved = lane.reversed[prints] | (lane.entry[prints] != 0)
    return bool((np.diff(lane.contour[prints]) > 0).all()) and not bool(moved.any())


def _lags(loaded: Loaded, source: PlanDocument | None) -> tuple[Lags, Lags, Spacing | None]:
    """Return what must cool how long, by the plan's times and by those a search estimates.

    And the latter as a search keeps them; None where nothing has to cool. Without a plan
    the estimate stands for it.
    """
    job, rule, n = loaded.job, loaded.min_layer_time_s, len(loaded.job.contours)
    guess = source_times(job, loaded.machine, loaded.graph) if rule else (np.zeros(n), np.zeros(n))
    exact = guess if source is None else print_times(source.plan.heads[0], n)
    lags, estimated = find_lags(job.contours, [exact, guess], rule)
    return lags, estimated, spacing_of(estimated, *guess) if len(estimated.below) else None


def check(
    loaded: Loaded,
    before: PlanDocument,
    after: PlanDocument,
    history: Any,
    seconds: dict[str, float],
    announce: Announce,
) -> Planned:
    """Verify a plan with the independent judge; raises VerificationError when it fails."""
    announce("verifying")
    started = time.perf_counter()
    verdict = verify_plan(after, source=loaded.job)
    seconds = {**seconds, "verify": time.perf_counter() - started}
    if verdict.faults:
        raise VerificationError(
            f"the plan failed verification with {len(verdict.faults)} faults "
            f"and was not written: {verdict.shown}"
        )
    return Planned(loaded, before, after, verdict, history, seconds)


def single_head_machine(machine: Machine, head: int) -> Machine:
    """Return the machine with one head only, for the single-extruder mode."""
    return machine.alone(machine.heads[head])


def parked_above(machine: Machine, contours: Contours) -> Machine:
    """Return a one-head machine with its park above the print.

    Where a single head rests before and after is the start and end G-code's
    business; the plan must only not rest inside the print.
    """
    if len(machine.heads) != 1 or not len(contours):
        return machine
    head = machine.heads[0]
    x, y, z = head.park
    above = float(contours.top.max()) + PARK_ABOVE_MM
    return replace(machine, heads=(replace(head, park=(x, y, max(z, above))),))
