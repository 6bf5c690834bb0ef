"""Contacts of heads with what is printed at that time.

Moves are looked at in the order in which they end. Each is held against the print as it then
stands, part of the head by part, and then its own bead is laid
(`print_search`). A cell of the print has one point, its highest. So a contact is never made up,
and one may be missed that is less deep than a cell at the edge of a part. Nobody lays a bead within
a head that stands still: the other's nozzle would be there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from decmcts.print.contours import Contours
from decmcts.print.machine import Head
from sim.arrays import Floats, Ints
from sim.controllers.beads import BEFORE, NO_LAYER, Material, MoveBeads
from sim.controllers.carry_out import HeadRun
from sim.controllers.nearness import shape_of
from sim.controllers.print_search import COLUMNS, Moves, Prisms, bare, go_through
from sim.controllers.program import HeadProgram
from sim.replay.shapes import parts_of

WIDER_MM = 5.0  # a head counts as wider from here above the tip at the latest
MOST = 100  # contacts of a run: then no more is looked for


@dataclass(frozen=True, slots=True)
class PrintContact:
    """A head that goes into what is printed."""

    head: int
    time_s: float
    seconds: float
    depth_mm: float  # from the part's lower side to the top of the bead, the most of it
    part: str  # of the head
    at: tuple[float, float, float]  # of the nozzle
    spot: tuple[float, float, float]  # of the bead
    contour: int  # of the plan that is printed meanwhile; -1: none, or not known
    line: int  # of the head's file; 0: none
    by: int  # head that printed the bead; -1: it stood there from the beginning
    bead: int  # contour of the plan that is met; -1: not known
    bead_line: int


def print_contacts(
    programs: Sequence[HeadProgram], runs: Sequence[HeadRun], heads: Sequence[Head],
    material: Material, *, clearance_mm: float, begin_s: float, end_s: float,
) -> tuple[PrintContact, ...]:  # fmt: skip
    """Return where heads touch the print from one time to another, `MOST` at most.

    Moves before `begin_s` lay beads, but are not looked at themselves.
    """
    moves, parts = _moves(programs, runs, material, begin_s), _parts(heads, clearance_mm)
    laid = moves.points[moves.row[moves.lays]], moves.points[moves.row[moves.lays] + 1]
    if not moves.lays.any() or not len(parts.low):
        return ()
    ends = np.concatenate(laid)
    heights = bare(ends.min(axis=0), ends.max(axis=0))
    order = np.argsort(moves.end, kind="stable")
    order = order[: np.searchsorted(moves.end[order], end_s, side="right")]
    found = np.zeros((MOST, COLUMNS))
    n = go_through(order, moves, parts, heights, len(heads), found)
    names = [[part.name for part in parts_of(head)] for head in heads]
    first = np.cumsum([0, *(len(program.feed) for program in programs)])
    return tuple(_contact(row, programs, material, moves, names, first) for row in found[:n])


def _moves(
    programs: Sequence[HeadProgram], runs: Sequence[HeadRun], material: Material, begin_s: float
) -> Moves:
    found = [
        _moves_of(h, *each, begin_s)
        for h, each in enumerate(zip(programs, runs, material.beads, strict=True))
    ]
    return _joined(found if material.before is None else [*found, _standing(material.before)])


def _moves_of(
    h: int, program: HeadProgram, run: HeadRun, beads: MoveBeads, begin_s: float
) -> Moves:
    """Return the moves of one head."""
    m = len(program.feed)
    moved = (np.diff(program.points, axis=0) != 0.0).any(axis=1)
    return Moves(
        program.points, np.arange(m), np.full(m, h), run.begin, run.end, beads.lays,
        moved & (run.begin >= begin_s) & beads.looked_at, beads.number, beads.layer,
        beads.height, beads.half, float(beads.half.max(initial=0.0)),
    )  # fmt: skip


def _standing(contours: Contours) -> Moves:
    """Return what stands there from the beginning, as moves of nobody."""
    contour = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    row = np.flatnonzero(np.diff(contour) == 0)
    of, m = contour[row], len(row)
    half = contours.width[of] / 2
    early, nobody = np.full(m, -np.inf), np.full(m, -1)
    return Moves(
        contours.points, row, nobody, early, early, np.ones(m, np.bool_), np.zeros(m, np.bool_),
        np.full(m, BEFORE), np.full(m, NO_LAYER), contours.height[of], half,
        float(half.max(initial=0.0)),
    )  # fmt: skip


def _joined(every: Sequence[Moves]) -> Moves:
    """Return moves one after another."""
    base = np.cumsum([0, *(len(each.points) for each in every)])
    row = np.concatenate([each.row + first for each, first in zip(every, base, strict=False)])
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(each, name) for each in every])
        for name in Moves._fields if name not in ("row", "widest")
    }  # fmt: skip
    return Moves(row=row, widest=max(each.widest for each in every), **columns)


def _parts(heads: Sequence[Head], clearance_mm: float) -> Prisms:
    shapes = [shape_of(head) for head in heads]
    sizes = [np.diff(shape.offsets) for shape in shapes]
    reach = [
        np.array([clearance_mm if part.slice else 0.0 for part in parts_of(head)]) for head in heads
    ]
    wider = [min([WIDER_MM, *shape.low[shape.low > 0.0].tolist()]) for shape in shapes]
    return Prisms(
        np.cumsum([0, *(len(shape.low) for shape in shapes)]),
        np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.int64),
        np.concatenate([shape.corners for shape in shapes]),
        np.concatenate([shape.low for shape in shapes]),
        np.concatenate(reach), np.array(wider),
    )  # fmt: skip


def _contact(
    row: Floats, programs: Sequence[HeadProgram], material: Material, moves: Moves,
    names: Sequence[Sequence[str]], first: Ints,
) -> PrintContact:  # fmt: skip
    begin, end, depth = row[:3].tolist()
    part, i, met = row[3:6].astype(np.int64).tolist()
    h, by = int(moves.head[i]), int(moves.head[met])
    contour, bead = (int(moves.number[k]) if material.named else -1 for k in (i, met))
    line = int(programs[h].line[i - first[h]])
    bead_line = int(programs[by].line[met - first[by]]) if by >= 0 else 0
    x, y, z, u, v, w = row[6:12].tolist()
    return PrintContact(
        h, begin, end - begin, depth, names[h][part], (x, y, z), (u, v, w),
        contour if moves.lays[i] else -1, line, by, max(bead, -1), bead_line,
    )  # fmt: skip
