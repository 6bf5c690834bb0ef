"""Contacts of heads with what is printed at that time.

Moves are looked at in the order in which they end. Each is held against the print as it then
stands, part of the head by part, and then its own bead is laid
(`print_search`). A cell of the print has one point, its highest. So a contact is never made up,
and one may be missed that is less deep than a cell at the edge of a part. Nobody lays a bead within
a head that stands still: the other's nozzle would be there.

What a head touched when the print was sliced it may touch here. In its source's own order a head
may go into a bead by the height of that bead (the ramp of a scarf seam beside its wall), and on one
layer that is not flat deeper. So it may here, where the bead comes first in the source too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours
from decmcts.print.machine import Head
from decmcts.print.plan import ActionKind, PlanDocument
from sim.controllers.carry_out import HeadRun
from sim.controllers.nearness import shape_of
from sim.controllers.print_search import COLUMNS, Moves, Prisms, bare, go_through
from sim.controllers.program import STILL_MM, HeadProgram
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
    """Return the moves of all heads, and as moves of nobody what stands there from the begin."""
    rows, n = [], 0
    for h, (program, run, beads) in enumerate(zip(programs, runs, material.beads, strict=True)):
        m = len(program.feed)
        moved = (np.diff(program.points, axis=0) != 0.0).any(axis=1)
        looked_at = moved & (run.begin >= begin_s) & beads.looked_at
        rows.append(
            (program.points, n + np.arange(m), np.full(m, h), run.begin, run.end, beads.lays,
             looked_at, beads.number, beads.layer, beads.height, beads.half)
        )  # fmt: skip
        n += len(program.points)
    if (before := material.before) is not None:
        contour = np.repeat(np.arange(len(before)), np.diff(before.offsets))
        row = np.flatnonzero(np.diff(contour) == 0)
        of, m = contour[row], len(row)
        early = np.full(m, -np.inf)
        rows.append(
            (before.points, n + row, np.full(m, -1), early, early, np.ones(m, np.bool_),
             np.zeros(m, np.bool_), np.full(m, BEFORE), np.full(m, NO_LAYER), before.height[of],
             before.width[of] / 2)
        )  # fmt: skip
    columns: list[Any] = [np.concatenate(column) for column in zip(*rows, strict=True)]
    widest = float(columns[-1].max(initial=0.0))
    return Moves(*[*columns, widest])


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


BEFORE = -1  # number of all that stands on the bed before the print begins
TRAVEL = -2  # number of moves that print nothing: they touch nothing in the source
NO_LAYER = -1
MOST_HEIGHT_MM = 1.0  # of a bead of a file, which does not say
ROUNDING_MM = 1e-3


@dataclass(frozen=True, slots=True)
class MoveBeads:
    """Of the moves of one head."""

    number: Ints  # (m,) of the contour each prints, in the source's order, or TRAVEL
    layer: Ints  # (m,) of the source; NO_LAYER: not known
    height: Floats  # (m,) mm of its bead
    half: Floats  # (m,) mm, half of its bead's width; 0: the centreline counts
    lays: Flags  # (m,) whether it lays a bead
    looked_at: Flags  # (m,) whether it may not touch the print


@dataclass(frozen=True, slots=True)
class Material:
    """All that a head may meet."""

    beads: tuple[MoveBeads, ...]  # of each program
    named: bool  # whether numbers are those of a plan's contours
    before: Contours | None = None  # what stands there from the beginning


def material_of_plan(document: PlanDocument, programs: Sequence[HeadProgram]) -> Material:
    """Return what programs made of a plan's own actions lay."""
    contours, found = document.contours, []
    wide = 0.5 if document.machine.bead_width else 0.0
    for actions, program in zip(document.plan.heads, programs, strict=True):
        prints = actions.kind[program.action] == ActionKind.PRINT
        contour = np.where(prints, actions.contour[program.action], 0).astype(np.int64)
        number = _with_ways(np.where(prints, contour, TRAVEL), program)
        known = np.maximum(number, 0)
        layer = np.where(number >= 0, contours.layer[known], NO_LAYER).astype(np.int64)
        found.append(
            MoveBeads(
                number, layer, contours.height[contour], wide * contours.width[contour],
                prints & (program.filament > STILL_MM), np.ones(len(number), np.bool_),
            )
        )  # fmt: skip
    return Material(tuple(found), True, document.printed)


def _with_ways(number: Ints, program: HeadProgram) -> Ints:
    """Return numbers of moves; those straight up or down beside a print have that print's."""
    step = np.diff(program.points, axis=0)
    upright = (number == TRAVEL) & (step[:, :2] == 0.0).all(axis=1)
    every, found = np.arange(len(number)), number.copy()
    for turn in (slice(None), slice(None, None, -1)):
        own, up = number[turn], upright[turn]
        last = np.maximum.accumulate(np.where(up, -1, every))
        beside = own[np.maximum(last, 0)]
        found[turn] = np.where(up & (last >= 0), np.maximum(found[turn], beside), found[turn])
    return found


def material_of_files(programs: Sequence[HeadProgram]) -> Material:
    """Return what programs of files lay: lines, as high as the largest step between two layers.

    A file says neither widths nor which order is its source's, so each bead may be touched to its
    height. What rises or falls by more than that is no bead: start codes push filament into the
    air. They also wipe the nozzle on what they print; they end where the slicer's comments name the
    first layer.
    """
    heights = [program.points[1:, 2][program.prints] for program in programs]
    levels = np.unique(np.concatenate([[0.0], *heights]).round(3))
    height = min(float(np.diff(levels[levels >= 0.0]).max(initial=0.0)), MOST_HEIGHT_MM)
    found = []
    for program in programs:
        m = len(program.feed)
        level = np.abs(np.diff(program.points[:, 2])) <= height + ROUNDING_MM
        found.append(
            MoveBeads(
                np.zeros(m, np.int64), np.full(m, NO_LAYER), np.full(m, height), np.zeros(m),
                program.prints & level, program.line >= program.first_layer,
            )
        )  # fmt: skip
    return Material(tuple(found), False)
