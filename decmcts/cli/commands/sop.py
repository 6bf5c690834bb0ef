"""`decmcts plan X.sop`: a bare sequential ordering problem, from file to tour."""

from __future__ import annotations

import re
import time
from pathlib import Path

import typer

from decmcts.cli.commands.bare import proven, refuse_others
from decmcts.cli.console import err, out, print_json, steps, written
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import InputError
from decmcts.formats.bare.sop import SopInstance, read_sop, tour_text
from decmcts.jit.kernel import at_work
from decmcts.planning.bare import compile_sop, require_sound, solve_sop
from decmcts.planning.events import Step
from decmcts.planning.writing.places import (
    STDOUT,
    name_of,
    put,
    refuse_two_on_stdout,
    refuse_unwritable,
)
from decmcts.search.sop.solver import SopResult


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
