"""`decmcts launch X.qcsp`: a bare team problem, from file to schedule."""

from __future__ import annotations

import time
from pathlib import Path

import typer

from decmcts.cli.commands.bare import proven, refuse_others
from decmcts.cli.console import err, out, print_json, steps, written
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import VerificationError
from decmcts.formats.bare.qcsp import QcspProblem, read_qcsp, schedule_text
from decmcts.jit.kernel import at_work
from decmcts.planning.bare import compile_qcsp, solve_qcsp
from decmcts.planning.events import Step
from decmcts.planning.writing.places import (
    STDOUT,
    name_of,
    put,
    refuse_two_on_stdout,
    refuse_unwritable,
)
from decmcts.team.qcsp.solver import QcspResult
from sim.qcsp import faults_of


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
        show(source, problem, found, seconds, output, as_json=as_json)


def show(
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
