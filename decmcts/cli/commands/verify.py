"""`decmcts verify`: a plan or finished files judged again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from decmcts.cli import options as opt
from decmcts.cli.console import err, out, print_json, steps
from decmcts.planning.options import Held
from decmcts.planning.verify import verify as judge
from sim.faults import Verdict
from sim.verdict_lines import checked_lines, nearest_facts


@opt.app.command()
def verify(
    result: Annotated[
        list[Path], typer.Argument(help="PLAN.json, OUT.gcode, or the files of all heads")
    ],
    source: Annotated[
        Path | None, opt.basics("--source FILE", "The G-code it was made from")
    ] = None,
    plan: Annotated[
        Path | None,
        opt.basics("--plan FILE", "Of files of several heads: the plan.json they were made from"),
    ] = None,
    machine: opt.MachineOption = None,
    plate: opt.PlateOption = None,
    process_order: opt.HeldProcessOption = None,
    quality: opt.HeldQualityOption = None,
    min_layer_time: opt.HeldCoolingOption = None,
    max_layers_ahead: opt.HeldLeadOption = None,
    freedom: opt.HeldFreedomOption = None,
    seed: opt.TimingSeedOption = 0,
    trials: Annotated[
        int, opt.search("--trials N", "Random timing trials of a joint plan", min=1, max=100_000)
    ] = 3,
    as_json: opt.JsonOption = False,
    verbose: Annotated[
        bool, opt.output("-v --verbose", "Say all rules, and where it came nearest")
    ] = False,
) -> None:
    """Replay a plan or a G-code file independently; one line a fault, exit code 1 if any.

    What was checked is said, and how near heads came to each other and to the print.
    """
    held = Held(process_order, quality, max_layers_ahead, freedom, min_layer_time)
    with steps() as progress:
        verdict = judge(
            result, source, machine, plan=plan, plate=plate, held=held, seed=seed, trials=trials,
            report=progress,
        )  # fmt: skip
    show(verdict, ", ".join(map(str, result)), as_json=as_json, verbose=verbose)
    if verdict.faults:
        raise typer.Exit(1)


def show(verdict: Verdict, names: str, *, as_json: bool, verbose: bool = False) -> None:
    """Print what was found in the files of these names, for a person or for a program."""
    if as_json:
        print_json("decmcts-verdict/1", {
            "file": names, "ok": verdict.ok, "faults": list(map(str, verdict.faults)),
            "checked": verdict.checked, "warnings": verdict.warnings, "counts": verdict.counts,
            "nearest": nearest_facts(verdict),
        })  # fmt: skip
        return
    for fault in verdict.faults:
        out.show(str(fault))
    for line in verdict.warnings:
        err.show(f"warning, as in the source: {line}")
    n = len(verdict.faults)
    state = f"{n} fault{'s' * (n > 1)}" if n else "no fault"
    for line in checked_lines(verdict, verbose=verbose):
        err.show(line)
    err.show(f"{names}: {state}")
