"""Exclusive travels: sets of which every order uses one at most.

Where all of one layer must be printed before any of the next, an order climbs from
one layer to the other once. A bound that looks at single travels does not know that:
it may take the cheap travel upwards at every contour. Exclusive travels are such a set, here
of all travels upwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from decmcts.arrays import Flags, Int32s, Ints

MOST_MEMBERS = 2_000_000  # travels in all pairs of sets together
MOST_LOOKS = 100_000_000  # pairs of contours asked for their order, some 2 s


@dataclass(frozen=True, slots=True)
class ExclusiveTravels:
    """Travels from contours to direct successors, and the sets of which one is used at most."""

    keys: Ints  # (p,) sorted, tail · n + head
    of: csr_array  # (p, exclusive travels) 1.0 where the travel is in the set

    @property
    def count(self) -> int:
        """Number of sets."""
        return int(self.of.shape[1])


def find_exclusive_travels(
    before: NDArray[np.uint64],
    offsets: Ints,
    covers: Int32s,
    *,
    most_members: int = MOST_MEMBERS,
    most_looks: int = MOST_LOOKS,
) -> ExclusiveTravels:
    """Return the travels from A to B for sets with a ≺ b for all a in A, b in B; and bends.

    An order travels from A to B at most once: if it leads from a to b, all of A is
    printed by then, for it precedes b, and none of B is, for it follows a; so a is
    the last of A and b the first of B.

    A is taken from the direct predecessors of each contour, and from what precedes
    all direct successors of each; B is all that follows A, as far as travels can
    lead there, and A is then made as large as B allows. Sets of one contour say
    nothing new.

    Parameters
    ----------
    before : (n, ceil(n / 64))
        Bits of all that precedes a contour.
    offsets, covers : (n + 1,), (m,)
        Direct predecessors.
    most_members : int
        Travels in all sets together at which the search ends.
    most_looks : int
        Pairs of contours asked for their order, at which it ends too.
    """
    n = len(offsets) - 1
    preds = [covers[offsets[b] : offsets[b + 1]].astype(np.int64) for b in range(n)]
    found: dict[bytes, Ints] = {}
    inside, members = np.zeros(n, np.bool_), 0
    for tails, heads in _seeds(before, preds, most_looks):
        heads = heads[_precede(before, tails, heads).all(axis=0)]
        if len(heads) < 2:
            continue
        tails = _union(preds, heads)
        tails = tails[_precede(before, tails, heads).all(axis=1)]
        inside[tails] = True
        keys = np.sort(np.concatenate([preds[b][inside[preds[b]]] * n + b for b in heads]))
        inside[tails] = False
        members += 0 if keys.tobytes() in found else len(keys)
        if members > most_members:
            break
        found[keys.tobytes()] = keys
    for keys in _bends(before, preds, most_looks):
        members += len(keys)
        if members > most_members:
            break
        found[keys.tobytes()] = keys
    return _of_sets(list(found.values()))


def _bends(before: NDArray[np.uint64], preds: list[Ints], most_looks: int) -> Iterator[Ints]:
    """Yield travels into and out of one contour b of which an order uses one at most.

    Let k be unrelated to b. Travels to b from a ≺ k put k behind b; travels from b to
    c ≻ k put k before b. So no order has one of each, and b is entered and left once.
    Taken are, for each b, the k that bars most.
    """
    n, succs = len(preds), _successors(preds)
    looks = 0
    for b in range(n):
        below, above = preds[b], succs[b]
        beside = _union(succs, below)
        looks += len(beside) * (len(below) + len(above))
        if looks > most_looks:
            return
        one = np.array([b])
        related = _precede(before, one, beside)[0] | _precede(before, beside, one)[:, 0]
        beside = beside[~related & (beside != b)]
        behind, ahead = _precede(before, below, beside), _precede(before, beside, above)
        bars = behind.sum(axis=0) * ahead.sum(axis=1)
        if bars.any():
            k = int(np.argmax(bars))
            yield np.concatenate([below[behind[:, k]] * n + b, b * n + above[ahead[k]]])


def _seeds(
    before: NDArray[np.uint64], preds: list[Ints], most_looks: int
) -> Iterator[tuple[Ints, Ints]]:
    """Yield first sets of two at least, each once, and who may follow all of it."""
    succs = _successors(preds)
    seen: set[bytes] = set()
    looks = 0
    for c in range(len(preds)):
        above = succs[c]
        below = _union(preds, above)
        looks += len(below) * len(above)
        if looks > most_looks:
            return
        below = below[_precede(before, below, above).all(axis=1)]
        for tails in (preds[c], below):
            if len(tails) > 1 and tails.tobytes() not in seen:
                seen.add(tails.tobytes())
                heads = _union(succs, tails)
                looks += len(tails) * len(heads)
                yield tails, heads


def _of_sets(sets: list[Ints]) -> ExclusiveTravels:
    keys, place = np.unique(np.concatenate([*sets, np.empty(0, np.int64)]), return_inverse=True)
    of = np.repeat(np.arange(len(sets)), [len(one) for one in sets])
    shape = (len(keys), len(sets))
    return ExclusiveTravels(
        keys, csr_array((np.ones(len(of)), (place.reshape(-1), of)), shape=shape)
    )


def _precede(before: NDArray[np.uint64], tails: Ints, heads: Ints) -> Flags:
    """Tell which tails precede which heads, (tails, heads)."""
    words = before[heads[None, :], tails[:, None] >> 6]
    return np.asarray((words >> (tails[:, None] & 63).astype(np.uint64)) & np.uint64(1), np.bool_)


def _successors(preds: list[Ints]) -> list[Ints]:
    counts = [len(some) for some in preds]
    heads = np.repeat(np.arange(len(preds)), counts)
    tails = np.concatenate([*preds, np.empty(0, np.int64)])
    order = np.argsort(tails, kind="stable")
    ends = np.cumsum(np.bincount(tails, minlength=len(preds)))
    return np.split(heads[order], ends[:-1])


def _union(lists: list[Ints], which: Ints) -> Ints:
    return np.unique(np.concatenate([*(lists[c] for c in which), np.empty(0, np.int64)]))
