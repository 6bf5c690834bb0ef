"""A picture of a machine: its heads' slices and bodies, its bed, reach and parks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon, Rectangle
from numpy.typing import NDArray

from decmcts.print.machine import Head, Machine
from sim.pictures.canvas import head_colour, save

NEAR_MM = 110.0  # of the nozzle; larger parts are cut off at the frame
BESIDE_MM = 60.0  # the same for what is parked, in the picture of the bed


def draw_machine(machine: Machine, path: Path | str) -> None:
    """Draw each head's slices from above and from the front, and the bed."""
    rows = len(machine.heads)
    figure = Figure(figsize=(16.5, 5.0 * rows + 0.8))
    axes = figure.subplots(rows, 3, squeeze=False)
    edge = 0.75 / (5.0 * rows + 0.8)
    figure.subplots_adjust(
        left=0.05, right=0.985, top=1 - edge, bottom=edge, wspace=0.5, hspace=0.3
    )
    for row, head in enumerate(machine.heads):
        _draw_slices(axes[row, 0], head)
        _draw_elevation(axes[row, 1], head)
        _draw_bed(axes[row, 2], machine, row)
    figure.suptitle(machine.name, fontsize=14, y=1 - 0.35 * edge)
    save(figure, path)


def _draw_slices(axis: Any, head: Head) -> None:
    """Draw the slices from above, the lowest on top."""
    corners = [np.concatenate(piece.polygons) for piece in head.slices]
    _frame(axis, np.concatenate(corners) if corners else np.zeros((1, 2)))
    for k, piece in reversed(list(enumerate(head.slices))):
        for polygon in piece.polygons:
            axis.add_patch(Polygon(polygon, closed=True, fc=_shade(k), ec="black", lw=0.8))
    axis.plot(0, 0, "k+", ms=9)
    axis.set_title(f"{head.name}: from above, lowest slice on top", fontsize=10)
    axis.set_xlabel("x from the nozzle, mm")
    axis.set_ylabel("y from the nozzle, mm")
    handles = [
        Patch(fc=_shade(k), ec="black", label=f"from {piece.height_mm:g} mm up")
        for k, piece in enumerate(head.slices)
    ]
    axis.legend(
        handles=handles, fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False
    )


def _frame(axis: Any, points: NDArray[np.float64]) -> None:
    """Show a square around the nozzle that holds the points, if they are near."""
    half = min(NEAR_MM, 1.15 * float(np.abs(points).max()) + 2.0)
    axis.set_xlim(-half, half)
    axis.set_ylim(-half, half)
    axis.set_aspect("equal")


def _shade(k: int) -> str:
    return ("#d62728", "#ff9d5c", "#ffd92f", "#a6d854", "#66c2a5", "#8da0cb", "#b3b3b3")[k % 7]


def _draw_elevation(axis: Any, head: Head) -> None:
    """Draw slices and bodies from the front, as far up as the bodies or 30 mm above."""
    highest = max((piece.height_mm for piece in head.slices), default=0.0)
    top = max([1.3 * highest + 12.0, *(b.maximum[2] for b in head.bodies)])
    reach = 5.0
    for k, piece in reversed(list(enumerate(head.slices))):
        for polygon in piece.polygons:
            low, high = polygon[:, 0].min(), polygon[:, 0].max()
            reach = max(reach, -low, high)
            corner, size = (low, piece.height_mm), (high - low, 2 * top)
            axis.add_patch(Rectangle(corner, *size, fc=_shade(k), ec="black", lw=0.8))
    for body in head.bodies:
        size = (body.maximum[0] - body.minimum[0], body.maximum[2] - body.minimum[2])
        corner = (body.minimum[0], body.minimum[2])
        axis.add_patch(Rectangle(corner, *size, fill=False, ec="black", ls="--", lw=1.4))
        reach = max(reach, -body.minimum[0], body.maximum[0])
    axis.axhline(0, color="grey", lw=0.8)
    half = min(NEAR_MM, max(1.15 * reach + 2.0, 0.55 * top))
    axis.set_xlim(-half, half)
    axis.set_ylim(-0.06 * top, 1.06 * top)
    axis.set_aspect("equal")
    axis.set_title("from the front" + (" (dashed: bodies)" if head.bodies else ""), fontsize=10)
    axis.set_xlabel("x from the nozzle, mm")
    axis.set_ylabel("z from the tip, mm")


def _draw_bed(axis: Any, machine: Machine, row: int) -> None:
    """Draw the bed, the head's reach and where it parks, beside the others' bodies parked."""
    head, colour = machine.heads[row], head_colour(row, max(2, len(machine.heads)))
    low, high = np.array(machine.bed_min, float), np.array(machine.bed_max, float)
    axis.add_patch(Rectangle(tuple(low), *(high - low), fc="#eeeeee", ec="black"))
    reach = np.clip([head.reach_min[:2], head.reach_max[:2]], low - 30, high + 30)
    limited = float(np.abs([head.reach_min[:2], head.reach_max[:2]]).max()) < 1e5
    if limited:
        axis.add_patch(
            Rectangle(
                tuple(reach[0]), *(reach[1] - reach[0]), fill=False, ec=colour, ls="--", lw=1.8
            )
        )
    for k, other in enumerate(machine.heads if len(machine.heads) > 1 else ()):
        _draw_parked(axis, other, head_colour(k, len(machine.heads)), own=k == row)
    axis.plot(*head.park[:2], "o", color=colour, ms=8, clip_on=False)
    axis.annotate(
        "park", head.park[:2], textcoords="offset points", xytext=(0, 8), fontsize=9, ha="center"
    )
    points = np.array([low, high, *_parked_corners(machine), *(reach if limited else [])])
    margin = 0.08 * float((high - low).max())
    axis.set_xlim(points[:, 0].min() - margin, points[:, 0].max() + margin)
    axis.set_ylim(points[:, 1].min() - margin, points[:, 1].max() + margin)
    axis.set_aspect("equal")
    axis.set_title("bed and park" + (", reach dashed" if limited else ""), fontsize=10)
    axis.set_xlabel("x, mm")
    axis.set_ylabel("y, mm")


def _draw_parked(axis: Any, head: Head, colour: str, *, own: bool) -> None:
    """Draw the outlines of a head's bodies where it parks; the frame cuts off long beams."""
    for body in head.bodies:
        corner = (head.park[0] + body.minimum[0], head.park[1] + body.minimum[1])
        size = (body.maximum[0] - body.minimum[0], body.maximum[1] - body.minimum[1])
        axis.add_patch(Rectangle(corner, *size, fill=False, ec=colour, lw=1.4 if own else 0.5))


def _parked_corners(machine: Machine) -> list[NDArray[np.float64]]:
    """Return what of the parked heads the frame holds: parks, and bodies not far from them."""
    return [
        np.add(head.park[:2], np.clip(corner[:2], -BESIDE_MM, BESIDE_MM))
        for head in machine.heads
        for corner in [(0.0, 0.0, 0.0), *(c for b in head.bodies for c in (b.minimum, b.maximum))]
    ]
