"""Where closed contours may be entered: the seam policies, as slicers name them.

`nearest` leaves a choice to whoever shortens the travel; the others say where
the seam is. How a contour runs from there is `decmcts.print.loops`'s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.print.contours import Contours
from decmcts.print.loops import allowed_entries, exits_of, movable
from decmcts.print.seam_kernels import EnteredLoops, align, sharpest, spread

SeamPolicy = Literal["nearest", "aligned", "rear", "corner"]
MOST_ENTRIES = 32  # of one contour


@dataclass(frozen=True, slots=True)
class SeamEntries:
    """The vertices each contour may be entered at.

    Contour c owns vertices[offsets[c]:offsets[c + 1]], at least one, ascending.
    A contour that may not be entered elsewhere has 0 alone: as sliced.
    """

    offsets: Ints  # (n + 1,)
    vertices: Int32s  # (m,) numbers of points within the contour, from 0

    def contour(self) -> Int32s:
        """Return the contour of each vertex, (m,)."""
        n = len(self.offsets) - 1
        return np.repeat(np.arange(n, dtype=np.int32), np.diff(self.offsets))


def seam_entries(contours: Contours, policy: SeamPolicy = "nearest") -> SeamEntries:
    """Return where each contour may be entered.

    Parameters
    ----------
    policy : {"nearest", "aligned", "rear", "corner"}
        nearest: any of at most `MOST_ENTRIES` vertices, the slicer's own (0), the
        sharpest corners and others evenly along the loop. The rest name one vertex:
        rear the one with the largest y; corner the sharpest, concave ones first;
        aligned the one nearest to the seam of the loop below, and the corner where
        nothing is below.

    Raises
    ------
    ValueError
        If the policy is unknown.
    """
    if policy not in get_args(SeamPolicy):
        raise ValueError(
            f"seam policy is {policy!r}, expected one of {', '.join(get_args(SeamPolicy))}"
        )
    points, offsets = contours.points, contours.offsets
    loops = EnteredLoops(points, offsets, allowed_entries(contours))
    if policy == "nearest":
        chosen = np.zeros(len(points), np.bool_)
        spread(loops, contours.width, MOST_ENTRIES, chosen)
        rows = np.flatnonzero(chosen)
        owner = np.searchsorted(offsets, rows, side="right") - 1
        counts = np.bincount(owner, minlength=len(contours))
        vertices = rows - offsets[owner]
    else:
        counts = np.ones(len(contours), np.int64)
        vertices = _one_each(contours, loops, policy)
    return SeamEntries(
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), vertices.astype(np.int32)
    )


def entry_points(contours: Contours, entries: SeamEntries) -> Floats:
    """Return where the nozzle enters at each vertex, (m, 3)."""
    return np.asarray(contours.points[contours.offsets[entries.contour()] + entries.vertices])


def exit_points(contours: Contours, entries: SeamEntries) -> Floats:
    """Return where a contour entered at each vertex ends, (m, 3): a seam's gap before it."""
    return exits_of(contours, entries.contour(), entries.vertices)


def _one_each(contours: Contours, loops: EnteredLoops, policy: SeamPolicy) -> Int32s:
    """Return the one vertex a policy names for each contour, (n,)."""
    vertices = np.zeros(len(contours), np.int32)
    if policy == "rear":
        y, first = np.where(loops.allowed, contours.points[:, 1], -np.inf), contours.offsets[:-1]
        rearmost = np.repeat(np.maximum.reduceat(y, first), np.diff(contours.offsets))
        rows = np.flatnonzero(y == rearmost)
        return (rows[np.searchsorted(rows, first)] - first).astype(np.int32)
    sharpest(loops, contours.width, vertices)
    if policy == "aligned" and len(contours):
        order = np.argsort(contours.layer, kind="stable").astype(np.int64)
        begins = np.flatnonzero(np.diff(contours.layer[order], prepend=-1))
        layers = np.append(begins, len(order)).astype(np.int64)
        flat, rows = contours.points[:, :2], contours.offsets[:-1]
        boxes = np.hstack([np.minimum.reduceat(flat, rows), np.maximum.reduceat(flat, rows)])
        align(loops, movable(contours), contours.role, layers, order, boxes, vertices)
    return vertices
