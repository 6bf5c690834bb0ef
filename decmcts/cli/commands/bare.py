"""What the commands for bare problems (.sop, .qcsp) share: options refused, and what is proven.

`decmcts plan X.sop`: a bare sequential ordering problem, from file to tour.

`decmcts launch X.qcsp`: a bare team problem, from file to schedule.
"""

from __future__ import annotations

import math
import re
import time
from pathlib import Path

import typer

from decmcts.cli.console import err, out, print_json, steps, written
from decmcts.cli.options import given
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import InputError, VerificationError
from decmcts.formats.bare.qcsp import QcspProblem, read_qcsp, schedule_text
from decmcts.formats.bare.sop import SopInstance, read_sop, tour_text
from decmcts.jit.kernel import at_work
from decmcts.planning.bare import compile_qcsp, compile_sop, require_sound, solve_qcsp, solve_sop
from decmcts.planning.events import Step
from decmcts.planning.writing.places import (
    STDOUT,
    name_of,
    put,
    refuse_two_on_stdout,
    refuse_unwritable,
)
from decmcts.search.bounds.certificate import INFORMS_PERCENT
from decmcts.search.sop.solver import SopResult
from decmcts.team.qcsp.solver import QcspResult
from sim.qcsp import faults_of

_MEANT = frozenset({"source", "output", "time_limit", "seed", "as_json"})


def refuse_others(context: typer.Context, kind: str, has: str) -> None:
    """Raise InputError for an option given that means nothing to a file of this kind.

    `has` says what there is in it, and what is not.
    """
    for name, spellings in given(context).items():
        if name not in _MEANT:
            spelled = spellings[0 if context.params[name] else -1]
            raise InputError(
                f"{spelled} means nothing for a {kind} file: it has {has}", advice="leave it out"
            )


def proven(value: float, bound: float, *, optimal: bool) -> str:
    """Return in words how near to the best possible a cost or makespan is."""
    if optimal:
        return "proven optimal"
    gap = 100.0 * (value / bound - 1.0) if bound > 0.0 else math.inf
    near = f", at most {gap:.1f} % above optimal" if gap <= INFORMS_PERCENT else ""
    return f"bound {bound:,.10g}{near}"


def refuse_for_sop(context: typer.Context) -> None:
    """Raise InputError for an option given that means nothing to a bare problem."""
    refuse_others(context, ".sop", "costs, but no contours or heads")


def plan_sop(
    source: Path, output: Path | None, *, time_limit_s: float, seed: int, as_json: bool
) -> None:
    """Solve `source` and write the tour to `output`, or to X.tour beside X.sop."""
    target = output or source.with_name(re.sub(r"\.sop(\.gz)?$", "", source.name, flags=re.I))
    if output is None:
        target = target.with_name(target.name + ".tour")
    refuse_unwritable([target], source)
    refuse_two_on_stdout(output, as_json=as_json)
    seconds: dict[str, float] = {}
    with (
        interrupt_stops(at_work) as stop,
        steps(time_limit_s=time_limit_s, unit="") as progress,
    ):
        progress(Step(f"reading {source.name}"))
        started = time.perf_counter()
        instance = read_sop(source)
        seconds["read"] = time.perf_counter() - started
        progress(Step(f"searching ({len(instance)} nodes, {time_limit_s:g} s)"))
        compile_sop()
        started = time.perf_counter()
        try:
            found = solve_sop(
                instance.costs,
                instance.precedence,
                time_limit_s=time_limit_s,
                seed=seed,
                report=progress,
                stop=stop,
            )
        except InputError as error:  # it knows the nodes, not the file they came from
            raise InputError(error.what, path=source, advice=error.advice) from error
        seconds["plan"] = time.perf_counter() - started
        require_sound(instance, found)
        text = tour_text(name=instance.name, order=found.order, cost=found.cost)
        put(text, target)
    with written():
        show(source, instance, found, seconds, target, as_json=as_json)


def show(
    source: Path,
    instance: SopInstance,
    found: SopResult,
    seconds: dict[str, float],
    target: Path,
    *,
    as_json: bool,
) -> None:
    """Print the result, for a person or for a program."""
    if as_json:
        print_json(
            "decmcts-tour/1",
            {
                "input": str(source),
                "nodes": len(instance),
                "cost": found.cost,
                "bound": found.bound,
                "optimal": found.optimal,
                "found_by": found.found_by,
                "found_at_s": float(found.history[-1, 0]),
                "iterations": found.iterations,
                "seconds": {name: round(value, 3) for name, value in seconds.items()},
                "seed": found.seed,
                "verified": True,
                "written": [str(target)],
            },
        )
        return
    near = proven(found.cost, found.bound, optimal=found.optimal)
    to = err if target == STDOUT else out
    to.show(
        f"{source.name}: {len(instance)} nodes, cost {found.cost:,.10g}, {near} "
        f"({found.found_by}, {seconds['plan']:.1f} s, seed {found.seed}), verified"
    )
    to.show(f"wrote {name_of(target)}")


def refuse_for_qcsp(context: typer.Context) -> None:
    """Raise InputError for an option given that means nothing to a bare problem."""
    refuse_others(context, ".qcsp", "tasks and cranes, but no print")


def launch_qcsp(
    source: Path, output: Path | None, *, time_limit_s: float, seed: int, as_json: bool
) -> None:
    """Solve `source`, have the schedule judged and write it to `output`, if one is named."""
    refuse_unwritable([output], source)
    refuse_two_on_stdout(output, as_json=as_json)
    with (
        interrupt_stops(at_work) as stop,
        steps(time_limit_s=time_limit_s, unit="") as progress,
    ):
        progress(Step(f"reading {source.name}"))
        problem = read_qcsp(source)
        size = f"{len(problem)} tasks, {problem.cranes} cranes"
        progress(Step(f"searching ({size}, {time_limit_s:g} s)"))
        compile_qcsp(problem, stop)
        started = time.perf_counter()
        found = solve_qcsp(
            problem, time_limit_s=time_limit_s, seed=seed, report=progress, stop=stop
        )
        seconds = time.perf_counter() - started
        if faults := faults_of(problem, found.schedule):
            raise VerificationError(f"{faults[0]}; nothing was written")
        if output is not None:
            put(schedule_text(problem, found.schedule), output)
    with written():
        show_schedule(source, problem, found, seconds, output, as_json=as_json)


def show_schedule(
    source: Path,
    problem: QcspProblem,
    found: QcspResult,
    seconds: float,
    target: Path | None,
    *,
    as_json: bool,
) -> None:
    """Print the result, for a person or for a program."""
    makespan, bound = found.schedule.makespan, found.bound
    if as_json:
        print_json(
            "decmcts-schedule/1",
            {
                "input": str(source),
                "tasks": len(problem),
                "cranes": problem.cranes,
                "makespan": makespan,
                "bound": bound,
                "optimal": found.optimal,
                "found_at_s": float(found.history[-1, 0]) if len(found.history) else 0.0,
                "proposals": found.proposals,
                "seconds": {"plan": round(seconds, 3)},
                "seed": found.seed,
                "verified": True,
                "written": [] if target is None else [str(target)],
            },
        )
        return
    near = proven(makespan, bound, optimal=found.optimal)
    to = err if target == STDOUT else out
    to.show(
        f"{source.name}: {len(problem)} tasks, {problem.cranes} cranes, makespan {makespan:,.10g}, "
        f"{near} ({seconds:.1f} s, seed {found.seed}), verified"
    )
    if target is not None:
        to.show(f"wrote {name_of(target)}")
