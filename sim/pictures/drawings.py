"""Pictures of plans, PNG or SVG: what changed, who prints what, and what each head does when.

Three questions are answered on one sheet. Which travels of a layer are gone, and which are new?
In which layers is travel saved? Of several heads: what does each print, and when does it
print, travel or wait? Only drawing lives here; nothing is judged.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from decmcts.print.metrics import compared_order
from decmcts.print.plan import ActionKind, PlanDocument
from sim.arrays import Floats
from sim.pictures.canvas import head_colour, save, words_as_they_are
from sim.pictures.charts import draw_layers, draw_times, times_legend, title_lines
from sim.pictures.layer_travels import by_layer, layers_of, most_changed, require_layer, travels_of
from sim.pictures.layer_view import (
    SHADOW,
    LayerView,
    cut_handle,
    draw_layer,
    draw_pieces,
    legend_of,
)
from sim.pictures.shares import bead_grids, striped
from sim.pictures.sheet import ENTRIES, Sheet, sheet_of

NAMED = 3  # heads whose shares have room in a title


@words_as_they_are()
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
    figure.text(sheet.left, sheet.top(0.32), title, fontsize=13, fontweight="bold")
    figure.text(sheet.left, sheet.top(0.58), under, fontsize=9.5)
    grids = bead_grids(after, (0, 1), sheet.extent)
    for k, view in enumerate(views):
        axis = _view_axis(figure, sheet, k)
        _draw_shadow(axis, sheet, grids)
        draw_layer(axis, view, gone=k == 0, inch_a_mm=sheet.inch_a_mm)
        axis.set_title(f"{'after' if k else first}: {_counted(view)}", fontsize=9.5, loc="left")
    figure.legend(
        handles=legend_of(views), loc="upper left", ncols=ENTRIES, fontsize=8, frameon=False,
        bbox_to_anchor=(sheet.left - 0.01, sheet.legend), columnspacing=1.1, handlelength=1.4,
    )  # fmt: skip
    draw_layers(figure.add_axes(sheet.chart), lengths, views[0].row, first)
    if heads > 1:
        _draw_shares(figure, sheet, views[1], grids)
        _draw_heads(figure, sheet, after)
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
        LayerView(before, was, was.in_no_place_of(now), number, row),
        LayerView(after, now, now.in_no_place_of(was), number, row),
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
    """Return axes for a view from above, in mm."""
    axis = figure.add_axes(sheet.views[column])
    axis.set_xlim(*sheet.extent[:, 0].tolist())
    axis.set_ylim(*sheet.extent[:, 1].tolist())
    axis.tick_params(labelsize=8, labelleft=column == 0)
    axis.set_xlabel("x, mm", fontsize=8.5)
    if column == 0:
        axis.set_ylabel("y, mm", fontsize=8.5)
    return axis


def _draw_shadow(axis: Any, sheet: Sheet, grids: Floats) -> None:
    """Draw the whole print, hardly seen, as the ground of a layer."""
    shadow = striped(grids, [SHADOW] * len(grids))
    (x0, y0, _), (x1, y1, _) = sheet.extent.tolist()
    axis.imshow(shadow, origin="lower", extent=(x0, x1, y0, y1), aspect="auto", zorder=1,
                interpolation="nearest")  # fmt: skip


def _counted(view: LayerView) -> str:
    """Return which layer it is, how many travels lead to it, and how long they are."""
    layers, heights = layers_of(view.document)
    rows = view.rows
    n, length = len(rows), float(view.travels.length_mm[rows].sum())
    return (
        f"layer {view.row + 1} of {len(layers)}, z {heights[view.row]:g} mm\n"
        f"{n:,} travel{'s' * (n != 1)} to it, {length:,.0f} mm"
    )


def _draw_heads(figure: Figure, sheet: Sheet, after: PlanDocument) -> None:
    """Draw what each head does over time."""
    axis = figure.add_axes(sheet.times)
    draw_times(axis, after)
    axis.set_title("what each head does", fontsize=9.5, loc="left")
    axis.legend(handles=times_legend(), loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3,
                fontsize=8, frameon=False, borderaxespad=0.2)  # fmt: skip


def _draw_shares(figure: Figure, sheet: Sheet, view: LayerView, grids: Floats) -> None:
    """Draw what each head prints, from above and from the front.

    Of a cut print from above the pieces of the layer, of any other all layers.
    """
    after, heads = view.document, view.document.plan.heads
    colours = [head_colour(k, len(heads)) for k in range(len(heads))]
    axis = _view_axis(figure, sheet, 2)
    (x0, y0, z0), (x1, y1, z1) = sheet.extent.tolist()
    handles: list[Any]
    handles = [Patch(color=c, label=h.head) for c, h in zip(colours, heads, strict=True)]
    if after.contours.of is None:
        axis.imshow(striped(grids, colours), origin="lower", extent=(x0, x1, y0, y1),
                    aspect="auto", interpolation="nearest")  # fmt: skip
        of_layers = "all layers"
    else:
        draw_pieces(axis, after, view.layer, inch_a_mm=sheet.inch_a_mm)
        of_layers = f"layer {view.row + 1}, piece by piece"
        handles.append(cut_handle())
    axis.set_title(f"who prints what: {of_layers}\n{_who(after)}", fontsize=9.5, loc="left")
    if ((grids > 0.0).sum(axis=0) > 1).any():
        stripes: Any = {"fc": colours[0], "ec": colours[1], "hatch": "////", "lw": 0}
        handles.append(Patch(label="striped: several", **stripes))
    figure.legend(
        handles=handles, loc="upper left", ncols=4, fontsize=8, frameon=False,
        bbox_to_anchor=(sheet.views[2][0] - 0.01, sheet.legend),
    )  # fmt: skip
    side = figure.add_axes(sheet.side)
    front = striped(bead_grids(after, (0, 2), sheet.extent), colours)
    side.imshow(front, origin="lower", extent=(x0, x1, z0, z1), aspect="auto",
                interpolation="nearest")  # fmt: skip
    side.set_title("all layers from the front", fontsize=8.5, loc="left")
    side.set_xlabel("x, mm", fontsize=8.5)
    side.set_ylabel("z, mm", fontsize=8.5)
    side.tick_params(labelsize=8)


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
