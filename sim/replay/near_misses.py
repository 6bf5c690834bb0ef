"""Which beads a head may touch on which moves: what the exact check has to look at.

On the grid of `sim.replay.raster`. A bead that is touched is never left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.print.machine import Machine
from sim.faults import Gap
from sim.replay import raster
from sim.replay.gaps import room
from sim.replay.shapes import Beads, Part

MARGIN_MM = 0.01  # rectangles round beads are this much larger than they, and their clearance
NEAR_MM = 5.0  # a least gap is looked for up to here, beyond the clearance


@dataclass(frozen=True, slots=True)
class NearMissCapacity:
    """How much memory the search for contacts may use."""

    first: int = 1 << 16  # near misses at first; 16 times as many at each further try
    most: int = 1 << 24  # near misses; a print with more is broken, not subtle
    cells: int = 1 << 24  # grid cells that all beads may cover,
    cells_each: int = 64  # or so many for each bead, where that is more


CAPACITY = NearMissCapacity()


class UndecidedError(Exception):
    """The judge cannot say; a plan it cannot judge does not pass."""


@dataclass(slots=True)
class NearPrint:
    """The least gap beside a bead that stands higher: asked for, then filled in.

    Pairs of contours that touch in the source do not count.
    """

    first: int = 0  # move that counts
    end: int = 1 << 62  # one past the last
    touching: Ints = field(  # (k,) keys of pairs, ascending: first * n + second
        default_factory=lambda: np.empty(0, np.int64)
    )
    whose: Ints = field(  # (m, 3) contours of each move, the first of such pairs
        default_factory=lambda: np.empty((0, 3), np.int64)
    )
    contour: Ints | None = None  # (n,) of each bead; None: what it is called
    n: int = 1  # contours of the print
    gap_mm: float = np.inf  # between the part and the edge of the bead; infinite: none is as near
    move: int = -1
    bead: int = -1
    part: str = ""

    def gap(self, machine: Machine, head: int, does: str, called: str, label: Ints) -> Gap:
        """Return what was found as a figure of a verdict.

        `does` says what the head does there, `called` what the labels of the beads are.
        """
        name, required = machine.heads[head].name, machine.clearance_mm
        if self.move < 0:
            return Gap(required + NEAR_MM, required, (name,), (), at_least=True)
        bead = f"{called} {label[self.bead]}"
        return Gap(self.gap_mm, required, (name,), (f"{does} ({self.part})", bead))


GapQuestion = tuple[Floats, Ints, Any, Any, Any, Any, Any]
"""What `sim.replay.gaps.come_nearer` takes."""


def asked_of(
    near: NearPrint | None, beads: Beads, rows: Ints, parts: list[Part], packed: Any,
    margins: tuple[float, float],
) -> GapQuestion:  # fmt: skip
    """Return the question for the least gap as kernels take it; None: it is not asked.

    `rows` has the bead of each candidate, `packed` the parts as the grid takes them.
    """
    clearance, tolerance = margins
    near = NearPrint(end=0) if near is None else near
    tops = [np.inf if part.slice else part.high - tolerance for part in parts]
    best = np.array([min(near.gap_mm, clearance + NEAR_MM)])
    who = np.array([-1, -1, -1, near.first, near.end])
    label = beads.label if near.contour is None else near.contour
    return (
        best,
        who,
        np.array([clearance + MARGIN_MM, tolerance]),
        (beads.start, beads.end, beads.width, beads.height, label, rows),
        (
            np.column_stack([packed[0], tops]),
            np.array([clearance if part.slice else 0.0 for part in parts]),
            *packed[1:],
        ),
        (near.touching, near.whose, near.n),
        room(),
    )


def near_misses(
    moves: Floats,
    beads: Beads,
    parts: list[Part],
    margins: tuple[float, float],
    capacity: NearMissCapacity,
    near: NearPrint | None = None,
) -> tuple[Ints, int]:
    """Return rows (move, bead, part) to look at closely, and their number.

    With more than `capacity.first` the search stops there, and the number is above that.
    `margins` are the clearance and the tolerance; `near` is filled in where given.
    """
    clearance_mm, tolerance_mm = margins
    order = np.argsort(beads.since, kind="stable")
    rows, since = _rectangles(beads, order, clearance_mm), beads.since[order]
    offsets = np.concatenate([[0], np.cumsum([len(p.polygon) for p in parts])]).astype(np.int64)
    heights = np.array([p.low for p in parts]) + tolerance_mm
    packed = (heights, offsets, np.concatenate([p.polygon for p in parts]))
    reach = np.hypot(rows[:, 4], rows[:, 5])[:, None]
    low, high = (rows[:, :2] - reach).min(axis=0), (rows[:, :2] + reach).max(axis=0)
    grid, shape = raster.grid_over(low, high)
    _refuse_too_many(rows, grid, shape, max(capacity.cells, capacity.cells_each * len(rows)))
    moves = np.ascontiguousarray(moves, np.float64)
    kept = _that_matter(moves, since, rows[:, 6], float(heights.min()))
    if not len(kept):
        return np.empty((0, 3), np.int64), 0
    rows, order, upto = rows[kept], order[kept], _there_at(moves, since[kept])
    entries = raster.count_entries(rows, grid, shape)
    found = np.empty((capacity.first, 3), np.int64)
    asked = asked_of(near, beads, order, parts, packed, margins)
    n = int(raster.scan(moves, upto, rows, packed, grid, shape, entries, found, asked))
    move, bead, part = asked[1][:3].tolist()
    if near is not None and move >= 0:
        near.gap_mm, near.move, near.bead = max(0.0, float(asked[0][0])), move, bead
        near.part = parts[part].name
    found = found[:n]
    found[:, 1] = order[found[:, 1]]
    return found, n


def _that_matter(moves: Floats, since: Ints, tops: Floats, least: float) -> Ints:
    """Return the beads that are higher than some part of the head on a move made later.

    A head that prints layer by layer never goes below the top of anything, so there are none.
    """
    lowest = raster.lowest_asked(moves, _there_at(moves, since), tops, least)
    there = np.flatnonzero(since < len(moves))
    return there[tops[there] > lowest[np.maximum(since[there], 0)]]


def _there_at(moves: Floats, since: Ints) -> Ints:
    """Return how many beads are there at each move, (m,); `since` never falls."""
    return np.searchsorted(since, np.arange(len(moves)), side="right")


def _refuse_too_many(rows: Floats, grid: Floats, shape: Ints, most: int) -> None:
    """Raise UndecidedError where beads cover more than `most` cells, counted where they may."""
    across = np.abs(rows[:, 2:4])
    spans = rows[:, 4:5] * across + rows[:, 5:6] * across[:, ::-1]
    if float((2.0 * spans / grid[2] + 2.0).prod(axis=1).sum()) <= most:
        return
    entries = raster.count_entries(rows, grid, shape)
    if entries > most:
        raise UndecidedError(f"beads cover {entries} cells of {grid[2]:g} mm, too many to hold")


def _rectangles(beads: Beads, order: Ints, clearance_mm: float) -> Floats:
    """Return boxes round the beads as the raster takes them, (n, 7), a margin too large."""
    start, end = beads.start[order], beads.end[order]
    along = end[:, :2] - start[:, :2]
    length = np.hypot(along[:, 0], along[:, 1])
    unit = np.where(length[:, None] > 0, along / np.maximum(length, 1e-12)[:, None], [1.0, 0.0])
    rows = np.empty((len(order), 7))
    rows[:, :2] = (start[:, :2] + end[:, :2]) / 2
    rows[:, 2:4] = unit
    rows[:, 5] = beads.width[order] / 2 + clearance_mm + MARGIN_MM
    rows[:, 4] = length / 2 + rows[:, 5]
    rows[:, 6] = np.maximum(start[:, 2], end[:, 2])
    return rows
