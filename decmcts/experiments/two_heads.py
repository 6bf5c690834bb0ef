"""`two-heads`: how much sooner two heads are done than one, by what there is to print."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import product

from matplotlib.figure import Figure

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
from decmcts.experiments.prints import Point, is_own, shown
from decmcts.experiments.teams import COLUMNS, against_one_head, columns_of, given, planned
from decmcts.formats.machines.machine_file import load_machine, rail_machine
from decmcts.planning.compiling.parts import PRINT, TEAM
from decmcts.planning.options import Cut
from decmcts.print.machine import Machine

BED_MM = 600.0  # for prints made by code, so that they may be far apart
COUNTS, SIZES_MM, GAPS_MM = (1, 2, 4), (15, 50, 120), (5, 40, 100)
FULL = (1, 2, 3, 4, 6), (10, 20, 40, 80, 160), (5, 15, 30, 60, 100)
_ROW = re.compile(r"row-(?P<count>\d+)-(?P<size>\d+)-(?P<gap>\d+)")


def _runs(asked: Asked) -> Iterator[Key]:
    counts, sizes, gaps = FULL if asked.full else (COUNTS, SIZES_MM, GAPS_MM)
    made = [
        f"row-{count}-{size}-{gap if count > 1 else 0}"
        for count, size, gap in product(counts, sizes, gaps)
        if count * (size + gap + 8) < BED_MM - 60.0
    ]
    for name in dict.fromkeys(asked.prints or made):
        for cut in (Cut.NONE, Cut.INSIDE):
            yield {"print": name, "cut": cut.value}


def machine_for(key: Key, heads: int, length_mm: float = BED_MM) -> tuple[Machine, Point]:
    """Return a machine with so many heads in a row, and where prints made by code lie on it.

    For one's own prints of two heads it is `dual-gantry` as it is.
    """
    pair = load_machine("dual-gantry")
    middle = length_mm / 2.0, (pair.bed_min[1] + pair.bed_max[1]) / 2.0
    own = is_own(key) and heads == 2
    return pair if own else rail_machine(pair, heads, length_mm), middle


def _run(key: Key) -> Row:
    machine, middle = machine_for(key, 2)
    what = given(key, machine, Cut(key["cut"]), middle=middle)
    document = planned(what, key)
    return {
        **against_one_head(what, document, key), "pieces": len(what.problem.job.contours),
    }  # fmt: skip


def _tables(rows: Sequence[Line]) -> str:
    lines = [
        [shown(name), cut, mine[0]["contours"], spread(column(mine, "one_head_s"), 0),
         *columns_of(mine)]
        for (name, cut), mine in grouped(rows, "print", "cut").items()
    ]  # fmt: skip
    return markdown(lines, ["print", "cut", "contours", "one head s", *COLUMNS])


def _draw(rows: Sequence[Line]) -> Figure:
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
    ("print", "cut"), _runs, _run, _tables, _draw, Sizes(1.5, 20.0), Sizes(1, 5), (PRINT, TEAM),
)  # fmt: skip
