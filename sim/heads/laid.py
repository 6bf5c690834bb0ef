"""What a head's file lays down, against the contours of the source."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from decmcts.formats.gcode import GcodeDocument
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.print.contours import Contours

SAME_MM = 1.1e-3  # files have three decimals
E_MM = 5e-5
FEED_MM_S = 1e-3


class ContourMoves(NamedTuple):
    """A contour that a file prints: moves begin..end - 1."""

    contour: int
    begin: int
    end: int


def pairs_of_states(
    beads: Sequence[tuple[int, bool, int]], motion: Motion, state: Sequence[int],
    contours: Contours, document: GcodeDocument,
) -> list[tuple[int, int]] | None:  # fmt: skip
    """Return the states of the file and of the source that go together; None if moves differ.

    Parameters
    ----------
    beads : sequence
        Contours entered as sliced, whether reversed, and the first move of each. All its moves
        are there.
    motion, state
        The file's moves, and the row of the states in force at each, (m,).
    contours, document
        The source.
    """
    if not beads:
        return []
    (contour, is_reversed, first), offsets = np.array(beads, np.int64).T, contours.offsets
    begin, count = offsets[contour], offsets[contour + 1] - offsets[contour] - 1
    step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    move = np.repeat(first, count) + step
    back = np.repeat(is_reversed, count)
    segment = np.where(
        back == 1, np.repeat(begin + count, count) - step, np.repeat(begin, count) + 1 + step
    )  # as contours number them, by their last point
    if (
        (np.abs(motion.points[move + 1] - contours.points[segment - back]) > SAME_MM).any()
        or (np.abs(motion.extrusion[move] - contours.extrusion[segment]) > E_MM).any()
        or (np.abs(motion.feed[move] - contours.feed[segment]) > FEED_MM_S).any()
    ):
        return None
    mine, due = np.asarray(state, np.int64)[move], document.point_state[segment]
    rows = len(document.states.rows)
    return [divmod(pair, rows) for pair in np.unique(mine * rows + due).tolist()]
