"""Contacts of the source: where in its own order a bead stands in the way of the head.

A contour a blocks the head at a later contour b, and the source prints a first all the
same: the ramp of a scarf seam runs below the wall beside it. How deep that is, is measured
from the tip upwards to the top of the bead. Which depth is allowed is said in
`decmcts.feasibility.contacts`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.feasibility.clearance_kernels import (
    Z_EPS,
    Centrelines,
    PackedHead,
    contact_depth,
)
from decmcts.feasibility.closure_kernels import TOUCH_MM, WORD, Words, touches


class ContactList(NamedTuple):
    """A growing list of pairs a < b of which a blocks the head at b in the source's order."""

    pairs: Int32s  # (capacity, 2)
    depth: Floats  # (capacity,) mm that a stands above the tip
    beside: Flags  # (capacity,) whether the beads of the two touch
    used: Ints  # (1,) how many of the capacity


class DepthLimits(NamedTuple):
    """How deep a contact may be."""

    most: Floats  # (n,) mm, with this contour's bead
    layer: Int32s  # (n,)
    within: float  # mm, on one layer; the larger of the two counts
    width: Floats  # (n,) mm, of the beads


@kernel
def fill_danger(beads: Centrelines, head: PackedHead, b: int, r: float, danger: Floats) -> None:
    """Write where, by boxes, material may block polygons at b: xmin, ymin, xmax, ymax, zmin."""
    for k in range(len(head.heights)):
        for axis in range(2):
            danger[k, axis] = beads.boxes[b, axis] + head.boxes[k, axis] - r
            danger[k, axis + 2] = beads.boxes[b, axis + 2] + head.boxes[k, axis + 2] + r
        danger[k, 4] = beads.boxes[b, 4] + head.heights[k] + Z_EPS


@kernel
def in_danger(boxes: Floats, i: int, danger: Floats) -> bool:
    """Tell whether box i lies within any row of `danger`."""
    for k in range(len(danger)):
        if boxes[i, 5] <= danger[k, 4]:
            return False
        if (
            boxes[i, 0] <= danger[k, 2]
            and boxes[i, 2] >= danger[k, 0]
            and boxes[i, 1] <= danger[k, 3]
            and boxes[i, 3] >= danger[k, 1]
        ):
            return True
    return False


@kernel
def source_contacts(
    beads: Centrelines, words: Words, head: PackedHead, limits: DepthLimits, found: ContactList
) -> tuple[ContactList, int, int, int]:
    """Find all pairs a < b of which a blocks the head at b, and how deep.

    Returns them with (a, b, polygon) of the first pair deeper than its limit, which ends the
    search, or with (-1, -1, -1).
    """
    quad, danger = np.empty((4, 2)), np.empty((len(head.heights), 5))
    boxes, r_max, top = beads.boxes, beads.radius.max(), -np.inf
    for b in range(len(beads.radius)):
        if top > boxes[b, 4] + head.heights[0]:
            fill_danger(beads, head, b, r_max, danger)
            for w in range((b - 1) // WORD, -1, -1):
                if not in_danger(words.boxes, w, danger):
                    continue
                for a in range(min(b, w * WORD + WORD) - 1, w * WORD - 1, -1):
                    if not in_danger(boxes, a, danger):
                        continue
                    most = limits.within if limits.layer[a] == limits.layer[b] else 0.0
                    most = max(most, limits.most[a])
                    depth, k = contact_depth(beads, a, b, head, most, quad)
                    if depth > most:
                        return found, a, b, k
                    if k >= 0:
                        gap = (limits.width[a] + limits.width[b]) / 2 + TOUCH_MM
                        found = add_contact(found, a, b, depth, touches(beads, a, b, gap))
        top = max(top, boxes[b, 5])
    return found, -1, -1, -1


@kernel
def add_contact(found: ContactList, a: int, b: int, depth: float, beside: bool) -> ContactList:
    """Add a pair, in place where there is room; returns the list, twice as long where not."""
    at = found.used[0]
    if at == len(found.depth):
        pairs, depths = np.empty((2 * at, 2), np.int32), np.empty(2 * at)
        sides = np.empty(2 * at, np.bool_)
        pairs[:at], depths[:at], sides[:at] = found.pairs, found.depth, found.beside
        found = ContactList(pairs, depths, sides, found.used)
    found.pairs[at, 0], found.pairs[at, 1] = a, b
    found.depth[at], found.beside[at] = depth, beside
    found.used[0] = at + 1
    return found
