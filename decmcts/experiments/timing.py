"""`timing`: heads that take other times than planned: a partial order against a clock.

One joint plan is run in simulated controllers in two ways. *Waits*: as it is written, a head goes
on when another has signalled. *Clock*: it goes on at the planned time. Both get equal errors.

*Clock* is the baseline of the literature on several printing robots: a central plan that trusts its
clock. Where a head waits for another's signal it waits until the moment at which it went on when
all took the planned time. At planned times both do the same.

References
----------
Journal of Mechanical Design 145(1) 012003, 2023: decentralised against centralised
planning of several printing robots, under timing error.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from decmcts.experiments.kinds import (
    Asked,
    Experiment,
    Key,
    Line,
    Row,
    Sizes,
    column,
    curve,
    figure,
    grouped,
    markdown,
    spread,
)
from decmcts.experiments.prints import shown
from decmcts.experiments.teams import given, planned
from decmcts.planning.compiling import PRINT, TEAM
from decmcts.planning.options import Cut
from decmcts.print.plan import PlanDocument
from sim.controllers.carry_out import Run
from sim.controllers.from_plan import programs_of_plan
from sim.controllers.program import HeadProgram, StopKind, Stops
from sim.controllers.simulate import Simulation, simulate
from sim.controllers.timing import Timing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ERRORS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)  # of the time
KINDS = (Timing.UNIFORM, Timing.DRIFT)
MADE = ("row-4-20-5", "strewn-9-12-3", "row-1-90-0")
DRAWS = Sizes(5, 100)
PLANNED = ("print", "folder", "seconds", "iterations", "seed")  # what a plan depends on


def _runs(asked: Asked) -> Iterator[tuple[Any, ...]]:
    for name in asked.prints or MADE:
        for timing in KINDS:
            for error in ERRORS:
                draws = 1 if error == 0.0 else int(DRAWS[asked.full])
                yield name, timing.value, error, draws


@lru_cache(maxsize=1)
def _plan(*of: str | float) -> PlanDocument:
    """Return the joint plan of `PLANNED`; runs of one print in a process have the same."""
    key = dict(zip(PLANNED, of, strict=True))
    return planned(given(key, 2, 300.0, Cut.INSIDE), key)


def _run(key: Key) -> Row:
    document = _plan(*(key.get(name, "") for name in PLANNED))
    programs = programs_of_plan(document)
    run = partial(
        simulate, machine=document.machine, timing=Timing(key["timing"]),
        size=float(key["error_share"]), trials=int(key["draws"]), seed=int(key["seed"]),
    )  # fmt: skip
    waits = run(programs)
    clock = run(by_the_clock(programs, waits.run))
    shared = {"contours": len(document.contours), "planned_s": round(waits.makespan_s, 1)}
    return shared | _figures("waits", waits, waits) | _figures("clock", clock, waits)


def _figures(name: str, found: Simulation, calm: Simulation) -> Row:
    """Return what is counted over the draws of one way to run the plan."""
    trials = found.trials[1:]
    gap = min(near.gap_mm for trial in trials for near in trial.near)
    longer = statistics.median(trial.makespan_s / calm.makespan_s for trial in trials)
    return {
        f"{name}_collided": sum(bool(trial.contacts) for trial in trials),
        f"{name}_contacts": sum(len(trial.contacts) for trial in trials),
        f"{name}_least_mm": round(gap, 3),
        f"{name}_longer": round(longer, 4),
    }


def _tables(rows: Sequence[Line]) -> str:
    lines = [
        [timing, f"{100.0 * float(error):g} %", name, f"{sum(column(mine, 'draws')):.0f}",
         f"{sum(column(mine, f'{name}_collided')):.0f}",
         f"{sum(column(mine, f'{name}_contacts')):.0f}",
         f"{min(column(mine, f'{name}_least_mm')):.2f}",
         spread(column(mine, f"{name}_longer"), 3)]
        for (timing, error), mine in grouped(rows, "timing", "error_share").items()
        for name in ("waits", "clock")
    ]  # fmt: skip
    prints = ", ".join(dict.fromkeys(shown(row["print"]) for row in rows))
    return f"Prints: {prints}.\n\n" + markdown(
        lines,
        ["errors", "size", "run by", "runs", "collided", "contacts", "nearest mm",
         "print time ÷ planned"],
    )  # fmt: skip


def _draw(rows: Sequence[Line]) -> Figure:
    made, axes = figure(2)
    fine = [
        {**row, "percent": str(100.0 * float(row["error_share"])),
         **{f"{n}_share": str(100.0 * float(row[f"{n}_collided"]) / float(row["draws"]))
            for n in ("waits", "clock")}}
        for row in rows if not row["error"]
    ]  # fmt: skip
    for name in ("waits", "clock"):
        for (timing,), mine in grouped(fine, "timing").items():
            style = "o-" if timing == "uniform" else "s--"
            label = f"{name}, {timing}"
            curve(axes[0], mine, "percent", f"{name}_share", label, style, middle=statistics.mean)
            curve(axes[1], mine, "percent", f"{name}_longer", label, style)
    axes[0].set(xlabel="error of time, %", ylabel="runs in which heads collide, %, mean of prints")
    axes[1].set(xlabel="error of time, %", ylabel="print time ÷ planned")
    for axis in axes:
        axis.legend(fontsize=8)
    return made


TIMING = Experiment(
    "timing",
    "Heads take other times than planned: who collides, a partial order or a clock?",
    ("print", "timing", "error_share", "draws"), _runs, _run, _tables, _draw,
    Sizes(1.5, 20.0), Sizes(1, 5), (PRINT, TEAM),
)  # fmt: skip


def by_the_clock(programs: Sequence[HeadProgram], planned: Run) -> tuple[HeadProgram, ...]:
    """Return programs without signals between heads.

    Each head starts a clock of its own when it begins, as a signal that only it waits for.
    `planned` is how the programs are carried out without errors of time.
    """
    given = _given(programs, planned)
    return tuple(
        replace(program, stops=_timed(program.stops, planned, h, given))
        for h, program in enumerate(programs)
    )


def _given(programs: Sequence[HeadProgram], planned: Run) -> dict[int, float]:
    """Return when each signal is given."""
    found = {}
    for program, run in zip(programs, planned.heads, strict=True):
        kinds = np.isin(program.stops.kind, (StopKind.SIGNAL, StopKind.PASS))
        for j in np.flatnonzero(kinds).tolist():
            found[int(program.stops.number[j])] = float(run.reached[j])
    return found


def _timed(stops: Stops, planned: Run, h: int, given: dict[int, float]) -> Stops:
    """Return the stops of one head; `value` of a wait becomes when it went on."""
    value, number = stops.value.copy(), stops.number.copy()
    for j in np.flatnonzero(stops.kind == StopKind.WAIT).tolist():
        ready = given[int(number[j])] + value[j]
        number[j], value[j] = h, max(ready, float(planned.heads[h].reached[j]))
    kind = stops.kind.copy()
    number[kind != StopKind.WAIT] = len(planned.heads)  # nobody waits for it
    return Stops(
        np.concatenate([[0], stops.before]), np.concatenate([[StopKind.PASS], kind]),
        np.concatenate([[h], number]), np.concatenate([[0.0], value]),
    )  # fmt: skip
