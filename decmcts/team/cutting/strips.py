"""Where the heads' territories and their strips lie on each layer.

All heads sweep the same way in step: while one prints a strip, the next prints the strip as
far on in its own territory. Strips of one step take as long, so heads are done with them at
once. As much is shared as the distance between heads allows: while they print a strip all
heads stay apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats
from decmcts.team.cutting.strips_kernels import share_layer

BIN_MM = 1.0


@dataclass(frozen=True, slots=True)
class Strips:
    """Strips of one layer along the axis of the heads."""

    begin: Floats  # (heads, steps) mm, where each strip begins
    end: Floats  # (heads, steps) mm
    shared_s: float  # printed by each head while all print
    alone_s: float  # printed between two territories, while others wait; the most

    @property
    def seconds(self) -> float:
        """Time of the layer."""
        return self.shared_s + self.alone_s


def strips_of_layer(
    work: Floats, price: Floats, low: float, apart_mm: Floats, heads: int
) -> Strips:
    """Return the strips of a layer in which most is shared.

    Parameters
    ----------
    work : (k,)
        Printing time, s, of each `BIN_MM` along the axis from `low` on.
    price : (k - 1,)
        Time, s, that a cut between two bins costs on either side of it.
    apart_mm : (steps,)
        So far two heads are apart while they print strip k of their territories.
    """
    used = np.flatnonzero(work)
    first, last = (int(used[0]), int(used[-1]) + 1) if len(used) else (0, 1)
    done = np.concatenate([[0.0], np.cumsum(work[first:last])])
    cost = np.concatenate([[0.0], price[first : last - 1], [0.0]])
    begin, end = np.empty((heads, len(apart_mm))), np.empty((heads, len(apart_mm)))
    seconds = share_layer(done, cost, apart_mm / BIN_MM, begin, end)
    places = np.arange(len(done))
    borders = np.stack([end[:-1, -1], begin[1:, 0]], axis=1)
    alone = np.diff(np.interp(borders, places, done), axis=1)[:, 0]
    alone = alone + np.interp(borders, places, cost).sum(axis=1) * (np.diff(borders)[:, 0] > 0.0)
    origin = low + first * BIN_MM
    return Strips(
        origin + begin * BIN_MM, origin + end * BIN_MM, seconds,
        float(alone.max(initial=0.0)),
    )  # fmt: skip
