"""Bare problems from file to result: `decmcts plan X.sop`, `decmcts launch X.qcsp`."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

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


class BareKind(NamedTuple):
    """What is particular to one kind of problem."""

    suffix: str
    has: str  # what there is in such a file, and what is not
    schema: str
    read: Callable[[Path], Any]
    compile: Callable[..., None]  # (problem, stop)
    solve: Callable[..., Any]  # (problem, *, time_limit_s, seed, report, stop)
    text: Callable[..., bytes]  # (problem, result) as a file; VerificationError for a wrong result
    size: Callable[[Any], dict[str, int]]
    cost: Callable[[Any], dict[str, float]]  # of a result
    search: Callable[[Any], dict[str, Any]]  # of a result: how it was found


def _tour(instance: SopInstance, found: SopResult) -> bytes:
    require_sound(instance, found)
    return tour_text(name=instance.name, order=found.order, cost=found.cost)


def _schedule(problem: QcspProblem, found: QcspResult) -> bytes:
    if faults := faults_of(problem, found.schedule):
        raise VerificationError(f"{faults[0]}; nothing was written")
    return schedule_text(problem, found.schedule)


SOP = BareKind(
    ".sop", "costs, but no contours or heads", "decmcts-tour/1", read_sop,
    lambda _problem, _stop: compile_sop(),
    lambda problem, **how: solve_sop(problem.costs, problem.precedence, **how),
    _tour,
    lambda problem: {"nodes": len(problem)},
    lambda found: {"cost": found.cost},
    lambda found: {"found_by": found.found_by, "iterations": found.iterations},
)  # fmt: skip
QCSP = BareKind(
    ".qcsp", "tasks and cranes, but no print", "decmcts-schedule/1", read_qcsp, compile_qcsp,
    solve_qcsp, _schedule,
    lambda problem: {"tasks": len(problem), "cranes": problem.cranes},
    lambda found: {"makespan": found.schedule.makespan},
    lambda found: {"proposals": found.proposals},
)  # fmt: skip


def solve(
    context: typer.Context, kind: BareKind, source: Path, output: Path | None, *,
    time_limit_s: float, seed: int, as_json: bool,
) -> None:  # fmt: skip
    """Solve `source`, have the result judged, and write it: of X.sop without `output` to X.tour."""
    _refuse_others(context, kind)
    target = output
    if output is None and kind is SOP:
        target = source.with_name(re.sub(r"\.sop(\.gz)?$", "", source.name, flags=re.I) + ".tour")
    refuse_unwritable([target], source)
    refuse_two_on_stdout(output, as_json=as_json)
    with interrupt_stops(at_work) as stop, steps(time_limit_s=time_limit_s, unit="") as progress:
        progress(Step(f"reading {source.name}"))
        began = time.perf_counter()
        problem = kind.read(source)
        read_s, size = time.perf_counter() - began, kind.size(problem)
        progress(Step(f"searching ({_counted(size)}, {time_limit_s:g} s)"))
        kind.compile(problem, stop)
        began = time.perf_counter()
        try:
            found = kind.solve(
                problem, time_limit_s=time_limit_s, seed=seed, report=progress, stop=stop
            )
        except InputError as error:  # it knows the nodes, not the file they came from
            raise InputError(error.what, path=source, advice=error.advice) from error
        plan_s = time.perf_counter() - began
        text = kind.text(problem, found)
        if target is not None:
            put(text, target)
    with written():
        if as_json:
            print_json(kind.schema, {
                "input": str(source), **size, **kind.cost(found), "bound": found.bound,
                "optimal": found.optimal, **kind.search(found),
                "found_at_s": float(found.history[-1, 0]) if len(found.history) else 0.0,
                "seconds": {"read": round(read_s, 3), "plan": round(plan_s, 3)},
                "seed": found.seed, "verified": True,
                "written": [] if target is None else [str(target)],
            })  # fmt: skip
        else:
            _show(kind, source, size, found, plan_s, target)


def _refuse_others(context: typer.Context, kind: BareKind) -> None:
    """Raise InputError for an option given that means nothing to a file of this kind."""
    for name, spellings in given(context).items():
        if name not in _MEANT:
            spelled = spellings[0 if context.params[name] else -1]
            raise InputError(
                f"{spelled} means nothing for a {kind.suffix} file: it has {kind.has}",
                advice="leave it out",
            )


def _show(
    kind: BareKind, source: Path, size: dict[str, int], found: Any, plan_s: float,
    target: Path | None,
) -> None:  # fmt: skip
    """Print the result for a person."""
    ((what, value),) = kind.cost(found).items()
    how = [kind.search(found).get("found_by"), f"{plan_s:.1f} s", f"seed {found.seed}"]
    to = err if target == STDOUT else out
    to.show(
        f"{source.name}: {_counted(size)}, {what} {value:,.10g}, "
        f"{_proven(value, found.bound, optimal=found.optimal)} "
        f"({', '.join(filter(None, how))}), verified",
        None if target is None else f"wrote {name_of(target)}",
    )


def _counted(size: dict[str, int]) -> str:
    return ", ".join(f"{count} {what}" for what, count in size.items())


def _proven(value: float, bound: float, *, optimal: bool) -> str:
    """Return in words how near to the best possible a cost or makespan is."""
    if optimal:
        return "proven optimal"
    gap = 100.0 * (value / bound - 1.0) if bound > 0.0 else math.inf
    near = f", at most {gap:.1f} % above optimal" if gap <= INFORMS_PERCENT else ""
    return f"bound {bound:,.10g}{near}"
