"""`two-heads` and `team-size`: how much sooner several heads are done than one.

`two-heads` asks by what there is to print. `team-size` has one to eight heads along one rail, the
machine made by code.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

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
    stopping_of,
)
from decmcts.experiments.prints import shown
from decmcts.experiments.teams import Given, figures, given, planned
from decmcts.planning.compiling import PRINT, TEAM
from decmcts.planning.options import Cut
from decmcts.planning.problem.planned import source_plan
from decmcts.planning.team.pipeline import lags_of
from decmcts.search.planners import plan_order
from decmcts.search.sequence.problem import OrderProblem
from decmcts.team.engine.alone import lone_machine
from decmcts.team.schedule.joint_plan import schedule

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = ["times as fast", "at most", "waits %", "done early %"]
STEPS = 20_000  # of one head's annealing for each round of a team
BED_MM = 600.0  # for prints made by code, so that they may be far apart
COUNTS, SIZES_MM, GAPS_MM = (1, 2, 4), (15, 50, 120), (5, 40, 100)
FULL = (1, 2, 3, 4, 6), (10, 20, 40, 80, 160), (5, 15, 30, 60, 100)
_ROW = re.compile(r"row-(?P<count>\d+)-(?P<size>\d+)-(?P<gap>\d+)")

LONG_MM = 1000.0  # for many heads
SOME_HEADS, ALL_HEADS = (1, 2, 3, 4, 6, 8), range(1, 9)
SHARED = (("row-12-30-25", Cut.NONE), ("row-1-250-0", Cut.ALL))


def _alone_s(what: Given, key: Key) -> float:
    """Return how long one head takes that reaches everything, in the best order annealing finds."""
    whole = what.whole
    machine = lone_machine(whole.machine)
    order = plan_order(
        OrderProblem.from_job(whole.job, whole.graph, whole.rules.freedom.value),
        planner="local", stopping=stopping_of(key, STEPS), seed=int(key["seed"]),
        clock=time.process_time,
    )  # fmt: skip
    lags = what.lags if what.problem.whole is None else lags_of(whole, source_plan(whole))
    plan = schedule(whole.job, machine, whole.graph, [order.toolpath], lags=lags)
    return plan.makespan_s


def _against_one_head(what: Given, key: Key) -> Row:
    """Return the figures of a team's plan, and how much sooner it ends than one head alone."""
    row, one_s = figures(what, planned(what, key)), _alone_s(what, key)
    return {
        **row,
        "one_head_s": round(one_s, 2),
        "speedup": round(one_s / row["makespan_s"], 4),
        "most": round(one_s / row["bound_s"], 4),
    }


def _columns(rows: Sequence[Line]) -> list[str]:
    """Return the columns `COLUMNS` of a table for rows of `_against_one_head`."""
    return [
        spread(column(rows, "speedup"), 2), spread(column(rows, "most"), 2),
        *(spread([100.0 * v for v in column(rows, name)], 1) for name in ("waits", "idle")),
    ]  # fmt: skip


def _runs_of_two(asked: Asked) -> Iterator[tuple[Any, ...]]:
    counts, sizes, gaps = FULL if asked.full else (COUNTS, SIZES_MM, GAPS_MM)
    made = [
        f"row-{count}-{size}-{gap if count > 1 else 0}"
        for count, size, gap in product(counts, sizes, gaps)
        if count * (size + gap + 8) < BED_MM - 60.0
    ]
    for name in dict.fromkeys(asked.prints or made):
        for cut in (Cut.NONE, Cut.INSIDE):
            yield name, cut.value


def _run_of_two(key: Key) -> Row:
    what = given(key, 2, BED_MM, Cut(key["cut"]))
    return _against_one_head(what, key) | {"pieces": len(what.problem.job.contours)}


def _tables_of_two(rows: Sequence[Line]) -> str:
    lines = [
        [shown(name), cut, mine[0]["contours"], spread(column(mine, "one_head_s"), 0),
         *_columns(mine)]
        for (name, cut), mine in grouped(rows, "print", "cut").items()
    ]  # fmt: skip
    return markdown(lines, ["print", "cut", "contours", "one head s", *COLUMNS])


def _draw_of_two(rows: Sequence[Line]) -> Figure:
    made, axes = figure(3)
    fine = [row for row in rows if not row["error"]]
    for axis, cut in zip(axes, ("none", "inside"), strict=False):
        mine = [{**row, **_of_row(row["print"])} for row in fine if row["cut"] == cut]
        for (count, size), of in grouped(mine, "count", "size").items():
            if count:
                curve(axis, of, "gap", "speedup", f"{count} of {size} mm")
        axis.set(xlabel="distance of parts, mm", ylabel="times as fast", title=f"cut {cut}")
        axis.set_ylim(0.9, 2.1)
        axes[2].plot(
            [100.0 * (float(row["waits"]) + float(row["idle"])) for row in mine],
            column(mine, "speedup"), "os"[cut == "inside"], alpha=0.6, label=f"cut {cut}",
        )  # fmt: skip
    axes[2].set(xlabel="heads wait or are done, % of their time", ylabel="times as fast")
    for axis in axes:
        if axis.get_legend_handles_labels()[0]:
            axis.legend(fontsize=7)
    return made


def _of_row(name: str) -> Line:
    """Return number, size and distance of the parts of a row; nothing for other prints."""
    of_row = _ROW.fullmatch(name)
    return of_row.groupdict() if of_row else {"count": "", "size": "", "gap": ""}


TWO_HEADS = Experiment(
    "two-heads",
    "How much sooner are two heads done than one, by size, number and distance of parts?",
    ("print", "cut"), _runs_of_two, _run_of_two, _tables_of_two, _draw_of_two,
    Sizes(1.5, 20.0), Sizes(1, 5), (PRINT, TEAM),
)  # fmt: skip


def _runs_of_many(asked: Asked) -> Iterator[tuple[Any, ...]]:
    own = [(name, Cut.ALL) for name in asked.prints]
    for name, cut in own or SHARED:
        for heads in ALL_HEADS if asked.full else SOME_HEADS:
            yield name, cut.value, heads


def _run_of_many(key: Key) -> Row:
    heads = int(key["heads"])
    cut = Cut(key["cut"]) if heads > 1 else Cut.NONE
    what = given(key, max(2, heads), LONG_MM, cut)
    if heads == 1:
        one_s = round(_alone_s(what, key), 2)
        return {"contours": len(what.whole.job.contours), "makespan_s": one_s,
                "one_head_s": one_s, "speedup": 1.0, "most": 1.0, "waits": 0.0,
                "idle": 0.0}  # fmt: skip
    return _against_one_head(what, key)


def _tables_of_many(rows: Sequence[Line]) -> str:
    lines = [
        [shown(name), cut, heads, spread(column(mine, "makespan_s"), 0),
         *_columns(mine)]
        for (name, cut, heads), mine in grouped(rows, "print", "cut", "heads").items()
    ]  # fmt: skip
    return markdown(lines, ["print", "cut", "heads", "print time s", *COLUMNS])


def _draw_of_many(rows: Sequence[Line]) -> Figure:
    made, axes = figure(2)
    for (name,), mine in grouped(rows, "print").items():
        curve(axes[0], mine, "heads", "speedup", shown(name))
        curve(axes[0], mine, "heads", "most", f"at most, {shown(name)}", ":")
        curve(axes[1], mine, "heads", "waits", f"waits, {shown(name)}")
        curve(axes[1], mine, "heads", "idle", f"done early, {shown(name)}", "s--")
    axes[0].set(xlabel="heads", ylabel="times as fast as one head")
    axes[1].set(xlabel="heads", ylabel="share of the heads' time")
    for axis in axes:
        axis.legend(fontsize=8)
    return made


TEAM_SIZE = Experiment(
    "team-size",
    "How much sooner are one to eight heads along a rail done?",
    ("print", "cut", "heads"), _runs_of_many, _run_of_many, _tables_of_many, _draw_of_many,
    Sizes(3.0, 60.0), Sizes(1, 3), (PRINT, TEAM),
)  # fmt: skip
