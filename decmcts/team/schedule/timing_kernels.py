"""Actions of a head as moves for the time model, on bare arrays.

Writes what the G-code writer will: prints with the filament, feed and limits of
each segment in its traversal, travels with wipe, retraction and priming.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel

EXTRA = 6  # moves a travel may need beside its path


class ContourSegments(NamedTuple):
    """The contours' segments in their traversal, by the point each ends at."""

    offsets: Ints  # (n + 1,)
    filament: Floats  # (n_points,)
    feed: Floats  # (n_points,)
    row: Int32s  # (n_points,) of the limits


class Habit(NamedTuple):
    """How travels are made."""

    feed: float
    z_feed: float  # of moves in Z alone
    pull_mm: float  # filament retracted at rest
    pull_feed: float
    push_mm: float
    push_feed: float
    wipe_mm: float  # length of the wipe, there and back
    wipe_filament: float
    wipe_feed: float


class WrittenMoves(NamedTuple):
    """Moves being written; `used[0]` of them are."""

    points: Floats  # (m + 1, 3)
    filament: Floats  # (m,)
    feed: Floats  # (m,)
    row: Int32s  # (m,)
    action: Ints  # (m,)
    used: Ints  # (1,)


@kernel
def add_move(
    x: float,
    y: float,
    z: float,
    filament: float,
    feed: float,
    row: int,
    action: int,
    moves: WrittenMoves,
) -> None:
    """Append one move (mutates moves)."""
    i = moves.used[0]
    moves.points[i + 1, 0], moves.points[i + 1, 1], moves.points[i + 1, 2] = x, y, z
    moves.filament[i], moves.feed[i] = filament, feed
    moves.row[i], moves.action[i] = row, action
    moves.used[0] += 1


@kernel
def add_print(
    path: Floats, contour: int, is_reversed: bool, action: int,
    segments: ContourSegments, moves: WrittenMoves,
) -> None:  # fmt: skip
    """Append the segments of a contour in its traversal (mutates moves)."""
    first = segments.offsets[contour] + 1
    n = segments.offsets[contour + 1] - first
    for s in range(min(n, len(path) - 1)):
        at = first + (n - 1 - s if is_reversed else s)
        x, y, z = path[s + 1]
        add_move(x, y, z, segments.filament[at], segments.feed[at], segments.row[at], action, moves)


@kernel
def _back(moves: WrittenMoves) -> tuple[float, float]:
    """Return the direction from where the last move that went anywhere in the plane ended, back."""
    for i in range(moves.used[0], 0, -1):
        x = moves.points[i - 1, 0] - moves.points[i, 0]
        y = moves.points[i - 1, 1] - moves.points[i, 1]
        length = np.sqrt(x * x + y * y)
        if length > 0.0:
            return x / length, y / length
    return 1.0, 0.0


@kernel
def add_travel(
    path: Floats,
    retracts: bool,
    after_print: bool,
    action: int,
    habit: Habit,
    moves: WrittenMoves,
) -> None:
    """Append a travel with what the writer puts before and behind it (mutates moves)."""
    pulls = habit.push_mm > 0.0 and retracts
    x, y, z = path[0]
    if pulls and after_print and habit.wipe_mm > 0.0:
        add_move(x, y, z, -habit.pull_mm, habit.pull_feed, 0, action, moves)
        share, half = -0.5 * habit.wipe_filament, 0.5 * habit.wipe_mm
        along_x, along_y = _back(moves)
        to_x, to_y = x + half * along_x, y + half * along_y
        add_move(to_x, to_y, z, share, habit.wipe_feed, 0, action, moves)
        add_move(x, y, z, share, habit.wipe_feed, 0, action, moves)
    elif pulls:
        add_move(x, y, z, -habit.push_mm, habit.pull_feed, 0, action, moves)
    for i in range(1, len(path)):
        upright = path[i, 0] == path[i - 1, 0] and path[i, 1] == path[i - 1, 1]
        feed = habit.z_feed if upright else habit.feed
        add_move(path[i, 0], path[i, 1], path[i, 2], 0.0, feed, 0, action, moves)
    if pulls:
        x, y, z = path[len(path) - 1]
        add_move(x, y, z, habit.push_mm, habit.push_feed, 0, action, moves)


@kernel
def write_moves(
    path: Floats, offsets: Ints, contour: Int32s, is_reversed: Flags, retracts: Flags,
    segments: ContourSegments, habits: Floats, of: Ints,
) -> WrittenMoves:  # fmt: skip
    """Return the moves of a head's actions; `contour` is -1 where an action prints nothing.

    `retracts` (k,) says which travels are retracted, and `of` (k,) in which of the `habits`,
    (h, 9) as the fields of `Habit`.
    """
    k = len(contour)
    most = len(path) + EXTRA * k
    moves = WrittenMoves(
        np.zeros((most + 1, 3)), np.zeros(most), np.zeros(most), np.zeros(most, np.int32),
        np.zeros(most, np.int64), np.zeros(1, np.int64),
    )  # fmt: skip
    if len(path):
        moves.points[0] = path[0]
    for a in range(k):
        way = path[offsets[a] : offsets[a + 1]]
        if contour[a] >= 0:
            add_print(way, contour[a], is_reversed[a], a, segments, moves)
        elif len(way):
            h = habits[of[a]]
            habit = Habit(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8])
            add_travel(way, retracts[a], a > 0 and contour[a - 1] >= 0, a, habit, moves)
    return moves
