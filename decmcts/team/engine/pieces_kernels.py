"""What is left of a contour's space as its print goes on, on bare arrays.

From a vertex on, a print needs only the space of the vertices still to come. Where
that shrinks by a good deal another head can be let in: such a vertex begins a
*piece*. A piece's space holds all later ones, so spaces of a print only shrink.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import kernel


class Pieces(NamedTuple):
    """Pieces of every contour, along it and then the other way."""

    offsets: NDArray[np.int64]  # (2 n + 1,) contour c along is row 2 c, back row 2 c + 1
    space: NDArray[np.float64]  # (k, 6)
    share: NDArray[np.float64]  # (k,) share of the contour's length that lies before
    point: NDArray[np.int32]  # (k,) vertex of the path it begins at


@kernel
def spaces_left(
    points: NDArray[np.float64], is_reversed: bool, space: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Write to `space` (m, 6) what is left from each vertex on; returns the length before it."""
    m = len(points)
    before = np.zeros(m)
    for i in range(m - 1, -1, -1):
        p = points[m - 1 - i] if is_reversed else points[i]
        for axis in range(3):
            low, high = p[axis], p[axis]
            if i < m - 1:
                low = min(low, space[i + 1, 2 * axis])
                high = max(high, space[i + 1, 2 * axis + 1])
            space[i, 2 * axis], space[i, 2 * axis + 1] = low, high
    for i in range(1, m):
        p = points[m - 1 - i] if is_reversed else points[i]
        q = points[m - i] if is_reversed else points[i - 1]
        before[i] = before[i - 1] + np.sqrt(np.sum((p - q) ** 2))
    return before


@kernel
def cut(space: NDArray[np.float64], step: float, most: int, chosen: NDArray[np.int32]) -> int:
    """Write to `chosen` the vertices where pieces begin; returns how many."""
    chosen[0], count = 0, 1
    for i in range(1, len(space) - 1):
        if count >= most:
            break
        held, left = space[chosen[count - 1]], space[i]
        shrinks = max(left[0] - held[0], held[1] - left[1], left[2] - held[2], held[3] - left[3])
        if shrinks >= step:
            chosen[count] = i
            count += 1
    return count


@kernel
def cut_pieces(
    points: NDArray[np.float64],
    offsets: NDArray[np.int64],
    reversible: NDArray[np.bool_],
    step: float,
    most: int,
) -> Pieces:
    """Cut every contour, both ways where it may be printed back, at most into `most` pieces.

    A piece begins where the space has shrunk by `step` mm along x or y; `most` 1: none does.
    """
    n = len(offsets) - 1
    first = np.zeros(2 * n + 1, np.int64)
    space, share = np.empty((2 * n + 16, 6)), np.empty(2 * n + 16)
    point = np.empty(2 * n + 16, np.int32)
    chosen = np.empty(most, np.int32)
    used = 0
    for row in range(2 * n):
        c, back = row // 2, row % 2 == 1
        if reversible[c] or not back:
            path = points[offsets[c] : offsets[c + 1]]
            left = np.empty((len(path), 6))
            before = spaces_left(path, back, left)
            count = cut(left, step, most, chosen)
            while used + count > len(share):
                space, share = np.concatenate((space, space)), np.concatenate((share, share))
                point = np.concatenate((point, point))
            for k in range(count):
                i = chosen[k]
                space[used], point[used] = left[i], i
                share[used] = before[i] / before[-1] if before[-1] > 0.0 else 0.0
                used += 1
        first[row + 1] = used
    return Pieces(first, space[:used].copy(), share[:used].copy(), point[:used].copy())
