"""Contacts that the source makes itself, and may therefore stay.

The nozzle of a scarf seam's ramp is lower than the wall beside it; where the top of a print
is not flat, each path is lower somewhere than its neighbour. The source prints so on purpose:
the tip goes into plastic that was just laid. Two contours that touch so side by side (less than
`BESIDE_MM` between their beads, as far as the flat of a nozzle reaches) keep the source's order,
and neither is reversed or entered elsewhere. Where only the head comes near,
whose outline at the tip is as wide as the clearance a slicer states, either order will do: in
the other there is no contact.

How deep a contact may be:

- Up to the height of the bead that is met: the tip goes into that bead, not through it.
- On one layer up to the length of the nozzle (`nozzle_mm`). The slicer lays such a layer, which
  waves or has slopes, knowing that the nozzle passes beside it; and nothing wider than the
  head's outline at the tip comes near.

What is deeper is a collision, and no order with it is planned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s
from decmcts.errors import InputError
from decmcts.feasibility import contacts_kernels as kernels
from decmcts.feasibility.clearance_kernels import Centrelines, PackedHead
from decmcts.feasibility.closure_kernels import TOUCH_MM, WORD, Words
from decmcts.feasibility.packed_head import boxes_of_runs, pack_contours, pack_heads
from decmcts.print.contours import Contours, Role
from decmcts.print.machine import Head, Machine

NOZZLE_MM = 5.0  # slicers' heads get wider 2 mm (MK3S) to 5 mm (MK4, Bambu 4.76) above the tip
BESIDE_MM = 1.0
ROUNDING_MM = 2e-3  # files have three decimals, heights often two
FIRST = 64  # pairs there is memory for at first


@dataclass(frozen=True, slots=True)
class Contacts:
    """Pairs (a, b) in the source's order, of which a stands in the way of the head at b."""

    pairs: Int32s  # (k, 2) a < b
    depth: Floats  # (k,) mm from the tip up to the top of a's bead
    beside: Flags  # (k,) whether the two lie side by side

    @property
    def ordered(self) -> Int32s:
        """The pairs that keep their order, (m, 2)."""
        return self.pairs[self.beside]

    @property
    def as_sliced(self) -> Int32s:
        """Contours that are not reversed and not entered elsewhere, ascending."""
        return np.unique(np.concatenate([self.ordered.ravel(), self.pairs[:, 1]]))

    def __len__(self) -> int:
        return len(self.depth)

    @property
    def deepest_mm(self) -> float:
        """The greatest depth, mm; 0 where there are no contacts."""
        return float(self.depth.max(initial=0.0))

    def note(self) -> str:
        """Return the line that says how many there are and how deep."""
        return (
            f"{len(self)} times the source's head comes lower than a bead it is near, by up to "
            f"{self.deepest_mm:.3f} mm (scarf seams, slopes): {len(self.as_sliced)} contours "
            f"run as sliced, {len(self.ordered)} pairs keep their order"
        )


NO_CONTACTS = Contacts(np.empty((0, 2), np.int32), np.empty(0), np.empty(0, np.bool_))


class CollisionError(InputError):
    """The source's own order drives the head into material, and not only its tip into a bead."""


def contacts_of(contours: Contours, machine: Machine) -> Contacts:
    """Return the contacts of a print in the order of its contours, for all heads of a machine.

    Raises
    ------
    CollisionError
        When one is deeper than contacts may be.
    """
    beads = pack_contours(contours, machine.clearance_mm, bead_width=machine.bead_width)
    return find_contacts(contours, beads, machine.heads)


def find_contacts(contours: Contours, beads: Centrelines, heads: Sequence[Head]) -> Contacts:
    """Return the contacts as `contacts_of`, of packed beads."""
    n = len(contours)
    if n == 0:
        return NO_CONTACTS
    head, words = pack_heads(heads), words_of(contours, beads)
    empty = kernels.ContactList(
        np.empty((FIRST, 2), np.int32), np.empty(FIRST), np.empty(FIRST, np.bool_),
        np.zeros(1, np.int64),
    )  # fmt: skip
    limits = kernels.DepthLimits(
        contours.height + ROUNDING_MM, contours.layer, nozzle_mm(heads),
        contours.width + (BESIDE_MM - TOUCH_MM),
    )  # fmt: skip
    found, a, b, k = kernels.source_contacts(beads, words, head, limits, empty)
    if a >= 0:
        raise _collision(contours, head, int(a), int(b), int(k))
    count = int(found.used[0])
    return Contacts(
        found.pairs[:count].copy(), found.depth[:count].copy(), found.beside[:count].copy()
    )


def nozzle_mm(heads: Sequence[Head]) -> float:
    """Return how far above the tip heads get wider, mm; at most `NOZZLE_MM`."""
    above = [part.height_mm for head in heads for part in head.slices if part.height_mm > 0.0]
    return min([NOZZLE_MM, *above])


def words_of(contours: Contours, beads: Centrelines) -> Words:
    """Return the bounds of each run of 64 contours."""
    starts = np.arange(0, len(contours), WORD)
    layers = [each.reduceat(contours.layer, starts) for each in (np.minimum, np.maximum)]
    return Words(boxes_of_runs(beads.boxes, starts), np.stack(layers, axis=1))


def _collision(contours: Contours, head: PackedHead, a: int, b: int, k: int) -> CollisionError:
    return CollisionError(
        f"the source prints {name_of(contours, a)} before {name_of(contours, b)}, but then the "
        f"head would hit the first while it prints the second: the part of the head from "
        f"{head.heights[k]:g} mm above the tip upwards would pass through material up to "
        f"z {contours.top[a]:.3f} mm with the tip at z {contours.bottom[b]:.3f} mm",
        line=int(contours.line[b]) or None,
        advice="choose another machine, or print with more room between objects",
    )


def name_of(contours: Contours, i: int) -> str:
    """Return the words for a contour: its number, role, layer, height and line."""
    role = Role(int(contours.role[i])).name.lower().replace("_", " ")
    where = f", line {contours.line[i]}" if contours.line[i] else ""
    return f"contour {i} ({role}, layer {contours.layer[i]}, z {contours.bottom[i]:.3f} mm{where})"
