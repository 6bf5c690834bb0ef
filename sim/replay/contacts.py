"""Contacts of the source: where the nozzle, in the source's own order, goes into a bead.

The ramp of a scarf seam runs below the wall beside it; a path of a layer that is not flat is
lower somewhere than its neighbour. Such a contact is the slicer's. A result may have it between
the same two contours, no deeper. If they lie side by side it keeps their order, and they run as
sliced. All of it is found by moving the head through the contours in the source's order; nothing a
plan says is believed.

Deep ones are none of these. The tip may go into a bead by as much as that is high. On one layer
of the source it may pass beside a bead that stands higher, up to where the head gets wider.
A source with a deep one between layers is not safe in its own order (parts printed one by one,
too near each other). Then only what happens within a layer is the slicer's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import shapely

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours
from decmcts.print.machine import Head, Machine
from decmcts.print.plan import ActionKind, HeadActions
from sim.faults import Fault, FaultKind, listed
from sim.replay.material import Allowed, deepest_contacts
from sim.replay.near_misses import NearPrint
from sim.replay.shapes import Beads, as_material, beads_there
from sim.rules.precedence import ROUNDING_MM, Prints

WIDER_MM = 5.0  # a head counts as wider from here above the tip at the latest
BESIDE_MM = 1.0  # between the beads of two contours side by side, as far as a nozzle's flat reaches
SLACK_MM = 2e-3  # on depths: files have three decimals
AT_MM = 1e-3  # a travel that starts or ends so near a contour's end goes straight up or down there
NOBODY = -1


@dataclass(frozen=True, slots=True)
class Meetings:
    """Which contours the nozzle of which contour meets in the source, and how deep."""

    n: int  # contours of the print
    key: Ints  # (k,) nozzle's contour * n + bead's contour, ascending
    depth: Floats  # (k,) mm
    beside: Flags  # (k,) two contours side by side: they keep their order

    @property
    def ordered(self) -> Ints:
        """Return rows (contour of the nozzle, of the bead) that keep their order, (m, 2)."""
        key = self.key[self.beside]
        return np.stack([key // self.n, key % self.n], axis=1)

    def allow(self, nozzle: Ints, bead: Ints, depth: Floats) -> Flags:
        """Tell which contacts the source makes too, no less deep; `NOBODY`'s never are."""
        if not len(self.key):
            return np.zeros(len(nozzle), np.bool_)
        key = nozzle * self.n + bead
        at = np.minimum(np.searchsorted(self.key, key), len(self.key) - 1)
        met = (self.key[at] == key) & (nozzle >= 0) & (bead >= 0)
        return np.asarray(met & (depth <= self.depth[at] + SLACK_MM))


def source_meetings(
    contours: Contours, machine: Machine, head: Head, tolerance_mm: float
) -> Meetings:
    """Return the contacts of a head that prints all contours as sliced, in their order.

    Those that are too deep are left out: a result with them has faults.

    Raises
    ------
    UndecidedError
        When there are too many near misses to judge.
    """
    n = len(contours)
    if not n or not _may_meet(contours):
        return Meetings(max(n, 1), np.empty(0, np.int64), np.empty(0), np.empty(0, np.bool_))
    moves, owner, beads = _as_printed(contours)
    beads, margins = as_material(beads, machine, tolerance_mm), (machine.clearance_mm, tolerance_mm)
    deep = partial(_deep, contours, head)
    pairs, depth = deepest_contacts(moves, owner, beads, head, margins=margins, ends_at=deep)
    if deep(pairs, depth).any():
        pairs, depth = _within_layers(contours, (moves, owner, beads), head, margins)
    key = pairs[:, 0] * n + pairs[:, 1]
    kept = np.argsort(key)
    kept = kept[depth[kept] <= _most(contours, head, pairs[kept])]
    return Meetings(n, key[kept], depth[kept], _beside(contours, pairs[kept]))


def _most(contours: Contours, head: Head, pairs: Ints) -> Floats:
    """Return how deep the contact of each pair may be, (k,) mm."""
    most = contours.height[pairs[:, 1]] + SLACK_MM
    same = contours.layer[pairs[:, 0]] == contours.layer[pairs[:, 1]]
    wider = [s.height_mm for s in head.slices if s.height_mm > 0.0]
    return np.asarray(np.where(same, np.maximum(most, min([WIDER_MM, *wider])), most))


def _deep(contours: Contours, head: Head, pairs: Ints, depth: Floats) -> Flags:
    """Tell which contacts no order that is safe has: too deep, and between layers, (k,)."""
    other = contours.layer[pairs[:, 0]] != contours.layer[pairs[:, 1]]
    return np.asarray(other & (depth > _most(contours, head, pairs)))


def _within_layers(
    contours: Contours, printed: tuple[Floats, Ints, Beads], head: Head,
    margins: tuple[float, float],
) -> tuple[Ints, Floats]:  # fmt: skip
    """Return the contacts between contours of one layer, layer by layer; flat ones have none."""
    moves, owner, beads = printed
    layer = contours.layer
    low, high = np.full(layer.max() + 1, np.inf), np.full(layer.max() + 1, -np.inf)
    np.minimum.at(low, layer, contours.bottom)
    np.maximum.at(high, layer, contours.top)
    pairs, depths = [np.empty((0, 2), np.int64)], [np.empty(0)]
    for each in np.flatnonzero(high > low).tolist():
        rows = np.flatnonzero(layer[owner] == each)
        laid = layer[beads.label] == each
        some = beads.at(laid)
        some = replace(some, since=np.searchsorted(rows, some.since))
        found, depth = deepest_contacts(moves[rows], owner[rows], some, head, margins=margins)
        pairs.append(found)
        depths.append(depth)
    return np.concatenate(pairs), np.concatenate(depths)


def _beside(contours: Contours, pairs: Ints) -> Flags:
    """Tell which pairs are of different contours side by side, seen from above, (k,)."""
    if not len(pairs):
        return np.empty(0, np.bool_)
    known, row = np.unique(pairs, return_inverse=True)
    lines = np.array([shapely.LineString(contours.polyline(c)[:, :2]) for c in known.tolist()])
    one, other = row.reshape(pairs.shape).T
    reach = contours.width[pairs].sum(axis=1) / 2 + BESIDE_MM - ROUNDING_MM
    return np.asarray((one != other) & shapely.dwithin(lines[one], lines[other], reach))


def _may_meet(contours: Contours) -> bool:
    """Tell whether any contour goes lower than the top of one before it, or ends below its own."""
    top = np.maximum.accumulate(contours.top)
    lower = bool((contours.bottom[1:] < top[:-1]).any())
    return lower or bool((contours.end[:, 2] < contours.top).any())


def _as_printed(contours: Contours) -> tuple[Floats, Ints, Beads]:
    """Return moves, whose they are, and beads of the source's order.

    Behind each contour stands a move that goes nowhere: there the nozzle rests, and may meet
    what it has just printed.
    """
    sizes = np.diff(contours.offsets)
    owner = np.repeat(np.arange(len(contours)), sizes)
    start = np.arange(len(owner))
    rests = contours.offsets[1:] - 1  # one move for each point: its segment, at the last the rest
    end = start + 1
    end[rests] = rests
    moves = np.hstack([contours.points[start], contours.points[end]])
    beads = beads_there(contours)
    beads = replace(beads, since=rests[beads.label].astype(np.int64))
    return moves, owner.astype(np.int64), beads


@dataclass(frozen=True, slots=True)
class Whose:
    """Which contour of the source each move of a head is of, or stands above."""

    own: Ints  # (m,) contour it prints; NOBODY: none
    last: Ints  # (m,) move that printed last up to it; -1: none
    next: Ints  # (m,) move that prints next from it on; m: none
    above: tuple[Ints, Ints]  # (m,) contour straight above whose end, or begin, it goes; NOBODY

    @staticmethod
    def of(moves: Floats, own: Ints) -> Whose:
        """Take moves, (m, 6), in their order, and the contours they print."""
        every = np.arange(len(own))
        last = np.maximum.accumulate(np.where(own >= 0, every, -1))
        following = np.minimum.accumulate(np.where(own >= 0, every, len(own))[::-1])[::-1]
        above = _upright(moves, own, last, 3), _upright(moves, own, following, 0)
        return Whose(own, last, following, above)

    def of_move(self, at: Ints) -> Ints:
        """Return the contours of moves `last` or `next`."""
        known = np.clip(at, 0, len(self.own) - 1)
        return np.where(at == known, self.own[known], NOBODY)

    def allow(self, meetings: Meetings, move: Ints, bead: Ints, depth: Floats) -> Flags:
        """Tell which contacts of moves with the beads of contours are the source's, (k,).

        One straight up or down at the end of a contour, or at its start, is that contour's.
        """
        met = meetings.allow(self.own[move], bead, depth)
        for contour in self.above:
            met |= meetings.allow(contour[move], bead, depth)
        return met


def _upright(moves: Floats, own: Ints, at: Ints, column: int) -> Ints:
    """Return the contour of move `at` for moves straight up or down where that ends or begins."""
    known = np.clip(at, 0, len(moves) - 1)
    point = moves[known, column : column + 3]
    near = np.abs(moves - np.hstack([point, point]))[:, [0, 1, 3, 4]].max(axis=1) < AT_MM
    above = np.minimum(moves[:, 2], moves[:, 5]) >= point[:, 2] - AT_MM
    return np.where(near & above & (at == known), own[known], NOBODY)


def printed_by(actions: HeadActions) -> Ints:
    """Return the contour that each leg prints, NOBODY: none, and behind all NOBODY, (k + 1,)."""
    printed = np.where(actions.kind == ActionKind.PRINT, actions.contour, NOBODY)
    return np.append(printed, NOBODY).astype(np.int64)


def allowed_in_plan(
    meetings: Meetings, actions: HeadActions, moves: Floats, leg: Ints, beads: Beads
) -> Allowed:
    """Return which contacts of a head's moves in a plan are the source's."""
    whose = Whose.of(moves, printed_by(actions)[leg])
    return lambda move, bead, depth: whose.allow(meetings, move, beads.label[bead], depth)


def asked_near(meetings: Meetings, actions: HeadActions, leg: Ints) -> NearPrint:
    """Return the question how near a head comes to the print, but where the source touches.

    A move is of the contour it prints, of the one before and of the next.
    """
    if not len(actions) or not len(meetings.key):
        return NearPrint()
    printed = printed_by(actions)
    rows = np.flatnonzero(printed >= 0)
    known = np.concatenate([[NOBODY], printed[rows], [NOBODY]])
    at = np.searchsorted(rows, leg)  # prints before the leg
    before, after = known[at], known[np.searchsorted(rows, leg, side="right") + 1]
    whose = np.stack([printed[leg], before, after], axis=1)
    return NearPrint(touching=meetings.key, whose=whose, n=meetings.n)


def check_meetings(
    meetings: Sequence[Meetings], all_actions: tuple[HeadActions, ...], prints: Prints
) -> list[Fault]:
    """Check a plan: contours that touch in the source keep their order and run as sliced.

    Only what the head meets that prints the second of a pair counts.

    Parameters
    ----------
    meetings : of each head, as if it printed all
    all_actions : legs
    """
    faults: list[Fault] = []
    touching = np.zeros(len(prints.head), np.bool_)
    for head, each in enumerate(meetings):
        nozzle, bead = each.ordered.T
        mine = prints.head[nozzle] == head
        nozzle, bead = nozzle[mine], bead[mine]
        touching[nozzle], touching[bead] = True, True
        broken = ~prints.kept(bead, nozzle)
        faults += broken_pairs(bead[broken], nozzle[broken])
    for actions in all_actions:
        rows = np.flatnonzero(actions.kind == ActionKind.PRINT)
        turned = actions.reversed[rows] | (actions.entry[rows] > 0)
        faults += turned_touching(np.unique(actions.contour[rows[turned]]), touching)
    return faults


def turned_touching(contour: Ints, touching: Flags) -> list[Fault]:
    """Return a fault for each contour that does not run as sliced and is `touching`."""
    lines = [
        f"contour {c} does not run as sliced, and in the source it touches another so"
        for c in contour[touching[contour]].tolist()
    ]
    return listed(FaultKind.WRONG_PATH, lines)


def broken_pairs(bead: Ints, nozzle: Ints) -> list[Fault]:
    """Return a fault for each pair whose order is not kept."""
    lines = [
        f"contour {a} must end before contour {b} begins: in the source the nozzle meets the "
        "first as it prints the second"
        for a, b in zip(bead.tolist(), nozzle.tolist(), strict=True)
    ]
    return listed(FaultKind.PRECEDENCE, lines)
