"""Sets of contours that every order must leave several times.

Where towers stand so near each other that the head must print them in turn, it must
travel between them again and again. Bounds that look at single travels miss that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from decmcts.search.bounds.chains_kernels import most_exits
from decmcts.search.sequence.problem import OrderProblem

GAPS_MM = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
MOST_ZONES = 256
MOST_SQUARES = 4_000_000


@dataclass(frozen=True, slots=True)
class Crossings:
    """Sets as unions of zones, and how often at least any order leaves each.

    A travel leaves a set when it leads from a contour in it to one outside.
    """

    zone: NDArray[np.int64]  # (n,) zone of each contour
    member: NDArray[np.bool_]  # (zones, sets) whether the zone belongs to the set
    exits: NDArray[np.float64]  # (sets,) travels that leave the set, at least


def forced_crossings(problem: OrderProblem, *, most: int = 60) -> Crossings:
    """Return up to `most` sets of contours that stand apart and must be left several times.

    The bound on exits of a set S is the largest number of steps from S to outside
    along any chain of the graph. It holds: a linear extension visits the members of
    a chain in their order, so between two that follow each other in the chain, one
    in S and one not, it travels at least once from S to outside; these steps of
    the order are disjoint.
    """
    n = len(problem)
    found: list[tuple[float, float, NDArray[np.bool_]]] = []
    for gap in GAPS_MM:
        if np.prod(np.ptp(problem.ports()[:, :2], axis=0) // gap + 1.0) > MOST_SQUARES:
            continue
        groups = _apart(problem, gap)
        count = int(groups.max()) + 1
        if not 1 < count <= MOST_ZONES:
            continue
        for group in range(count):
            inside = groups == group
            exits = most_exits(problem.graph.pred_offsets, problem.graph.preds, inside)
            if exits > 1:
                found.append((exits * gap, float(exits), inside))
    found.sort(key=lambda entry: -entry[0])
    return _zoned(n, _distinct(found)[:most])


def _distinct(
    found: list[tuple[float, float, NDArray[np.bool_]]],
) -> list[tuple[float, NDArray[np.bool_]]]:
    """Return exits and members of each set once."""
    once = {inside.tobytes(): (exits, inside) for _, exits, inside in reversed(found)}
    return list(reversed(once.values()))


def _zoned(n: int, sets: list[tuple[float, NDArray[np.bool_]]]) -> Crossings:
    if not sets:
        return Crossings(np.zeros(n, np.int64), np.zeros((1, 0), np.bool_), np.zeros(0))
    of = np.stack([inside for _, inside in sets], axis=1)
    member, zone = np.unique(of, axis=0, return_inverse=True)
    exits = np.array([exits for exits, _ in sets])
    return Crossings(np.ascontiguousarray(zone.reshape(n), np.int64), member, exits)


def _apart(problem: OrderProblem, gap: float) -> NDArray[np.int64]:
    """Return groups of contours whose ends fall into squares of `gap` that touch, from above."""
    xy = problem.ports()[:, :2]
    cells = ((xy - xy.min(axis=0)) // gap).astype(np.int64)
    occupied = np.zeros(cells.max(axis=0) + 1, np.bool_)
    occupied[cells[:, 0], cells[:, 1]] = True
    patch = label(occupied, structure=np.ones((3, 3)))[0][cells[:, 0], cells[:, 1]]
    one, other = patch[0::2], patch[1::2]  # a contour joins the patches of its ends
    size = int(patch.max()) + 1
    links = coo_matrix((np.ones(len(one)), (one, other)), (size, size))
    joined = connected_components(links, directed=False)[1][one]
    return np.unique(joined, return_inverse=True)[1].astype(np.int64)
