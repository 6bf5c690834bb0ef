"""Head against printed material: a growing print and a head that moves through it.

Both one-head G-code and joint plans come here as a list of moves, a list of
beads, and for each bead the first move that may meet it. A head slice k fills
its polygons from tip + height_k upwards and keeps the machine's clearance from beads;
the carriage's bodies are boxes, which only must not touch them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.print.machine import Head, Machine
from sim.faults import Fault, FaultKind
from sim.replay import raster
from sim.replay.collision import HEAD_TOP_MM, Vertices, box_vertices, prism_vertices
from sim.replay.overlap import meets

MARGIN_MM = 0.01  # the middle phase looks this much further than the exact check


@dataclass(frozen=True, slots=True)
class Capacity:
    """How much memory the search for contacts may use."""

    first: int = 1 << 16  # near misses at first; 16 times as many at each further try
    most: int = 1 << 24  # near misses; a print with more is broken, not subtle
    cells: int = 1 << 24  # grid cells that all beads may cover,
    cells_each: int = 64  # or so many for each bead, where that is more


CAPACITY = Capacity()


class UndecidedError(Exception):
    """The judge cannot say; a plan it cannot judge does not pass."""


def or_undecided(check: Callable[[], list[Fault]]) -> list[Fault]:
    """Return what a check finds; one that cannot decide is a fault itself."""
    try:
        return check()
    except UndecidedError as error:
        return [Fault(FaultKind.HEAD_MATERIAL, str(error))]


@dataclass(frozen=True, slots=True)
class Beads:
    """Printed segments in any order, each with the first move that may meet it."""

    start: NDArray[np.float64]  # (n, 3)
    end: NDArray[np.float64]  # (n, 3)
    width: NDArray[np.float64]  # (n,)
    height: NDArray[np.float64]  # (n,)
    since: NDArray[np.int64]  # (n,) index of the first move at which it may be there
    label: NDArray[np.int64]  # (n,) what the caller calls it, e.g. the contour


CENTRELINE_MM = 1e-3
"""Width that stands for a centreline, once the tolerance is taken off both sides."""


def as_material(beads: Beads, machine: Machine, tolerance_mm: float) -> Beads:
    """Return the beads as the machine's model counts them: with their width, or as lines."""
    if machine.bead_width:
        return beads
    return replace(beads, width=np.full_like(beads.width, CENTRELINE_MM + 2 * tolerance_mm))


@dataclass(frozen=True, slots=True)
class Contact:
    """A move in which the head meets a bead."""

    move: int
    bead: int
    part: str  # name of the head part
    depth_mm: float  # how far the bead's top is above the part's lower side


@dataclass(frozen=True, slots=True)
class Part:
    """A convex prism of the head, relative to the tip."""

    name: str
    polygon: NDArray[np.float64]  # (k, 2) counter-clockwise
    low: float
    high: float
    slice: bool = False  # a slice of the head: it has no top, and keeps the clearance

    def vertices(self) -> Vertices:
        """Return its corners."""
        return prism_vertices(self.polygon, self.low, self.high)


def parts_of(head: Head) -> list[Part]:
    """Return the convex parts of a head: every slice polygon and every body."""
    parts = [
        Part(
            f"slice at {s.height_mm:g} mm",
            np.asarray(polygon, np.float64),
            s.height_mm,
            HEAD_TOP_MM,
            slice=True,
        )
        for s in head.slices
        for polygon in s.polygons
    ]
    for body in head.bodies:
        corners = box_vertices(np.array(body.minimum), np.array(body.maximum))[[0, 4, 6, 2], :2]
        parts.append(Part(body.name, corners, body.minimum[2], body.maximum[2]))
    return parts


Allowed = Callable[[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]], NDArray[np.bool_]]
"""Tells of moves, beads, and how far each bead stands above the tip, which may meet."""


Ends = Callable[[NDArray[np.int64], NDArray[np.float64]], NDArray[np.bool_]]
"""Tells which contacts, as pairs of owners (k, 2) and depths (k,), settle a question."""


def over_tip(
    moves: NDArray[np.float64], beads: Beads, move: NDArray[np.int64], bead: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return how far the highest of a bead is above the lowest of the tip on a move, (k,) mm."""
    top = np.maximum(beads.start[bead, 2], beads.end[bead, 2])
    return np.asarray(top - np.minimum(moves[move, 2], moves[move, 5]))


def deepest_contacts(
    moves: NDArray[np.float64],
    owner: NDArray[np.int64],
    beads: Beads,
    head: Head,
    *,
    margins: tuple[float, float],
    ends_at: Ends | None = None,
    capacity: Capacity = CAPACITY,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return which owners of moves meet which beads' owners, and how deep.

    Parameters
    ----------
    owner : (m,) whose each move is, from 0; the beads' owners are their labels
    margins : the clearance kept from beads, and the overlap that counts as touching, mm
    ends_at : which contacts, given as returned, make all others of no interest: where more is
        near than fits, and one of those is among the first, only such are returned

    Returns
    -------
    pairs : (k, 2) owner of moves, owner of beads
    depth : (k,) mm from the tip to the top of the bead, the greatest of all contacts of the pair
    """
    order = np.argsort(beads.since, kind="stable")
    search = Search(moves, beads, parts_of(head), *margins)
    found, total = _candidates(moves, beads, order, search.parts, margins, capacity)
    while total > capacity.first:
        if ends_at is not None:
            deepest = _deepest(search, owner, order, found, ends_at)
            if len(deepest[0]):
                return deepest
        if capacity.first >= capacity.most:
            raise UndecidedError(f"over {capacity.most} near misses in the source's own order")
        capacity = replace(capacity, first=min(16 * capacity.first, capacity.most))
        found, total = _candidates(moves, beads, order, search.parts, margins, capacity)
    return _deepest(search, owner, order, found)


def _deepest(
    search: Search, owner: NDArray[np.int64], order: NDArray[np.int64],
    found: NDArray[np.int64], only: Ends | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:  # fmt: skip
    """Return the pairs of owners that meet, and how deep, of candidates; `only` some of them."""
    moves, beads = search.moves, search.beads
    polygons = [shapely.Polygon(part.polygon) for part in search.parts]
    near = order[found[:, 1]]
    over = over_tip(moves, beads, found[:, 0], near)
    pair = np.stack([owner[found[:, 0]], beads.label[near]], axis=1)
    deepest: dict[tuple[int, int], float] = {}
    wanted = np.ones(len(found), np.bool_) if only is None else only(pair, over)
    ranked = np.lexsort((-over, pair[:, 1], pair[:, 0]))
    for k in ranked[wanted[ranked]].tolist():
        key = (int(pair[k, 0]), int(pair[k, 1]))
        move, _, part = found[k].tolist()
        if (
            key not in deepest
            and _judge(search, move, int(near[k]), part, polygons[part]) is not None
        ):
            deepest[key] = float(over[k])
    pairs = np.array(list(deepest), np.int64).reshape(-1, 2)
    return pairs, np.array(list(deepest.values()), np.float64)


def find_contacts(
    moves: NDArray[np.float64],
    beads: Beads,
    head: Head,
    *,
    clearance_mm: float,
    tolerance_mm: float,
    limit: int,
    capacity: Capacity = CAPACITY,
    allowed: Allowed | None = None,
) -> list[Contact]:
    """Return moves in which a part of the head overlaps a bead by more than the tolerance.

    At most one contact a move is returned, and at most `limit` in all.

    Parameters
    ----------
    moves : (m, 6) start and end of each move in the order they are made
    beads : Beads
    head : Head
    clearance_mm : kept between the head's slices and the beads
    tolerance_mm : overlap that counts as touching, which is allowed
    limit : stop after this many
    capacity : how many near misses and grid cells are held
    allowed : which contacts are none to report; None: all are

    Raises
    ------
    UndecidedError
        When there are too many near misses to judge and no contact among the first, or
        beads too large to hold.
    """
    if not len(beads.start) or not len(moves):
        return []
    order = np.argsort(beads.since, kind="stable")
    parts = parts_of(head)
    margins = (clearance_mm, tolerance_mm)
    while True:
        found, total = _candidates(moves, beads, order, parts, margins, capacity)
        search = Search(moves, beads, parts, clearance_mm, tolerance_mm)
        if allowed is not None:
            near = order[found[:, 1]]
            found = found[~allowed(found[:, 0], near, over_tip(moves, beads, found[:, 0], near))]
        contacts = _judge_all(search, order, found, limit)
        if contacts or total <= capacity.first:
            return contacts
        if capacity.first >= capacity.most:
            raise UndecidedError(
                f"over {capacity.most} near misses of head and material, too many to judge"
            )
        capacity = replace(capacity, first=min(16 * capacity.first, capacity.most))


@dataclass(frozen=True, slots=True)
class Search:
    """What the exact check of one candidate after the other needs."""

    moves: NDArray[np.float64]  # (m, 6)
    beads: Beads
    parts: list[Part]
    clearance_mm: float
    tolerance_mm: float


def _judge_all(
    search: Search, order: NDArray[np.int64], found: NDArray[np.int64], limit: int
) -> list[Contact]:
    """Return which candidates are contacts, one a move, at most `limit`."""
    polygons = [shapely.Polygon(part.polygon) for part in search.parts]
    for polygon in polygons:
        shapely.prepare(polygon)
    contacts: dict[int, Contact] = {}
    for move, at, part in found.tolist():
        if len(contacts) >= limit:
            break
        if move not in contacts:
            depth = _judge(search, move, int(order[at]), part, polygons[part])
            if depth is not None:
                contacts[move] = Contact(move, int(order[at]), search.parts[part].name, depth)
    return list(contacts.values())


def _candidates(
    moves: NDArray[np.float64],
    beads: Beads,
    order: NDArray[np.int64],
    parts: list[Part],
    margins: tuple[float, float],
    capacity: Capacity,
) -> tuple[NDArray[np.int64], int]:
    """Return rows (move, position in `order`, part) to look at closely, and their number.

    With more than `capacity.first` the search stops there, and the number is above that.
    `margins` are the clearance and the tolerance.
    """
    clearance_mm, tolerance_mm = margins
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
    rows, upto = rows[kept], _there_by(since[kept], len(moves))
    entries = raster.count_entries(rows, grid, shape)
    found = np.empty((capacity.first, 3), np.int64)
    n = int(raster.scan(moves, upto, rows, packed, grid, shape, entries, found))
    found = found[:n]
    found[:, 1] = kept[found[:, 1]]
    return found, n


def _there_by(since: NDArray[np.int64], n_moves: int) -> NDArray[np.int64]:
    """Return how many beads, sorted by `since`, may be there at each move, (n_moves,)."""
    return np.searchsorted(since, np.arange(n_moves), side="right")


def _that_matter(
    moves: NDArray[np.float64], since: NDArray[np.int64], tops: NDArray[np.float64], least: float
) -> NDArray[np.int64]:
    """Return the beads that are higher than some part of the head on a move made later.

    A head that prints layer by layer never goes below the top of anything, so there are none.
    """
    lowest = raster.lowest_asked(moves, _there_by(since, len(moves)), tops, least)
    there = np.flatnonzero(since < len(moves))
    return there[tops[there] > lowest[np.maximum(since[there], 0)]]


def _refuse_too_many(
    rows: NDArray[np.float64], grid: NDArray[np.float64], shape: NDArray[np.int64], most: int
) -> None:
    """Raise UndecidedError where beads cover more than `most` cells, counted where they may."""
    across = np.abs(rows[:, 2:4])
    spans = rows[:, 4:5] * across + rows[:, 5:6] * across[:, ::-1]
    if float((2.0 * spans / grid[2] + 2.0).prod(axis=1).sum()) <= most:
        return
    entries = raster.count_entries(rows, grid, shape)
    if entries > most:
        raise UndecidedError(f"beads cover {entries} cells of {grid[2]:g} mm, too many to hold")


def _rectangles(beads: Beads, order: NDArray[np.int64], clearance_mm: float) -> NDArray[np.float64]:
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


def _judge(
    search: Search, move: int, bead: int, number: int, polygon: shapely.Polygon
) -> float | None:
    """Return how far a bead is above the underside of a part that meets it; None if it does not."""
    part, beads = search.parts[number], search.beads
    start, end = beads.start[bead].tolist(), beads.end[bead].tolist()
    row = search.moves[move].tolist()
    reach = float(beads.width[bead]) / 2 + (search.clearance_mm if part.slice else 0.0)
    if not meets(
        (row[:3], row[3:]),
        (start, end),
        float(beads.height[bead]),
        polygon,
        (part.low, math.inf if part.slice else part.high),
        reach=reach,
        tolerance_mm=search.tolerance_mm,
    ):
        return None
    return float(max(start[2], end[2]) - (min(row[2], row[5]) + part.low))


def place_of(move: NDArray[np.float64]) -> str:
    """Return the words for the middle of a move."""
    x, y, z = (move[:3] + move[3:]) / 2
    return f"({x:.2f}, {y:.2f}, {z:.2f})"
