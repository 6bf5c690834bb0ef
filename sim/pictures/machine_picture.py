"""A picture of a machine: its heads' slices and bodies, its bed, reach and parks.

Heads that are several are drawn in a row too, as near to each other as they may be
(`row_picture`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon, Rectangle
from matplotlib.transforms import ScaledTranslation

from decmcts.arrays import Floats
from decmcts.print.machine import Head, Machine, Rail
from sim.pictures.canvas import head_colour, save
from sim.pictures.row_picture import draw_row_above, draw_row_beside, row_of, shortened, write_row

NEAR_MM = 110.0  # of the nozzle; larger parts are cut off at the frame
LINES: Any = ((0, (6, 3)), (0, (2, 2)), (0, (8, 2, 2, 2)), (0, (1, 1)))
MARKERS = "os^Dv<>p"
RAIL_LETTERS = 30  # that fit below the bed
HEAD_IN = 5.0  # inches for each row of drawings
REACH_APART = 0.012  # of the bed, between the lines of reaches that are the same
BESIDE_MM = 60.0  # the same for what is parked, in the picture of the bed


def draw_machine(machine: Machine, path: Path | str) -> None:
    """Draw each head's slices from above and from the front, the bed, and the heads in a row.

    Heads of one shape are drawn once. A PNG, or an SVG where the path ends so.
    """
    shapes = _shapes(machine)
    rows = [each for axis in range(2) if (each := row_of(machine, axis)) is not None]
    count = len(shapes) + len(rows)
    height = HEAD_IN * count + 1.3
    figure = Figure(figsize=(16.5, height))
    axes = figure.subplots(count, 3, squeeze=False)
    edge = 0.75 / height
    figure.subplots_adjust(
        left=0.05, right=0.985, top=1 - edge, bottom=1.7 * edge, wspace=0.22, hspace=0.42
    )
    for row, heads in enumerate(shapes):
        names = ", ".join(machine.heads[h].name for h in heads)
        _draw_slices(axes[row, 0], machine.heads[heads[0]], names)
        _draw_elevation(axes[row, 1], machine.heads[heads[0]])
        if row:
            axes[row, 2].set_axis_off()
    _draw_bed(axes[0, 2], machine)
    for row, stand in enumerate(rows, start=len(shapes)):
        draw_row_above(axes[row, 0], machine, stand)
        draw_row_beside(axes[row, 1], machine, stand)
        write_row(axes[row, 2], machine, stand)
    figure.suptitle(machine.name, fontsize=14, y=1 - 0.35 * edge)
    save(figure, path)


def _shapes(machine: Machine) -> list[list[int]]:
    """Return the heads of each shape, in the order of the first of each."""
    found: dict[Any, list[int]] = {}
    for h, head in enumerate(machine.heads):
        slices = tuple(
            (piece.height_mm, tuple(tuple(map(tuple, polygon)) for polygon in piece.polygons))
            for piece in head.slices
        )
        found.setdefault((slices, head.bodies), []).append(h)
    return list(found.values())


def _draw_slices(axis: Any, head: Head, names: str) -> None:
    """Draw the slices from above, the lowest on top; `names` are of the heads of this shape."""
    corners = [np.concatenate(piece.polygons) for piece in head.slices]
    reach = float(np.abs(np.concatenate([np.zeros((1, 2)), *corners])).max())
    half = min(NEAR_MM, 1.15 * reach + 2.0)
    axis.set_xlim(-half, half)
    axis.set_ylim(-half, half)
    axis.set_aspect("equal")
    for k, piece in reversed(list(enumerate(head.slices))):
        for polygon in piece.polygons:
            axis.add_patch(Polygon(polygon, closed=True, fc=_shade(k), ec="black", lw=0.8))
    axis.plot(0, 0, "k+", ms=9)
    axis.set_title(f"{shortened(names)}: from above, lowest slice on top", fontsize=10)
    axis.set_xlabel("x from the nozzle, mm")
    axis.set_ylabel("y from the nozzle, mm")
    handles = [
        Patch(fc=_shade(k), ec="black", label=f"from {piece.height_mm:g} mm up")
        for k, piece in enumerate(head.slices)
    ]
    axis.legend(
        handles=handles, fontsize=8, loc="upper center", ncols=4, frameon=False,
        bbox_to_anchor=(0.5, 0.0), bbox_transform=_below(axis, 0.5),
    )  # fmt: skip


def _below(axis: Any, inches: float) -> Any:
    """Return where an axis is, so many inches lower: for legends below its label."""
    scale = axis.figure.dpi_scale_trans
    return axis.transAxes + ScaledTranslation(0.0, -inches, scale)


def _shade(k: int) -> str:
    return ("#d62728", "#ff9d5c", "#ffd92f", "#a6d854", "#66c2a5", "#8da0cb", "#b3b3b3")[k % 7]


def _draw_elevation(axis: Any, head: Head) -> None:
    """Draw slices and bodies from the front, as far up as the bodies or 30 mm above.

    A slice hides those below it from its height up.
    """
    highest = max((piece.height_mm for piece in head.slices), default=0.0)
    top = max([1.3 * highest + 12.0, *(b.maximum[2] for b in head.bodies)])
    reach = 5.0
    for k, piece in enumerate(head.slices):
        for polygon in piece.polygons:
            low, high = float(polygon[:, 0].min()), float(polygon[:, 0].max())
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


def _draw_bed(axis: Any, machine: Machine) -> None:
    """Draw the bed, all heads parked with their reach, and the rails."""
    low, high = np.array(machine.bed_min, float), np.array(machine.bed_max, float)
    axis.add_patch(Rectangle(tuple(low), *(high - low), fc="#eeeeee", ec="black", label="bed"))
    seen = [low, high, *_parked_corners(machine)]
    for k, head in enumerate(machine.heads):
        colour, words = head_colour(k, max(2, len(machine.heads))), "park"
        reach = np.clip([head.reach_min[:2], head.reach_max[:2]], low - 30, high + 30)
        if float(np.abs([head.reach_min[:2], head.reach_max[:2]]).max()) < 1e5:
            inset = REACH_APART * (k + 1) * float((high - low).max())  # so that none hides another
            corner, size = reach[0] + inset, reach[1] - reach[0] - 2 * inset
            lines = {"ls": LINES[k % len(LINES)], "lw": 1.6}
            axis.add_patch(Rectangle(tuple(corner), *size, fill=False, ec=colour, **lines))
            seen, words = [*seen, *reach], "park, reach"
        if len(machine.heads) > 1:
            _draw_parked(axis, head, colour)
        axis.plot(
            *head.park[:2], marker=MARKERS[k % len(MARKERS)], color=colour, ms=7, clip_on=False,
            ls=LINES[k % len(LINES)], label=f"{shortened(head.name, 20)}: {words}",
        )  # fmt: skip
    points = np.array(seen)
    margin = 0.08 * float((high - low).max())
    axis.set_xlim(points[:, 0].min() - margin, points[:, 0].max() + margin)
    axis.set_ylim(points[:, 1].min() - margin, points[:, 1].max() + margin)
    axis.set_aspect("equal")
    axis.set_title("bed, parks and reach (drawn a little smaller) from above", fontsize=10)
    rails = [_rail_words(rail) for rail in machine.rails]
    axis.set_xlabel("\n".join(["x, mm", *rails]), fontsize=9)
    axis.set_ylabel("y, mm")
    axis.legend(
        fontsize=8, loc="upper center", ncols=2, frameon=False, bbox_to_anchor=(0.5, 0.0),
        bbox_transform=_below(axis, 0.5 + 0.16 * len(rails)),
    )  # fmt: skip


def _rail_words(rail: Rail) -> str:
    order = ", ".join(rail.order)
    order = order if len(order) <= RAIL_LETTERS else f"{len(rail.order)} heads"
    return f"rail along {'xy'[rail.axis]}: {order}; nozzles {rail.separation_mm:g} mm apart"


def _draw_parked(axis: Any, head: Head, colour: str) -> None:
    """Draw the outlines of a head's bodies where it parks; the frame cuts off long beams."""
    for body in head.bodies:
        corner = (head.park[0] + body.minimum[0], head.park[1] + body.minimum[1])
        size = (body.maximum[0] - body.minimum[0], body.maximum[1] - body.minimum[1])
        axis.add_patch(Rectangle(corner, *size, fc=(colour, 0.12), ec=colour, lw=1.0))


def _parked_corners(machine: Machine) -> list[Floats]:
    """Return what of the parked heads the frame holds: parks, and bodies not far from them."""
    return [
        np.add(head.park[:2], np.clip(corner[:2], -BESIDE_MM, BESIDE_MM))
        for head in machine.heads
        for corner in [(0.0, 0.0, 0.0), *(c for b in head.bodies for c in (b.minimum, b.maximum))]
    ]
