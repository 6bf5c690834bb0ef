"""`timing`: heads that take other times than planned: a partial order against a clock.

One joint plan is run in simulated controllers in two ways. *Waits*: as it is written, a head goes
on when another has signalled. *Clock*: it goes on at the planned time. Both get equal errors.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from functools import lru_cache, partial

from matplotlib.figure import Figure

from decmcts.experiments.kinds import Asked, Experiment, Key, Row, Sizes
from decmcts.experiments.pictures import curve, figure
from decmcts.experiments.prints import shown
from decmcts.experiments.rows import Line, column, grouped, markdown, spread
from decmcts.experiments.teams import given, planned
from decmcts.experiments.two_heads import machine_for
from decmcts.planning.compiling.parts import PRINT, TEAM
from decmcts.planning.options import Cut
from decmcts.print.plan import PlanDocument
from sim.controllers.from_plan import programs_of_plan
from sim.controllers.simulate import Simulation, simulate
from sim.controllers.timing import Timing
from sim.experiments.by_the_clock import by_the_clock

ERRORS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)  # of the time
KINDS = (Timing.UNIFORM, Timing.DRIFT)
MADE = ("row-4-20-5", "strewn-9-12-3", "row-1-90-0")
DRAWS = Sizes(5, 100)
PLANNED = ("print", "folder", "seconds", "iterations", "seed")  # what a plan depends on


def _runs(asked: Asked) -> Iterator[Key]:
    for name in asked.prints or MADE:
        for timing in KINDS:
            for error in ERRORS:
                draws = 1 if error == 0.0 else int(DRAWS[asked.full])
                yield {"print": name, "timing": timing.value, "error_share": error, "draws": draws}


@lru_cache(maxsize=1)
def _plan(*of: str | float) -> PlanDocument:
    """Return the joint plan of `PLANNED`; runs of one print in a process have the same."""
    key = dict(zip(PLANNED, of, strict=True))
    machine, middle = machine_for(key, 2, 300.0)
    what = given(key, machine, Cut.INSIDE, middle=middle)
    return planned(what, key)[0]


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
