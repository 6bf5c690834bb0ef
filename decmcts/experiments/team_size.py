"""`team-size`: one to eight heads along one rail, the machine made by code."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
from decmcts.experiments.prints import shown
from decmcts.experiments.teams import (
    COLUMNS,
    against_one_head,
    alone_s,
    columns_of,
    given,
    planned,
)
from decmcts.experiments.two_heads import machine_for
from decmcts.planning.compiling.parts import PRINT, TEAM
from decmcts.planning.options import Cut

BED_MM = 1000.0
SMALL, FULL = (1, 2, 3, 4, 6, 8), range(1, 9)
MADE = (("row-12-30-25", Cut.NONE), ("row-1-250-0", Cut.ALL))


def _runs(asked: Asked) -> Iterator[Key]:
    own = [(name, Cut.ALL) for name in asked.prints]
    for name, cut in own or MADE:
        for heads in FULL if asked.full else SMALL:
            yield {"print": name, "cut": cut.value, "heads": heads}


def _run(key: Key) -> Row:
    heads = int(key["heads"])
    machine, middle = machine_for(key, max(2, heads), BED_MM)
    cut = Cut(key["cut"]) if heads > 1 else Cut.NONE
    what = given(key, machine, cut, middle=middle)
    if heads == 1:
        one_s = round(alone_s(what, key), 2)
        return {"contours": len(what.whole.job.contours), "makespan_s": one_s,
                "one_head_s": one_s, "speedup": 1.0, "most": 1.0, "waits": 0.0,
                "idle": 0.0}  # fmt: skip
    document = planned(what, key)
    return against_one_head(what, document, key)


def _tables(rows: Sequence[Line]) -> str:
    lines = [
        [shown(name), cut, heads, spread(column(mine, "makespan_s"), 0),
         *columns_of(mine)]
        for (name, cut, heads), mine in grouped(rows, "print", "cut", "heads").items()
    ]  # fmt: skip
    return markdown(lines, ["print", "cut", "heads", "print time s", *COLUMNS])


def _draw(rows: Sequence[Line]) -> Figure:
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
    ("print", "cut", "heads"), _runs, _run, _tables, _draw,
    Sizes(3.0, 60.0), Sizes(1, 3), (PRINT, TEAM),
)  # fmt: skip
