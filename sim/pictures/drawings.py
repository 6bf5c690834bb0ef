"""Pictures of plans, PNG or SVG: what changed, who prints what, and what each head does when.

Three questions are answered on one sheet. Which travels of a layer are gone, and which are new?
In which layers is travel saved? Of several heads: what does each print, and when does it
print, travel or wait? Nothing is judged here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from scipy.ndimage import maximum_filter

from decmcts.arrays import Floats, Ints
from decmcts.print.metrics import compared_order
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.pictures.canvas import head_colour, save, words_as_they_are
from sim.pictures.charts import draw_layers, draw_times, title_lines
from sim.pictures.layer_travels import (
    by_layer,
    in_no_place_of,
    layers_of,
    most_changed,
    require_layer,
    travels_of,
)
from sim.pictures.layer_view import (
    SHADOW,
    LayerView,
    draw_layer,
    draw_pieces,
    legend_of,
)

NAMED = 3  # heads whose shares have room in a title
STYLE: Any = {
    "axes.labelsize": 8.5, "axes.titlesize": 9.5, "axes.titlelocation": "left",
    "xtick.labelsize": 8, "ytick.labelsize": 8, "legend.fontsize": 8, "legend.frameon": False,
}  # fmt: skip


@words_as_they_are(**STYLE)
def draw_plan(
    path: Path | str,
    before: PlanDocument,
    after: PlanDocument,
    *,
    name: str = "",
    layer: int | None = None,
) -> None:
    """Draw what changed between two plans.

    Parameters
    ----------
    path : file to write, SVG where it ends so
    before, after : the source's own order and the plan
    name : of the source's file, for the title
    layer : from 1, the layer whose travels are drawn; None: where travel changed most

    Raises
    ------
    InputError
        For a layer the print has not.
    """
    require_layer(layer, after.contours)
    views, lengths = _views(before, after, layer)
    first, heads = compared_order(before.metrics), len(after.plan.heads)
    sheet = sheet_of(_extent(before, after), heads)
    figure = Figure(figsize=sheet.size)
    title, under = title_lines(name, before, after)
    figure.text(sheet.left, 1.0 - 0.32 / sheet.size[1], title, fontsize=13, fontweight="bold")
    figure.text(sheet.left, 1.0 - 0.58 / sheet.size[1], under, fontsize=9.5)
    grids = bead_grids(after, (0, 1), sheet.extent)
    for k, view in enumerate(views):
        axis = _view_axis(figure, sheet, k)
        _show(axis, grids, [SHADOW] * heads, sheet.extent)  # the whole print, hardly seen
        draw_layer(axis, view, gone=k == 0, inch_a_mm=sheet.inch_a_mm)
        axis.set_title(f"{'after' if k else first}: {_counted(view)}")
    figure.legend(
        handles=legend_of(views), loc="upper left", ncols=ENTRIES, columnspacing=1.1,
        bbox_to_anchor=(sheet.left - 0.01, sheet.legend), handlelength=1.4,
    )  # fmt: skip
    draw_layers(figure.add_axes(sheet.chart), lengths, views[0].row, first)
    if heads > 1:
        _draw_shares(figure, sheet, views[1], grids)
        draw_times(figure.add_axes(sheet.times), after)
    save(figure, path)


def _views(
    before: PlanDocument, after: PlanDocument, layer: int | None
) -> tuple[tuple[LayerView, LayerView], tuple[Floats, Floats]]:
    """Return the layer to draw of both plans, and the travel to each layer, mm."""
    layers, _ = layers_of(after)
    was, now = travels_of(before), travels_of(after)
    lengths = by_layer(was, len(layers)), by_layer(now, len(layers))
    row = most_changed(*lengths) if layer is None else layer - 1
    number = int(layers[row])
    return (
        LayerView(before, was, in_no_place_of(was.ends, now.ends), number, row),
        LayerView(after, now, in_no_place_of(now.ends, was.ends), number, row),
    ), lengths


def _extent(before: PlanDocument, after: PlanDocument) -> Floats:
    """Return the box all printing fits in, with a margin, (2, 3) mm."""
    points = np.concatenate([d.contours.points for d in (before, after)])
    if not len(points):
        return np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * float((high - low)[:2].max()) + 1.0
    low[2], above = min(low[2], 0.0), np.array([margin, margin, 0.06 * float(high[2]) + 0.2])
    return np.array([low - [margin, margin, 0.0], high + above])


def _view_axis(figure: Figure, sheet: Sheet, column: int) -> Any:
    axis = figure.add_axes(sheet.views[column])
    axis.set_xlim(*sheet.extent[:, 0].tolist())
    axis.set_ylim(*sheet.extent[:, 1].tolist())
    axis.tick_params(labelleft=column == 0)
    axis.set_xlabel("x, mm")
    if column == 0:
        axis.set_ylabel("y, mm")
    return axis


def _show(axis: Any, grids: Floats, colours: list[str], extent: Floats, up: int = 1) -> None:
    """Show `bead_grids` in a colour a head; `up` is the coordinate that goes up."""
    axis.imshow(
        striped(grids, colours), origin="lower", extent=extent[:, [0, up]].T.ravel(),
        aspect="auto", interpolation="nearest",
    )  # fmt: skip


def _counted(view: LayerView) -> str:
    """Return which layer it is, how many travels lead to it, and how long they are."""
    layers, heights = layers_of(view.document)
    rows = view.rows
    n, length = len(rows), float(view.travels.length_mm[rows].sum())
    return (
        f"layer {view.row + 1} of {len(layers)}, z {heights[view.row]:g} mm\n"
        f"{n:,} travel{'s' * (n != 1)} to it, {length:,.0f} mm"
    )


def _draw_shares(figure: Figure, sheet: Sheet, view: LayerView, grids: Floats) -> None:
    """Draw what each head prints, from above and from the front.

    Of a cut print from above the pieces of the layer, of any other all layers.
    """
    after, heads = view.document, view.document.plan.heads
    colours = [head_colour(k, len(heads)) for k in range(len(heads))]
    axis = _view_axis(figure, sheet, 2)
    handles: list[Any]
    handles = [Patch(color=c, label=h.head) for c, h in zip(colours, heads, strict=True)]
    if after.contours.of is None:
        _show(axis, grids, colours, sheet.extent)
        of_layers = "all layers"
    else:
        handles.append(draw_pieces(axis, after, view.layer, inch_a_mm=sheet.inch_a_mm))
        of_layers = f"layer {view.row + 1}, piece by piece"
    axis.set_title(f"who prints what: {of_layers}\n{_who(after)}")
    if ((grids > 0.0).sum(axis=0) > 1).any():
        stripes: Any = {"fc": colours[0], "ec": colours[1], "hatch": "////", "lw": 0}
        handles.append(Patch(label="striped: several", **stripes))
    figure.legend(
        handles=handles, loc="upper left", ncols=4,
        bbox_to_anchor=(sheet.views[2][0] - 0.01, sheet.legend),
    )  # fmt: skip
    side = figure.add_axes(sheet.side)
    _show(side, bead_grids(after, (0, 2), sheet.extent), colours, sheet.extent, up=2)
    side.set_title("all layers from the front", fontsize=8.5)
    side.set_xlabel("x, mm")
    side.set_ylabel("z, mm")


def _who(after: PlanDocument) -> str:
    """Return the heads' shares of the time spent printing."""
    printing = [
        float((h.end_s - h.begin_s)[h.kind == ActionKind.PRINT].sum()) for h in after.plan.heads
    ]  # fmt: skip
    total = max(sum(printing), 1e-12)
    if len(printing) > NAMED:
        least, most = (100 * part / total for part in (min(printing), max(printing)))
        return f"{len(printing)} heads, each {least:.0f} to {most:.0f} % of the printing"
    parts = zip(after.plan.heads, printing, strict=True)
    return ", ".join(f"{h.head} {100 * p / total:.0f} %" for h, p in parts) + " of the printing"


CELLS = 700  # along the longer side
STRIPES = 16  # cells, of all heads' stripes together
CHUNK = 2_000_000  # samples at a time
LEAST_MM = 1e-3  # of a segment: dots go nowhere, and are seen all the same


def bead_grids(
    document: PlanDocument, axes: tuple[int, int], extent: Floats, *, cells: int = CELLS
) -> Floats:
    """Return how much bead of each head lies in each cell, (heads, rows, columns) mm.

    `axes` are the coordinates across and up; `extent` is the box looked at, (2, 3). Each bead
    is as wide as it is, seen from above. From the side it fills the layer below the nozzle.
    """
    low, high = extent[:, list(axes)]
    size = np.full(2, float((high - low).max() / cells))
    wide = float(np.median(document.contours.width)) if len(document.contours) else 0.4
    tall = float(np.median(document.contours.height)) if len(document.contours) else 0.2
    reach, drop = np.array([wide, wide]), 0.0
    if axes[1] == 2:  # as many rows as layers can be told apart in
        size = (high - low) / [cells, 200.0]
        reach, drop = np.array([wide, tall]), tall / 2
    shape = np.maximum(1, np.ceil((high - low) / size)).astype(np.int64)
    columns, rows = (np.ceil(reach / size).astype(int) + 1).tolist()
    grids = [
        maximum_filter(
            _samples(actions, axes, low, size, shape, drop), size=(rows, columns), mode="constant"
        )
        for actions in document.plan.heads
    ]
    return np.array(grids).reshape(-1, shape[1], shape[0])


def _samples(
    actions: HeadActions, axes: tuple[int, int], low: Floats, size: Floats, shape: Ints, drop: float
) -> Floats:
    """Return the length of a head's printing in each cell, (rows, columns) mm."""
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    rows = np.flatnonzero((owner[1:] == owner[:-1]) & (actions.kind[owner[1:]] == ActionKind.PRINT))
    flat = actions.path[:, list(axes)]
    a, b = flat[rows], flat[rows + 1]
    length = np.linalg.norm(actions.path[rows + 1] - actions.path[rows], axis=1)
    length = np.maximum(length, LEAST_MM)
    count = np.maximum(1, np.ceil(np.abs((b - a) / size).max(axis=1, initial=0.0))).astype(np.int64)
    grid = np.zeros(int(shape.prod()))
    ends = np.cumsum(count)
    cuts = np.searchsorted(ends, np.arange(CHUNK, int(ends[-1]) if len(ends) else 0, CHUNK))
    for part in np.split(np.arange(len(rows)), cuts):
        which = np.repeat(part, count[part])
        within = np.arange(len(which)) - np.repeat(
            np.cumsum(count[part]) - count[part], count[part]
        )
        share = (within + 0.5) / count[which]
        at = a[which] + share[:, None] * (b - a)[which]
        at[:, 1] -= drop
        cell = ((at - low) / size).astype(np.int64)
        sound = ((cell >= 0) & (cell < shape)).all(axis=1)
        number = cell[sound, 1] * shape[0] + cell[sound, 0]
        grid += np.bincount(number, (length / count)[which[sound]], len(grid))
    return grid.reshape(shape[1], shape[0])


def striped(grids: Floats, colours: list[str]) -> Floats:
    """Return the picture of grids, RGBA: cells of several heads are striped by their shares.

    So each colour in it is that of one head, however many heads have printed there.
    """
    total = grids.sum(axis=0)
    share = grids / np.maximum(total, 1e-12)
    rows, columns = np.indices(total.shape)
    phase = (rows + columns) % STRIPES / STRIPES + 0.5 / STRIPES
    head = (phase >= np.cumsum(share, axis=0)[:-1]).sum(axis=0)
    rgb = np.array([to_rgb(colour) for colour in colours])[head]
    return np.concatenate([rgb, (total > 0.0)[..., None].astype(np.float64)], axis=2)


FigureBox = tuple[float, float, float, float]  # left, bottom, width, height in parts of the figure

VIEW_IN = 4.6  # of a view: the longer side, inches
SHAPES = 0.5, 1.35  # of a view: least and largest height over width
LEFT, RIGHT, GAP = 0.75, 0.3, 0.35
ROWS = 1.05  # left of the chart of heads
HEAD, TITLE, UNDER = 0.75, 0.5, 0.55  # above the views: title, own titles; below: axis
LEGEND, CHART, CHART_GAP = 0.4, 1.35, 0.5
ENTRIES, ENTRY_ROW = 7, 0.17  # of the legend in a row, and the height of a further row
ROW_IN, TIMES_HEAD = 0.42, 0.75  # of the chart of heads: a head, and what stands around them


@dataclass(frozen=True, slots=True)
class Sheet:
    """Sizes and places."""

    size: tuple[float, float]  # inches
    extent: Floats  # (2, 3) mm: the box that views show
    views: tuple[FigureBox, ...]
    chart: FigureBox
    side: FigureBox
    times: FigureBox
    legend: float  # its top, in parts of the height
    left: float  # where titles begin, in parts of the width
    inch_a_mm: float  # the scale of the views


def sheet_of(extent: Floats, heads: int) -> Sheet:
    """Return the sheet for a print in this box, for one head or several."""
    wide, deep, _ = np.maximum(extent[1] - extent[0], 1e-6).tolist()
    across, up = max(wide, deep / SHAPES[1]), max(deep, wide * SHAPES[0])
    middle, half = extent[:, :2].mean(axis=0), np.array([across, up]) / 2
    extent = np.column_stack([[middle - half, middle + half], extent[:, 2]])
    scale = min(VIEW_IN / across, VIEW_IN / up)
    w, h = scale * across, scale * up
    columns = 3 if heads > 1 else 2
    width = LEFT + columns * w + (columns - 1) * GAP + RIGHT
    times = TIMES_HEAD + ROW_IN * heads + 0.1 if heads > 1 else 0.0
    rows = -(-(2 * heads + 3) // ENTRIES)
    below = LEGEND + ENTRY_ROW * (rows - 1) + CHART + CHART_GAP + times
    height = HEAD + TITLE + h + UNDER + below + 0.1
    size = (width, height)

    def place(x: float, y: float, wide: float, high: float) -> FigureBox:
        return x / width, y / height, wide / width, high / height

    foot = 0.1 + below + UNDER
    views = tuple(place(LEFT + k * (w + GAP), foot, w, h) for k in range(columns))
    chart_y = 0.1 + times + CHART_GAP
    third = LEFT + 2 * (w + GAP)
    return Sheet(
        size, extent, views,
        place(LEFT, chart_y, 2 * w + GAP - (0.25 if heads > 1 else 0.0), CHART - 0.25),
        place(third, chart_y, w, CHART - 0.25),
        place(ROWS, CHART_GAP, width - ROWS - RIGHT, ROW_IN * heads),
        (0.1 + below + 0.05) / height, LEFT / width, scale,
    )  # fmt: skip
