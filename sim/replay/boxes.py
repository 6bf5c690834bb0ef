"""Bounding boxes over a chain: which members of an interval overlap a query box.

An implicit binary tree holds the union of the boxes below each node; a query
descends only where the union overlaps.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from decmcts.arrays import Floats, Ints
from sim.replay.compiled import compiled

BLOCK = 1 << 16


def build_tree(boxes: Floats) -> Floats:
    """Return the tree over (n, 6) boxes, (2 * size, 6), leaves from `size` on."""
    size = 1
    while size < max(1, len(boxes)):
        size *= 2
    tree = np.empty((2 * size, 6))
    tree[:, :3], tree[:, 3:] = np.inf, -np.inf
    tree[size : size + len(boxes)] = boxes
    level = size
    while level > 1:
        below = tree[level : 2 * level].reshape(-1, 2, 6)
        half = level // 2
        tree[half:level, :3] = np.minimum(below[:, 0, :3], below[:, 1, :3])
        tree[half:level, 3:] = np.maximum(below[:, 0, 3:], below[:, 1, 3:])
        level = half
    return tree


@compiled
def apart(a: Floats, b: Floats) -> bool:
    """Whether two boxes do not overlap; touching counts as apart."""
    x = a[0] >= b[3] or b[0] >= a[3]
    y = a[1] >= b[4] or b[1] >= a[4]
    return bool(x or y or a[2] >= b[5] or b[2] >= a[5])


@compiled
def query_all(tree: Floats, boxes: Floats, low: Ints, high: Ints, found: Any) -> int:
    """Write (row, j) for each leaf j in [low, high) that overlaps the box of a row.

    Returns their number, written or not.
    """
    n, size = 0, len(tree) // 2
    stack = np.empty((64, 3), np.int64)
    for row in range(len(boxes)):
        stack[0] = (1, 0, size)
        depth = 1 if high[row] > low[row] else 0
        while depth:
            depth -= 1
            node, first, last = stack[depth]
            if last <= low[row] or first >= high[row] or apart(tree[node], boxes[row]):
                continue
            if node < size:
                middle = (first + last) // 2
                stack[depth] = (2 * node + 1, middle, last)
                stack[depth + 1] = (2 * node, first, middle)
                depth += 2
                continue
            if n < len(found):
                found[n, 0], found[n, 1] = row, first
            n += 1
    return n


def near_in_windows(boxes: Floats, low: Ints, high: Ints, chain: Floats) -> Iterator[Ints]:
    """Yield rows (i, j), in blocks: boxes[i] overlaps chain[j] and low[i] <= j < high[i].

    Blocks keep the memory small and leave nothing out, however many pairs there are.
    """
    if not len(boxes) or not len(chain):
        return
    tree, boxes = build_tree(chain), np.ascontiguousarray(boxes)
    room = np.empty((max(BLOCK, len(chain)), 2), np.int64)  # one row always fits
    begin, step = 0, len(boxes)
    while begin < len(boxes):
        rows = slice(begin, begin + step)
        n = int(query_all(tree, boxes[rows], low[rows], high[rows], room))
        if n > len(room):
            step = max(1, step // 2)
            continue
        if n:
            yield room[:n] + np.array([begin, 0])
        begin += step
