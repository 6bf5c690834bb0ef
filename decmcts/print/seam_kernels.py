"""Where a loop's seam may or should be: corners, rearmost vertices, the seam below.

Rows are indices into a print's flat arrays; `allowed` says for each row whether
its contour may be entered there. A contour's first row always is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.print.loops_kernels import distance_of

CORNER_RAD = np.pi / 6  # gentler turns are no corners
STEP_RAD = np.pi / 36  # corners this much alike are equally sharp


class EnteredLoops(NamedTuple):
    """A print's contours, and where each may be entered."""

    points: Floats  # (n_points, 3) mm
    offsets: Ints  # (n + 1,)
    allowed: Flags  # (n_points,)


@kernel
def along_loop(
    points: Floats, first: int, last: int, at: int, step: int, arm_mm: float
) -> tuple[float, float]:
    """Return the point of a loop `arm_mm` behind (step -1) or ahead (1) of a row, x and y."""
    x, y, row, left = points[at, 0], points[at, 1], at, arm_mm
    for _ in range(last - first + 1):
        to = row + step
        if to < first:
            to = last
        elif to > last:
            to = first
        length = distance_of(points, row, to)
        if length >= left:
            share = left / length
            x += share * (points[to, 0] - x)
            y += share * (points[to, 1] - y)
            return x, y
        left -= length
        x, y, row = points[to, 0], points[to, 1], to
    return x, y


@kernel
def turn_at(points: Floats, first: int, last: int, at: int, arm_mm: float) -> float:
    """Return by how much a loop turns within `arm_mm` of a row, rad, positive to the left."""
    x0, y0 = along_loop(points, first, last, at, -1, arm_mm)
    x1, y1 = along_loop(points, first, last, at, 1, arm_mm)
    ax, ay = points[at, 0] - x0, points[at, 1] - y0
    bx, by = x1 - points[at, 0], y1 - points[at, 1]
    return float(np.arctan2(ax * by - ay * bx, ax * bx + ay * by))


@kernel
def sharpest(loops: EnteredLoops, width: Floats, out: Int32s) -> None:
    """Write each contour's sharpest allowed corner, one to the right first; mutates `out` (n,).

    Slicers print with the material at the left, so a turn to the right is a
    concave corner, where a seam hides. Of equally sharp ones the rearmost; a
    loop without corners keeps its seam.
    """
    points, offsets, allowed = loops
    for c in range(len(out)):
        first, last = offsets[c], offsets[c + 1] - 1
        best, most = first, 0.0
        if not allowed[first + 1 : last].any():
            out[c] = 0
            continue
        for row in range(first, last):
            if not allowed[row]:
                continue
            turn = turn_at(points, first, last, row, width[c])
            if abs(turn) < CORNER_RAD:
                continue
            worth = np.floor(abs(turn) / STEP_RAD) + (1e3 if turn < 0.0 else 0.0)
            if worth > most or (worth == most and points[row, 1] > points[best, 1]):
                best, most = row, worth
        out[c] = best - first


@kernel
def align(
    loops: EnteredLoops,
    movable: Flags,
    role: NDArray[np.int8],
    layers: Ints,
    order: Ints,
    boxes: Floats,
    out: Int32s,
) -> None:
    """Move each seam to the vertex nearest to the seam of the loop below; mutates `out` (n,).

    `order` lists the contours layer by layer, `layers` (k + 1,) where each layer
    begins in it. The loop below is the one of the same role whose box, which must
    overlap, differs least; without one `out` stays as it is.
    """
    for k in range(1, len(layers) - 1):
        for i in range(layers[k], layers[k + 1]):
            c, below, least = order[i], -1, np.inf
            if not movable[c]:
                continue
            for j in range(layers[k - 1], layers[k]):
                b = order[j]
                if not movable[b] or role[b] != role[c]:
                    continue
                apart = (
                    boxes[b, 0] > boxes[c, 2] or boxes[c, 0] > boxes[b, 2]
                    or boxes[b, 1] > boxes[c, 3] or boxes[c, 1] > boxes[b, 3]
                )  # fmt: skip
                unlike = np.abs(boxes[b] - boxes[c]).sum()
                if not apart and unlike < least:
                    below, least = b, unlike
            if below >= 0:
                seam = loops.offsets[below] + out[below]
                out[c] = nearest_row(loops, c, seam) - loops.offsets[c]


@kernel
def nearest_row(loops: EnteredLoops, contour: int, to: int) -> int:
    """Return the allowed row of a contour that is nearest to row `to` in the plane."""
    points, offsets, allowed = loops
    best, least = int(offsets[contour]), np.inf
    for row in range(offsets[contour], offsets[contour + 1]):
        if allowed[row]:
            away = np.hypot(points[row, 0] - points[to, 0], points[row, 1] - points[to, 1])
            if away < least - 1e-9:
                best, least = row, away
    return best


@kernel
def spread(loops: EnteredLoops, width: Floats, most: int, out: Flags) -> None:
    """Choose at most `most` rows of each contour: the first, corners, others evenly; mutates `out`.

    A quarter of the places is for the sharpest corners.
    """
    points, offsets, allowed = loops
    for c in range(len(offsets) - 1):
        first, last = offsets[c], offsets[c + 1] - 1
        if allowed[first : last + 1].sum() <= most:
            out[first : last + 1] = allowed[first : last + 1]
            continue
        out[first] = True
        turn = np.zeros(last + 1 - first)
        way = np.zeros(last + 1 - first)
        for row in range(first + 1, last + 1):
            way[row - first] = way[row - first - 1] + distance_of(points, row - 1, row)
            if allowed[row]:
                turn[row - first] = abs(turn_at(points, first, last, row, width[c]))
        for _ in range(most // 4):
            at = int(np.argmax(turn))
            if turn[at] < CORNER_RAD:
                break
            out[first + at], turn[at] = True, 0.0
        places = most - int(out[first : last + 1].sum())
        at = 0
        for k in range(1, places + 1):
            goal = k * way[-1] / (places + 1)
            while way[at] < goal or not allowed[first + at]:
                if at == last - first:
                    break
                at += 1
            if allowed[first + at]:
                out[first + at] = True
