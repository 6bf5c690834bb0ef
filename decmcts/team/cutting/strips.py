"""Where the heads' territories and their strips lie on each layer.

All heads sweep the same way in step: while one prints a strip, the next prints the strip as
far on in its own territory. Territories and strips are quantiles of the layer's printing time,
so heads are done with a strip at once. As much is shared as the distance between heads allows:
while they print a strip all heads stay apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BIN_MM = 1.0
_HALVINGS = 20  # of the time that is shared, to find the most


@dataclass(frozen=True, slots=True)
class Strips:
    """Strips of one layer along the axis of the heads."""

    begin: Floats  # (heads, steps) mm, where each strip begins
    end: Floats  # (heads, steps) mm
    shared_s: float  # printed by each head while all print
    alone_s: float  # printed between the territories, while others wait

    @property
    def seconds(self) -> float:
        """Time of the layer, cuts not counted."""
        return self.shared_s + self.alone_s


def strips_of_layer(work: Floats, low: float, apart_mm: Floats, heads: int) -> Strips:
    """Return the strips of a layer in which most is shared.

    Parameters
    ----------
    work : (k,)
        Printing time, s, of each `BIN_MM` along the axis from `low` on.
    apart_mm : (steps,)
        So far two heads are apart while they print strip k of their territories.
    """
    steps, total = len(apart_mm), float(work.sum())
    done = np.concatenate([[0.0], np.cumsum(work)])
    least, most = 0.0, total / heads
    if _fits(done, most, apart_mm, heads):
        least = most
    else:
        for _ in range(_HALVINGS):
            shared = (least + most) / 2.0
            fits = _fits(done, shared, apart_mm, heads)
            least, most = (shared, most) if fits else (least, shared)
    begin, end = _edges(done, least, heads, steps)
    return Strips(begin + low, end + low, least, total - heads * least)


def _edges(done: Floats, shared_s: float, heads: int, steps: int) -> tuple[Floats, Floats]:
    """Return where the strips begin and end if so much is shared, from the first bin on."""
    total, share = done[-1], np.linspace(0.0, shared_s, steps + 1)
    first = np.arange(heads) * (total - shared_s) / max(1, heads - 1)
    at = np.interp(first[:, None] + share, done, BIN_MM * np.arange(len(done)))
    return at[:, :-1], at[:, 1:]


def _fits(done: Floats, shared_s: float, apart_mm: Floats, heads: int) -> bool:
    """Tell whether heads that share so much stay apart at every step."""
    begin, end = _edges(done, shared_s, heads, len(apart_mm))
    return bool((begin[1:] - end[:-1] >= apart_mm).all())
