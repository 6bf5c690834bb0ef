"""Heads in a row, as near to each other as they may be, from above and from the side.

They stand with all tips at one height, on the bed's middle line along one axis. Nothing is drawn
here.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np
import shapely
from matplotlib.patches import Polygon, Rectangle

from decmcts.arrays import Floats
from decmcts.print.machine import Head, Machine
from sim.pictures.canvas import head_colour
from sim.replay.heads_near import outermost
from sim.replay.shapes import Part, parts_of, separations_between

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
            axis.add_patch(Polygon(corners, closed=True, fc=(colour, 0.13), ec=colour, lw=0.9))
        axis.plot(*nozzle, "k+", ms=8)
        _name(axis, nozzle, machine.heads[h])
    for gap, (start, end) in zip(row.gaps_mm, row.ends, strict=True):
        axis.plot(*np.transpose([start, end]), color="black", lw=3.0, solid_capstyle="butt")
        middle = (start + end) / 2.0
        aside = (0, -15) if row.axis == 0 else (12, -3)
        axis.annotate(f"{gap:.4g} mm", middle, textcoords="offset points", xytext=aside,
                      ha="left" if row.axis else "center", fontsize=8, bbox=BOX)  # fmt: skip
    middle = (row.nozzles.min(axis=0) + row.nozzles.max(axis=0)) / 2.0
    half = float(np.ptp(row.nozzles, axis=0).max()) / 2.0 + AROUND_MM
    axis.set_xlim(middle[0] - half, middle[0] + half)
    axis.set_ylim(middle[1] - half, middle[1] + half)
    axis.set_aspect("equal")
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


def draw_row_beside(axis: Any, machine: Machine, row: HeadsInRow) -> None:
    """Draw all parts of the heads from the side on which the row is seen, tips at one height."""
    d = row.axis
    for h, nozzle in zip(row.order, row.nozzles, strict=True):
        colour = head_colour(h, len(machine.heads))
        for part in parts_of(machine.heads[h]):
            low, high = part.polygon[:, d].min() + nozzle[d], part.polygon[:, d].max() + nozzle[d]
            size = (high - low, part.high - part.low)
            axis.add_patch(Rectangle((low, part.low), *size, fc=(colour, 0.13), ec=colour, lw=0.9))
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


FAR_MM = 1e4  # no head is as large
ROUND = 512  # chords in a quarter of a circle: a micrometre off at most

Point = Floats  # (2,)


@dataclass(frozen=True, slots=True)
class HeadsInRow:
    """Heads in a row, from the lowest coordinate up."""

    axis: int  # 0: along X, 1: along Y
    order: tuple[int, ...]  # heads of the machine
    nozzles: Floats  # (n, 2)
    gaps_mm: tuple[float, ...]  # between the bodies of neighbours
    ends: tuple[tuple[Point, Point], ...]  # of the gaps, seen from above
    by_rail: tuple[bool, ...]  # whether a rail keeps these neighbours further apart


def row_of(machine: Machine, axis: int) -> HeadsInRow | None:
    """Return the heads in a row along an axis; None where they cannot all stand so on the bed."""
    if len(machine.heads) < 2 or any(rail.axis != axis for rail in machine.rails):
        return None
    order = _order(machine, axis)
    parts = [outermost(parts_of(machine.heads[h])) for h in order]
    at, by_rail = [0.0], []
    for k in range(1, len(order)):
        clearance_mm = machine.head_clearance_mm
        need = max(at[j] + _least(parts[j], parts[k], axis, clearance_mm) for j in range(k))
        railed = max(at[i] + _on_rail(machine, order[i], order[k]) for i in range(k))
        at.append(max(need, railed))
        by_rail.append(railed > need)
    low, high = (float(edge[axis]) for edge in (machine.bed_min, machine.bed_max))
    if at[-1] > high - low:
        return None
    nozzles = np.tile(np.add(machine.bed_min, machine.bed_max) / 2.0, (len(order), 1))
    nozzles[:, axis] += np.array(at) - at[-1] / 2.0
    found = [
        _gap_between(*pair, *ends)
        for pair, ends in zip(pairwise(parts), pairwise(nozzles), strict=True)
    ]
    gaps, ends = tuple(gap for gap, _ in found), tuple(end for _, end in found)
    return HeadsInRow(axis, tuple(order), nozzles, gaps, ends, tuple(by_rail))


def _order(machine: Machine, axis: int) -> list[int]:
    """Return the heads as the rail has them, others by where they park."""
    names = [head.name for head in machine.heads]
    order = sorted(range(len(names)), key=lambda h: machine.heads[h].park[axis])
    for rail in machine.rails:
        places = sorted(order.index(names.index(name)) for name in rail.order)
        for place, name in zip(places, rail.order, strict=True):
            order[place] = names.index(name)
    return order


def _on_rail(machine: Machine, h: int, g: int) -> float:
    """Return how far apart rails keep two nozzles; minus infinity where none does."""
    rails = separations_between(machine, machine.heads[h], machine.heads[g])
    return max((side * least for _, side, least in rails), default=-np.inf)


def _least(ours: list[Part], theirs: list[Part], axis: int, clearance_mm: float) -> float:
    """Return from where on along the axis two heads keep a clearance, wherever they are before."""
    ways, least = np.eye(2)[axis] * [[-FAR_MM], [FAR_MM]], 0.0
    for a, b in product(ours, theirs):
        level = np.sqrt(max(0.0, clearance_mm**2 - _above(a, b) ** 2))
        apart = (a.polygon[:, None] - b.polygon[None]).reshape(-1, 2)  # too near within it
        near = shapely.MultiPoint(apart).convex_hull.buffer(level, quad_segs=ROUND)
        met = near.intersection(shapely.LineString(ways))
        if not met.is_empty:
            least = max(least, met.bounds[2 + axis])
    return least


def _above(a: Part, b: Part) -> float:
    """Return how far one part is above the other, with both tips at one height."""
    return max(0.0, a.low - b.high, b.low - a.high)


def _gap_between(
    ours: list[Part], theirs: list[Part], at: Point, to: Point
) -> tuple[float, tuple[Point, Point]]:
    """Return the least distance of two heads that stand still, and its ends from above."""
    best: tuple[float, tuple[Point, Point]] = (np.inf, (at, to))
    for a, b in product(ours, theirs):
        one, other = shapely.Polygon(a.polygon + at), shapely.Polygon(b.polygon + to)
        line = shapely.shortest_line(one, other)
        gap = float(np.hypot(line.length, _above(a, b)))
        if gap < best[0] - 1e-9:
            ends = np.array(line.coords)
            best = gap, (ends[0], ends[1])
    return best
