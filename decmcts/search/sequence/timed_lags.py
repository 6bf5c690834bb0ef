"""How much time a sequence must leave between contours that lie on each other.

A search reckons with a fixed time for each contour: its print time and a share of the
source's mean travel, the same for all. Such times are cheap to keep up to date in every
move, and exact enough to find orders that wait little or not at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.print.lags_kernels import Lags
from decmcts.search.sequence.timed_lags_kernels import LagState, keeps_all, retime


@dataclass(frozen=True, slots=True)
class TimedLags:
    """Time lags, and how long each contour takes, in the seconds of a search.

    A path of edges leads from each contour to those over it, and the source keeps the lags.
    """

    lags: Lags
    seconds: Floats  # (n,) from the begin of each contour to that of the next

    @staticmethod
    def kept_by_source(lags: Lags, seconds: Floats) -> TimedLags:
        """Return each lag, or the time the source leaves by these times where that is less."""
        ended = np.cumsum(seconds)
        above = _above(lags)
        given = ended[above] - seconds[above] - ended[lags.below]
        return TimedLags(lags._replace(seconds=np.clip(given, 0.0, lags.seconds)), seconds)

    def keeps(self, order: Int32s) -> bool:
        """Say whether a sequence of all contours leaves enough time everywhere."""
        return bool(keeps_all(order, *self.lags, self.seconds))

    def state(self, order: Int32s, ids: Int32s) -> LagState:
        """Return what moves need, for contours renumbered: number k is contour `ids[k]`, all n.

        `order` is a sequence of these numbers.
        """
        n, lags = len(ids), self.lags
        number = np.empty(n, np.int32)
        number[ids] = np.arange(n, dtype=np.int32)
        below = number[lags.below]
        above = number[_above(lags)]
        state = LagState(
            *_rows(above, below, lags.seconds, n),
            *_rows(below, above, lags.seconds, n),
            float(lags.seconds.max(initial=0.0)),
            self.seconds[ids],
            np.zeros(n),
        )
        retime(state, order, 0, n)
        return state


def no_timed_lags(n: int) -> TimedLags:
    """Return the times of n contours and no lag between them."""
    lags = Lags(np.zeros(n + 1, np.int64), np.empty(0, np.int32), np.empty(0))
    return TimedLags(lags, np.ones(n))


def no_lag_state() -> LagState:
    """Return what moves need where nothing has to be kept."""
    offsets, ids, seconds = np.zeros(1, np.int64), np.empty(0, np.int32), np.empty(0)
    return LagState(offsets, ids, seconds, offsets, ids, seconds, 0.0, seconds, seconds)


def _above(lags: Lags) -> Ints:
    """Return the contour that each lag is for, (m,)."""
    return np.repeat(np.arange(len(lags.offsets) - 1), np.diff(lags.offsets))


def _rows(key: Int32s, value: Int32s, seconds: Floats, n: int) -> tuple[Ints, Int32s, Floats]:
    """Return pairs as compressed rows by `key`."""
    order = np.argsort(key, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(key, minlength=n))]).astype(np.int64)
    return offsets, value[order].astype(np.int32), seconds[order]
