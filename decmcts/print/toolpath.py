"""A toolpath: in which order the contours are printed, and from which end.

The paper's metric, extrusionless travel, is defined here once for everyone but
the judge (`sim` has its own).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.print.contours import Contours
from decmcts.print.loops import exits_of


@dataclass(frozen=True, slots=True)
class Toolpath:
    """An order of (some of) the contours with the direction of each.

    `entry` is the vertex (0-based within the contour) a closed contour is
    entered at; 0 means as sliced. Only freedom `seam` uses other values.
    `turn` ranks the contours of several heads' toolpaths in the order they were
    planned to begin; conflicting ones keep that order. None: no such plan.
    """

    order: Int32s  # (k,) contour ids in printing order
    reversed: Flags  # (k,) aligned with order
    entry: Int32s  # (k,) aligned with order: entry vertex
    turn: Ints | None = None  # (k,) aligned with order, ascending

    def __len__(self) -> int:
        return len(self.order)

    @staticmethod
    def as_sliced(n: int) -> Toolpath:
        """Return the source's own order of `n` contours."""
        return Toolpath(np.arange(n, dtype=np.int32), np.zeros(n, np.bool_), np.zeros(n, np.int32))

    @staticmethod
    def of(order: Int32s, reversed_: Flags) -> Toolpath:
        """Return a toolpath entered at the sliced ends."""
        return Toolpath(
            np.ascontiguousarray(order, np.int32),
            np.ascontiguousarray(reversed_, np.bool_),
            np.zeros(len(order), np.int32),
        )


def entries_by_contour(toolpaths: Sequence[Toolpath], n: int) -> Int32s:
    """Return the entry vertex of each of `n` contours, 0 for those in no toolpath, (n,)."""
    entry = np.zeros(n, np.int32)
    for toolpath in toolpaths:
        entry[toolpath.order] = toolpath.entry
    return entry


def endpoints(contours: Contours, toolpath: Toolpath) -> tuple[Floats, Floats]:
    """Return entry and exit points, each (k, 3), aligned with the order."""
    first, last = contours.start[toolpath.order], contours.end[toolpath.order]
    seam = toolpath.entry > 0
    if seam.any():
        first, last = first.copy(), last.copy()
        order, entry = toolpath.order[seam], toolpath.entry[seam]
        first[seam] = contours.points[contours.offsets[order] + entry]
        last[seam] = exits_of(contours, order, entry)
    is_reversed = toolpath.reversed[:, None]
    return np.where(is_reversed, last, first), np.where(is_reversed, first, last)


def extrusionless_travel(contours: Contours, toolpath: Toolpath) -> float:
    """Return the paper's metric: the 3-D distances from each exit to the next entry, in mm.

    References
    ----------
    Yoo et al. 2020, "Toward Optimal FDM Toolpath Planning with Monte Carlo
    Tree Search", Eq. 2.
    """
    entries, exits = endpoints(contours, toolpath)
    return float(np.linalg.norm(entries[1:] - exits[:-1], axis=1).sum())
