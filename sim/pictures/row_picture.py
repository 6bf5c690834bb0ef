"""Heads in a row, as near to each other as they may be, from above and from the side."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.patches import Polygon, Rectangle

from decmcts.print.machine import Head, Machine
from sim.pictures.canvas import head_colour
from sim.pictures.heads_in_row import HeadsInRow
from sim.replay.shapes import parts_of

AROUND_MM = 70.0  # around the outermost nozzles; what is further off is cut at the frame
ABOVE_MM = 130.0  # the same for heights


def draw_row_above(axis: Any, machine: Machine, row: HeadsInRow) -> None:
    """Draw all parts of the heads from above, with the gaps between neighbours."""
    low, high = np.array(machine.bed_min, float), np.array(machine.bed_max, float)
    axis.add_patch(Rectangle(tuple(low), *(high - low), fc="#f4f4f4", ec="black", lw=0.8))
    for h, nozzle in zip(row.order, row.nozzles, strict=True):
        colour = head_colour(h, len(machine.heads))
        for part in parts_of(machine.heads[h]):
            corners = part.polygon + nozzle
            axis.add_patch(Polygon(corners, closed=True, fc=colour, alpha=0.13, lw=0))
            axis.add_patch(Polygon(corners, closed=True, fill=False, ec=colour, lw=0.9))
        axis.plot(*nozzle, "k+", ms=8)
        _name(axis, nozzle, machine.heads[h])
    for gap, (start, end) in zip(row.gaps_mm, row.ends, strict=True):
        axis.plot(*np.transpose([start, end]), color="black", lw=3.0, solid_capstyle="butt")
        middle = (start + end) / 2.0
        aside = (0, -15) if row.axis == 0 else (12, -3)
        axis.annotate(f"{gap:.4g} mm", middle, textcoords="offset points", xytext=aside,
                      ha="left" if row.axis else "center", fontsize=8, bbox=BOX)  # fmt: skip
    _frame(axis, row, row.nozzles[:, 0], row.nozzles[:, 1])
    along = "side by side" if row.axis == 0 else "behind one another"
    axis.set_title(f"as near {along} as they may: from above", fontsize=10)
    axis.set_xlabel("x, mm")
    axis.set_ylabel("y, mm")


def shortened(name: str, most: int = 40) -> str:
    """Return a name that takes no more room than so many letters."""
    return name if len(name) <= most else name[: most - 1] + "…"


BOX: Any = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.85}


def _name(axis: Any, at: Any, head: Head) -> None:
    axis.annotate(shortened(head.name, 14), at, textcoords="offset points", xytext=(0, -14),
                  ha="center", fontsize=8, bbox=BOX)  # fmt: skip


def _frame(axis: Any, row: HeadsInRow, across: Any, up: Any) -> None:
    """Show what is within `AROUND_MM` of the nozzles, as wide as it is high."""
    middle = np.array([across.min() + across.max(), up.min() + up.max()]) / 2.0
    half = max(np.ptp(across), np.ptp(up)) / 2.0 + AROUND_MM
    axis.set_xlim(middle[0] - half, middle[0] + half)
    axis.set_ylim(middle[1] - half, middle[1] + half)
    axis.set_aspect("equal")


def draw_row_beside(axis: Any, machine: Machine, row: HeadsInRow) -> None:
    """Draw all parts of the heads from the side on which the row is seen, tips at one height."""
    d = row.axis
    for h, nozzle in zip(row.order, row.nozzles, strict=True):
        colour = head_colour(h, len(machine.heads))
        for part in parts_of(machine.heads[h]):
            low, high = part.polygon[:, d].min() + nozzle[d], part.polygon[:, d].max() + nozzle[d]
            size = (high - low, part.high - part.low)
            axis.add_patch(Rectangle((low, part.low), *size, fc=colour, alpha=0.13, lw=0))
            axis.add_patch(Rectangle((low, part.low), *size, fill=False, ec=colour, lw=0.9))
        _name(axis, (nozzle[d], 0.0), machine.heads[h])
    places = row.nozzles[:, d]
    half = float(np.ptp(places)) / 2.0 + AROUND_MM
    level = -0.2 * half
    for start, end in pairwise(places.tolist()):
        arrow = {"arrowstyle": "<->", "lw": 0.9}
        axis.annotate("", (start, level), (end, level), arrowprops=arrow)
        axis.annotate(f"{end - start:.4g} mm", ((start + end) / 2.0, level), ha="center",
                      textcoords="offset points", xytext=(0, -11), fontsize=8)  # fmt: skip
    axis.plot(places, np.zeros(len(places)), "k+", ms=8)
    axis.axhline(0, color="grey", lw=0.8)
    axis.set_xlim(places.mean() - half, places.mean() + half)
    axis.set_ylim(-0.36 * half, ABOVE_MM)
    axis.set_aspect("equal")
    axis.set_title(f"the same from the {('front', 'left')[d]}, tips at one height", fontsize=10)
    axis.set_xlabel(f"{'xy'[d]}, mm")
    axis.set_ylabel("z from the tips, mm")


def write_row(axis: Any, machine: Machine, row: HeadsInRow) -> None:
    """Write the distances between neighbours, and what asks for them."""
    axis.set_axis_off()
    lines = [f"The machine asks for {machine.head_clearance_mm:g} mm between the bodies."]
    neighbours = zip(
        pairwise(row.order), row.gaps_mm, row.by_rail, pairwise(row.nozzles), strict=True
    )
    for (h, g), gap, railed, (at, to) in neighbours:
        names = " and ".join(shortened(machine.heads[k].name, 14) for k in (h, g))
        apart = float(to[row.axis] - at[row.axis])
        why = " (their rail)" if railed else ""
        lines.append(f"{names}: bodies {gap:.4g} mm, nozzles {apart:.4g} mm{why}")
    if all(row.by_rail):
        lines.append("On a rail heads keep their order: none passes another.")
    axis.text(0.0, 0.95, "\n".join(lines), va="top", fontsize=9, linespacing=1.6,
              transform=axis.transAxes)  # fmt: skip
