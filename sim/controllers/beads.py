"""What the moves of programs lay, and what a head may touch of it as it did when it was sliced.

In its source's own order a head may go into a bead by the height of that bead (the ramp of a scarf
seam beside its wall), and on one layer that is not flat deeper. So it may here, where the bead
comes first in the source too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, PlanDocument
from sim.arrays import Flags, Floats, Ints
from sim.controllers.program import STILL_MM, HeadProgram

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
    return Material(tuple(_lines(program, height) for program in programs), False)


def _lines(program: HeadProgram, height: float) -> MoveBeads:
    m = len(program.feed)
    level = np.abs(np.diff(program.points[:, 2])) <= height + ROUNDING_MM
    return MoveBeads(
        np.zeros(m, np.int64), np.full(m, NO_LAYER, np.int64), np.full(m, height), np.zeros(m),
        program.prints & level, program.line >= program.first_layer,
    )  # fmt: skip
