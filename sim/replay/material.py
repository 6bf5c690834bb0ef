"""Head against printed material: a growing print and a head that moves through it.

Both one-head G-code and joint plans come here as a list of moves, a list of
beads, and for each bead the first move that may meet it. A head slice k fills
its polygons from tip + height_k upwards and keeps the machine's clearance from beads;
the carriage's bodies are boxes, which only must not touch them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.machine import Head
from sim.faults import Fault, FaultKind
from sim.replay.gaps import meets, room
from sim.replay.near_misses import (
    CAPACITY,
    NearMissCapacity,
    NearPrint,
    UndecidedError,
    near_misses,
)
from sim.replay.shapes import Beads, Part, parts_of


def or_undecided(check: Callable[[], list[Fault]]) -> list[Fault]:
    """Return what a check finds; one that cannot decide is a fault itself."""
    try:
        return check()
    except UndecidedError as error:
        return [Fault(FaultKind.HEAD_MATERIAL, str(error))]


@dataclass(frozen=True, slots=True)
class Contact:
    """A move in which the head meets a bead."""

    move: int
    bead: int
    part: str  # name of the head part
    depth_mm: float  # how far the bead's top is above the part's lower side


Allowed = Callable[[Ints, Ints, Floats], Flags]
"""Tells of moves, beads, and how far each bead stands above the tip, which may meet."""


SettlesQuestion = Callable[[Ints, Floats], Flags]
"""Tells which contacts, as pairs of owners (k, 2) and depths (k,), settle a question."""


def over_tip(moves: Floats, beads: Beads, move: Ints, bead: Ints) -> Floats:
    """Return how far the highest of a bead is above the lowest of the tip on a move, (k,) mm."""
    top = np.maximum(beads.start[bead, 2], beads.end[bead, 2])
    return np.asarray(top - np.minimum(moves[move, 2], moves[move, 5]))


def deepest_contacts(
    moves: Floats,
    owner: Ints,
    beads: Beads,
    head: Head,
    *,
    margins: tuple[float, float],
    ends_at: SettlesQuestion | None = None,
) -> tuple[Ints, Floats]:
    """Return which owners of moves meet which beads' owners, and how deep.

    Parameters
    ----------
    owner : (m,) whose each move is, from 0; the beads' owners are their labels
    margins : the clearance kept from beads, and the overlap that counts as touching, mm
    ends_at : which contacts, given as returned, make all others of no interest: where more is
        near than fits, and one of those is among the first, only such are returned

    Returns
    -------
    pairs : (k, 2) owner of moves, owner of beads
    depth : (k,) mm from the tip to the top of the bead, the greatest of all contacts of the pair
    """
    search = ContactSearch(moves, beads, parts_of(head), *margins)
    for found, whole in _near(search, "near misses in the source's own order", CAPACITY):
        if whole:
            return _deepest(search, owner, found)
        if ends_at is not None:
            deepest = _deepest(search, owner, found, ends_at)
            if len(deepest[0]):
                return deepest
    raise AssertionError("the last of all tries is whole")


def _near(
    search: ContactSearch, what: str, capacity: NearMissCapacity, near: NearPrint | None = None
) -> Iterator[tuple[Ints, bool]]:
    """Yield near misses (move, bead, part), more at each try, and whether they are all of them.

    Raises
    ------
    UndecidedError
        When there are too many, named `what`.
    """
    margins = (search.clearance_mm, search.tolerance_mm)
    while True:
        found, total = near_misses(
            search.moves, search.beads, search.parts, margins, capacity, near
        )
        yield found, total <= capacity.first
        if total <= capacity.first:
            return
        if capacity.first >= capacity.most:
            raise UndecidedError(f"over {capacity.most} {what}")
        capacity = replace(capacity, first=min(16 * capacity.first, capacity.most))


def _deepest(
    search: ContactSearch, owner: Ints, found: Ints, only: SettlesQuestion | None = None
) -> tuple[Ints, Floats]:
    """Return the pairs of owners that meet, and how deep, of candidates; `only` some of them."""
    over = over_tip(search.moves, search.beads, found[:, 0], found[:, 1])
    pair = np.stack([owner[found[:, 0]], search.beads.label[found[:, 1]]], axis=1)
    deepest: dict[tuple[int, int], float] = {}
    wanted = np.ones(len(found), np.bool_) if only is None else only(pair, over)
    ranked = np.lexsort((-over, pair[:, 1], pair[:, 0]))
    for k in ranked[wanted[ranked]].tolist():
        key = (int(pair[k, 0]), int(pair[k, 1]))
        if key not in deepest and _judge(search, *found[k].tolist()) is not None:
            deepest[key] = float(over[k])
    pairs = np.array(list(deepest), np.int64).reshape(-1, 2)
    return pairs, np.array(list(deepest.values()), np.float64)


def find_contacts(
    moves: Floats,
    beads: Beads,
    head: Head,
    *,
    clearance_mm: float,
    tolerance_mm: float,
    limit: int,
    capacity: NearMissCapacity = CAPACITY,
    allowed: Allowed | None = None,
    near: NearPrint | None = None,
) -> list[Contact]:
    """Return moves in which a part of the head overlaps a bead by more than the tolerance.

    At most one contact a move is returned, and at most `limit` in all.

    Parameters
    ----------
    moves : (m, 6) start and end of each move in the order they are made
    beads : Beads
    head : Head
    clearance_mm : kept between the head's slices and the beads
    tolerance_mm : overlap that counts as touching, which is allowed
    limit : stop after this many
    capacity : how many near misses and grid cells are held
    allowed : which contacts are none to report; None: all are
    near : filled in where given: how near a bead comes that is not met

    Raises
    ------
    UndecidedError
        When there are too many near misses to judge and no contact among the first, or
        beads too large to hold.
    """
    if not len(beads.start) or not len(moves):
        return []
    search = ContactSearch(moves, beads, parts_of(head), clearance_mm, tolerance_mm)
    what = "near misses of head and material, too many to judge"
    for found, _ in _near(search, what, capacity, near):
        if allowed is not None:
            move, met, _ = found.T
            found = found[~allowed(move, met, over_tip(moves, beads, move, met))]
        if contacts := _judge_all(search, found, limit):
            return contacts
    return []


@dataclass(frozen=True, slots=True)
class ContactSearch:
    """What the exact check of one candidate after the other needs."""

    moves: Floats  # (m, 6)
    beads: Beads
    parts: list[Part]
    clearance_mm: float
    tolerance_mm: float


def _judge_all(search: ContactSearch, found: Ints, limit: int) -> list[Contact]:
    """Return which candidates are contacts, one a move, at most `limit`."""
    contacts: dict[int, Contact] = {}
    for move, bead, part in found.tolist():
        if len(contacts) >= limit:
            break
        if move in contacts:
            continue
        depth = _judge(search, move, bead, part)
        if depth is not None:
            contacts[move] = Contact(move, bead, search.parts[part].name, depth)
    return list(contacts.values())


def _judge(search: ContactSearch, move: int, bead: int, number: int) -> float | None:
    """Return how far a bead is above the underside of a part that meets it; None if it does not."""
    part, beads, tolerance = search.parts[number], search.beads, search.tolerance_mm
    start, end, row = beads.start[bead], beads.end[bead], search.moves[move]
    reach = beads.width[bead] / 2 + (search.clearance_mm if part.slice else 0.0) - tolerance
    top = np.inf if part.slice else part.high
    span = (part.low + tolerance, top + beads.height[bead] - tolerance)
    if not meets(row, start, end, span, part.polygon, reach, room()):
        return None
    return float(max(start[2], end[2]) - (min(row[2], row[5]) + part.low))


def place_of(move: Floats) -> str:
    """Return the words for the middle of a move."""
    x, y, z = (move[:3] + move[3:]) / 2
    return f"({x:.2f}, {y:.2f}, {z:.2f})"
