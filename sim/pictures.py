"""PNG pictures: a plan before and after, its Gantt chart, convergence, machines.

Only drawing lives here; nothing is judged.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon, Rectangle
from numpy.typing import NDArray

from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument

TRAVEL = "#d62728"
HEAD_COLOURS = ("#7f7f7f", "#1f77b4", "#e6a817", "#2ca02c", "#9467bd", "#8c564b")
SEGMENTS = 400_000  # drawn in one view; more are thinned evenly
DPI = 150


def head_colour(index: int, heads: int) -> str:
    """Return the colour of a head's extrusions: grey when it is the only one."""
    return HEAD_COLOURS[0] if heads == 1 else HEAD_COLOURS[1 + index % (len(HEAD_COLOURS) - 1)]


def lane_segments(lane: HeadActions, *, printing: bool) -> NDArray[np.float64]:
    """Return the printing or the other segments of a head, (m, 2, 3)."""
    owner = np.repeat(np.arange(len(lane)), np.diff(lane.path_offsets))
    joined = owner[1:] == owner[:-1]
    wanted = (lane.kind[owner[1:]] == ActionKind.PRINT) == printing
    rows = np.nonzero(joined & wanted)[0]
    return np.stack([lane.path[rows], lane.path[rows + 1]], axis=1)


def thinned(segments: NDArray[np.float64], most: int = SEGMENTS) -> NDArray[np.float64]:
    """Return every k-th segment so that at most `most` are left."""
    step = max(1, -(-len(segments) // most))
    return segments[::step]


def save(figure: Figure, path: Path | str) -> None:
    """Write a figure as PNG."""
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=DPI, facecolor="white")


def draw_plan(path: Path | str, before: PlanDocument, after: PlanDocument) -> None:
    """Draw two plans side by side, from above and from the side; travel in red."""
    extent = _extent([before, after])
    wide, deep, high = extent[1] - extent[0]
    ratio = min(2.5, max(0.35, high / deep))
    figure = Figure(figsize=(13, 6.5 * min(1.6, max(0.7, deep / wide)) * (1 + ratio) / 1.2 + 1))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, 2, height_ratios=[1, ratio], sharex="col")
    for column, (name, document) in enumerate((("before", before), ("after", after))):
        axes[0, column].set_title(f"{name}: {_caption(document)}", fontsize=10)
        for row, (i, j) in enumerate(((0, 1), (0, 2))):
            _draw_view(axes[row, column], document, i, j, extent)
    axes[0, 0].set_ylabel("y, mm")
    axes[1, 0].set_ylabel("z, mm")
    figure.legend(handles=_legend(after), loc="outside lower center", ncols=6, frameon=False)
    save(figure, path)


def _caption(document: PlanDocument) -> str:
    """Return the figures of one plan in a few words."""
    travel = sum(
        float(np.linalg.norm(np.diff(lane_segments(lane, printing=False), axis=1), axis=2).sum())
        for lane in document.plan.heads
    )
    minutes = document.plan.makespan_s / 60
    return f"{len(document.contours)} contours, travel {travel:,.0f} mm, {minutes:,.1f} min"


def _extent(documents: Sequence[PlanDocument]) -> NDArray[np.float64]:
    """Return the box all printing fits in, with a margin, (2, 3)."""
    points = np.concatenate([d.contours.points for d in documents])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * float((high - low)[:2].max()) + 1.0
    low[2] = min(low[2], 0.0)
    return np.array([low - margin, high + margin])


def _draw_view(
    axis: Any, document: PlanDocument, i: int, j: int, extent: NDArray[np.float64]
) -> None:
    """Draw the projection on coordinates i and j."""
    lanes = document.plan.heads
    for index, lane in enumerate(lanes):
        segments = thinned(lane_segments(lane, printing=True))[:, :, [i, j]]
        colour = head_colour(index, len(lanes))
        axis.add_collection(
            LineCollection(list(segments), colors=colour, linewidths=0.4, alpha=0.6)
        )
    for lane in lanes:
        segments = thinned(lane_segments(lane, printing=False))[:, :, [i, j]]
        axis.add_collection(
            LineCollection(list(segments), colors=TRAVEL, linewidths=0.5, alpha=0.55)
        )
    axis.set_xlim(extent[:, i])
    axis.set_ylim(extent[:, j])
    axis.set_aspect("equal", adjustable="box")
    axis.tick_params(labelsize=8)
    if j == 2:
        axis.set_xlabel("x, mm")


def _legend(document: PlanDocument) -> list[Line2D]:
    lanes = document.plan.heads
    handles = [
        Line2D([], [], color=head_colour(k, len(lanes)), lw=2, label=f"extrusion, {lane.head}")
        for k, lane in enumerate(lanes)
    ]
    return [*handles, Line2D([], [], color=TRAVEL, lw=2, label="travel")]


def draw_gantt(path: Path | str, document: PlanDocument) -> None:
    """Draw what each head does over time: print, travel, park; white is waiting."""
    lanes = document.plan.heads
    figure = Figure(figsize=(12, 1.6 + 0.7 * len(lanes)))
    figure.set_layout_engine("constrained")
    axis = figure.subplots()
    for row, lane in enumerate(lanes):
        for kind, colour in _gantt_colours(row, len(lanes)).items():
            rows = lane.kind == kind
            spans = np.column_stack([lane.begin_s, lane.end_s - lane.begin_s])[rows] / 60
            axis.broken_barh(spans.tolist(), (row - 0.36, 0.72), facecolors=colour, linewidth=0)
    axis.set_yticks(range(len(lanes)), [lane.head for lane in lanes])
    axis.set_ylim(len(lanes) - 0.4, -0.6)
    axis.set_xlim(0, max(document.plan.makespan_s / 60, 1e-9))
    axis.set_xlabel("minutes")
    handles = [
        Patch(color=head_colour(k, len(lanes)), label=f"{lane.head} prints")
        for k, lane in enumerate(lanes)
    ]
    handles += [Patch(color=TRAVEL, label="travels"), Patch(fc="white", ec="grey", label="waits")]
    figure.legend(handles=handles, loc="outside upper center", ncols=6, frameon=False)
    save(figure, path)


def _gantt_colours(index: int, heads: int) -> dict[ActionKind, str]:
    return {
        ActionKind.PRINT: head_colour(index, heads),
        ActionKind.TRAVEL: TRAVEL,
        ActionKind.PARK: TRAVEL,
    }


def draw_convergence(path: Path | str, history: Sequence[tuple[float, float]]) -> None:
    """Draw the best length found over time from (seconds, mm) pairs."""
    figure = Figure(figsize=(8, 4.5))
    figure.set_layout_engine("constrained")
    axis = figure.subplots()
    points = np.array(history, np.float64).reshape(-1, 2)
    axis.step(points[:, 0], points[:, 1], where="post", color="#1f77b4")
    axis.set_xlabel("seconds of search")
    axis.set_ylabel("extrusionless travel of the best order, mm")
    axis.grid(alpha=0.3)
    axis.set_ylim(bottom=0)
    save(figure, path)


def draw_machine(machine: Machine, path: Path | str) -> None:
    """Draw each head's slices from above and from the front, and the bed."""
    figure = Figure(figsize=(14, 4.8 * len(machine.heads)))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(len(machine.heads), 3, squeeze=False)
    for row, head in enumerate(machine.heads):
        _draw_slices(axes[row, 0], head)
        _draw_elevation(axes[row, 1], head)
        _draw_bed(axes[row, 2], machine, row)
    figure.suptitle(machine.name)
    save(figure, path)


def _draw_slices(axis: Any, head: Any) -> None:
    """Draw the slices from above, the lowest on top."""
    for k, piece in reversed(list(enumerate(head.slices))):
        for polygon in piece.polygons:
            axis.add_patch(
                Polygon(polygon, closed=True, fc=_shade(k), ec="black", lw=0.8, alpha=0.6)
            )
    axis.plot(0, 0, "k+", ms=8)
    axis.autoscale_view()
    axis.set_aspect("equal")
    axis.set_title(f"{head.name}: slices from above", fontsize=10)
    handles = [
        Patch(fc=_shade(k), ec="black", label=f"{s.height_mm:g} mm up")
        for k, s in enumerate(head.slices)
    ]
    axis.legend(
        handles=handles, fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False
    )


def _shade(k: int) -> str:
    return ("#d62728", "#ff9d5c", "#ffd92f", "#a6d854", "#66c2a5", "#8da0cb", "#b3b3b3")[k % 7]


def _draw_elevation(axis: Any, head: Any) -> None:
    """Draw slices and bodies from the front, as far up as the bodies or 30 mm above."""
    top = max([head.slices[-1].height_mm + 30.0, *(b.maximum[2] for b in head.bodies)])
    for k, piece in reversed(list(enumerate(head.slices))):
        for polygon in piece.polygons:
            low, high = polygon[:, 0].min(), polygon[:, 0].max()
            corner, size = (low, piece.height_mm), (high - low, top - piece.height_mm)
            axis.add_patch(Rectangle(corner, *size, fc=_shade(k), ec="black", lw=0.8, alpha=0.6))
    for body in head.bodies:
        size = (body.maximum[0] - body.minimum[0], body.maximum[2] - body.minimum[2])
        corner = (body.minimum[0], body.minimum[2])
        axis.add_patch(Rectangle(corner, *size, fill=False, ec="black", ls="--", lw=1.0))
    axis.axhline(0, color="grey", lw=0.8)
    axis.autoscale_view()
    axis.set_aspect("equal")
    axis.set_title("from the front (dashed: bodies)", fontsize=10)


def _draw_bed(axis: Any, machine: Machine, row: int) -> None:
    """Draw the bed, the head's reach and where it parks."""
    size = np.subtract(machine.bed_max, machine.bed_min)
    axis.add_patch(Rectangle(machine.bed_min, *size, fc="#eeeeee", ec="black"))
    head = machine.heads[row]
    low = np.maximum(head.reach_min[:2], np.array(machine.bed_min) - 50)
    high = np.minimum(head.reach_max[:2], np.array(machine.bed_max) + 50)
    colour = head_colour(row, max(2, len(machine.heads)))
    axis.add_patch(Rectangle(low, *(high - low), fill=False, ec=colour, ls="--", lw=1.5))
    axis.plot(*head.park[:2], "o", color=colour)
    axis.annotate("park", head.park[:2], textcoords="offset points", xytext=(5, 5), fontsize=8)
    axis.autoscale_view()
    axis.set_aspect("equal")
    axis.set_title("bed, reach (dashed) and park", fontsize=10)
