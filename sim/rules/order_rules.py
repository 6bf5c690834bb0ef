"""Checking the order of a plan by all rules, and stating which rules those were.

Each kind of edge is found anew: precedence in `sim.rules.precedence`; here that what primes the
nozzle comes first. What the source begins an epoch with is found contour by contour, in the order
of the file. The tolerances for "touching" are looser than the planner's, so that no plan is refused
wrongly. Each bead of a wipe tower is an epoch of its own, so `sim.rules.precedence` keeps towers in
place.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import shapely
from scipy.spatial import cKDTree

from decmcts.arrays import Floats, Ints
from decmcts.print.contours import Contours, Role
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, HeadActions, OrderRules, PlanDocument
from sim.content.paths import Legs
from sim.faults import Fault, FaultKind, listed
from sim.rules.order import PartialOrder, early
from sim.rules.precedence import (
    check_epochs,
    check_freedom,
    check_lead,
    check_precedence,
    check_touching,
    prints_of,
)


def usual_rules(machine: Machine) -> OrderRules:
    """Return the rules a plan that states none is held to: the defaults of `decmcts plan`.

    But any freedom is allowed: whether seams moved rightly is judged in any case.
    """
    return OrderRules(quality=machine.bead_width)


def check_order(
    document: PlanDocument,
    source: PrintJob | None,
    legs: Legs,
    order: PartialOrder,
    rules: OrderRules,
) -> list[Fault]:
    """J2: what must come before what, by the plan's pairs and by the definitions.

    Roles, layers and epochs of contours are taken from the source, where one is given with as
    many contours.
    """
    contours: Contours = document.contours
    refills: tuple[int, ...] = ()
    if source is not None:
        refills = source.refills
        if len(source.contours) == len(contours):
            contours = source.contours
    all_actions = legs.all_actions
    prints = prints_of(len(contours), all_actions, order)
    faults = [
        *check_precedence(document.precedence, prints),
        *check_touching(contours, prints, rules),
        *check_epochs(contours, all_actions, order),
        *check_priming(contours, all_actions, order, refills=refills),
        *check_freedom(document.contours, legs.whole, rules),
    ]
    if rules.max_layers_ahead is not None:
        faults += check_lead(contours, all_actions, order, rules.max_layers_ahead)
    return faults


def statements(
    document: PlanDocument,
    source: PrintJob | None,
    machine: Machine | None,
    held: OrderRules,
    imposed: OrderRules | None,
) -> tuple[str, ...]:
    """Return one line each on the rules that counted, and on what was believed without a check."""
    if imposed is not None:
        by = "as asked"
    else:
        by = "as the plan says" if document.rules else "the defaults: no plan states others"
    ahead = held.max_layers_ahead
    rule = document.min_layer_time_s
    cooling = f"{rule:g} s" if rule else "none"
    own = f"{document.machine.name}, as the plan has it"
    limits = "" if source is not None else "; its limits were believed"
    return (
        f"order: process order {held.process_order}, quality {'on' if held.quality else 'off'}, "
        f"layers ahead {'unlimited' if ahead is None else ahead}, freedom {held.freedom} ({by})",
        f"time before a spot is printed over: {cooling}",
        f"machine: {own if machine is None else machine.name + limits}",
        "contours: as the plan has them, no source was given"
        if source is None
        else "contours: compared with the source in all fields",
    )


PRIMING = (Role.SKIRT_BRIM, Role.WIPE_TOWER, Role.CUSTOM)
SAMPLE_MM = 0.2  # contours are looked at in points this far apart
APART_MM = 0.3  # between beads, and farther: two things that do not touch
ROUND_MM = 0.05  # a contour that goes round others is farther out by this
MOST = 64  # of a tool's first contours are looked at where no role is named
TOUCHING_MM = 0.04  # beads nearer than this touch


@dataclass(slots=True)
class _ToolInEpoch:
    """What one tool prints in one epoch; filled while the contours go by."""

    forced: int  # contours before this one prime the nozzle whatever their role
    unknown: bool  # whether contours without a role prime it too
    by_role: bool = True  # whether all so far have a role that primes
    first: list[int] = field(default_factory=list)  # contours that prime the nozzle
    rest: list[int] = field(default_factory=list)  # those that must come after them

    def take(self, contour: int, role: int) -> None:
        """Take the next contour; mutates only itself."""
        self.by_role &= role in PRIMING or (role == Role.UNKNOWN and self.unknown)
        (self.first if self.by_role or contour < self.forced else self.rest).append(contour)


def starts_of(contours: Contours, refills: tuple[int, ...] = ()) -> list[tuple[Ints, Ints]]:
    """Return of each tool in each epoch what primes it and what must come after that."""
    role, tool = contours.role.tolist(), contours.tool.tolist()
    epoch = contours.epoch.tolist()
    named = {t for t, r in zip(tool, role, strict=True) if r and r not in PRIMING}
    starts: dict[tuple[int, int], _ToolInEpoch] = {}
    used: set[int] = set()
    for i, (e, t, r) in enumerate(zip(epoch, tool, role, strict=True)):
        if (e, t) not in starts:
            opens = t not in used
            count = int(e in refills or (i > 0 and tool[i - 1] != t))
            if opens and t not in named:
                count = max(1, _untouched(contours, i))
            starts[e, t] = _ToolInEpoch(i + count, opens and t in named)
            used.add(t)
        starts[e, t].take(i, r)
    return [
        (np.array(start.first), np.array(start.rest))
        for start in starts.values()
        if start.first and start.rest
    ]


def _untouched(contours: Contours, first: int) -> int:
    """Return how many contours from `first` on stand apart from all that is printed later.

    They are of one layer, epoch and tool, and nothing of the layer above lies on them
    unless they go round all that is left of their own.
    """
    base = int(contours.layer[first])
    low = first + np.flatnonzero(contours.layer[first:] <= base)
    above = np.flatnonzero(contours.layer == base + 1)
    if not len(above):
        return 0
    ours, upper = _Points.of(contours, low), _Points.of(contours, above)
    alike = (contours.layer, contours.epoch, contours.tool)
    count, found, held = 0, 0, True
    while count < MOST and held:
        reach = count + 1
        while count < min(reach, MOST) and held:
            i = first + count
            held = i < len(contours) and all(a[i] == a[first] for a in alike)
            if held:
                reach = max(reach, ours.last_near(contours, i) + 1 - first)
                count += 1
        if held and count >= reach and _uncovered(contours, first, count, low, upper):
            found = count
    return found


def _uncovered(contours: Contours, first: int, count: int, low: Ints, upper: _Points) -> bool:
    """Say whether each of the first contours is bare above, or goes round the rest of its layer."""
    rest = low[low >= first + count]
    if not len(rest):
        return all(upper.last_near(contours, first + k) < 0 for k in range(count))
    inner = np.array([_bounds(contours, int(c)) for c in rest])
    least, most = inner[:, :2].min(axis=0) - ROUND_MM, inner[:, 2:].max(axis=0) + ROUND_MM
    for i in range(first, first + count):
        box = _bounds(contours, i)
        round_it = bool((box[:2] < least).all() and (box[2:] > most).all())
        if not round_it and upper.last_near(contours, i) >= 0:
            return False
    return True


def _bounds(contours: Contours, i: int) -> Floats:
    xy = contours.polyline(i)[:, :2]
    return np.concatenate([xy.min(axis=0), xy.max(axis=0)])


@dataclass(frozen=True, slots=True)
class _Points:
    tree: cKDTree
    owner: Ints
    known: dict[int, int] = field(default_factory=dict)  # what `last_near` found

    @staticmethod
    def of(contours: Contours, ids: Ints) -> _Points:
        parts = [_sampled(contours.polyline(int(c))[:, :2]) for c in ids]
        owner = np.repeat(ids, [len(p) for p in parts])
        return _Points(cKDTree(np.concatenate(parts)), owner)

    def last_near(self, contours: Contours, i: int) -> int:
        """Return the last of the contours that comes near contour i, or -1; keeps what it found."""
        if i not in self.known:
            near = (contours.width[i] + contours.width.max()) / 2 + APART_MM
            found = self.tree.query_ball_point(_sampled(contours.polyline(i)[:, :2]), near)
            rows = np.fromiter(itertools.chain.from_iterable(found), np.int64)
            self.known[i] = int(self.owner[rows].max(initial=-1))
        return self.known[i]


def _sampled(xy: Floats) -> Floats:
    """Return points along a polyline, none farther than `SAMPLE_MM` from the next."""
    step = np.diff(xy, axis=0)
    count = np.maximum(1, np.ceil(np.linalg.norm(step, axis=1) / SAMPLE_MM)).astype(np.int64)
    row = np.repeat(np.arange(len(step)), count)
    part = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)) / count[row]
    return np.concatenate([xy[row] + part[:, None] * step[row], xy[-1:]])


def check_priming(
    contours: Contours,
    all_actions: tuple[HeadActions, ...],
    order: PartialOrder,
    *,
    refills: tuple[int, ...] = (),
) -> list[Fault]:
    """Check a plan: what primes a tool ends before its other contours of the epoch begin.

    `refills` are the epochs that begin with a filament change or a pause; a plan does
    not say, its source does.
    """
    held = list(_held(contours, refills))

    def due(other: HeadActions, contour: Ints) -> Ints:
        ends, last = np.full(len(contours), -1), np.full(len(contours), -1)
        printing = np.flatnonzero(other.kind == ActionKind.PRINT)
        ends[other.contour[printing]] = printing
        for first, rest in held:
            last[rest] = np.maximum(last[rest], ends[first].max(initial=-1))
        return last[contour]

    return _faults(early(all_actions, order, due))


def check_file_priming(
    contours: Contours, contour: Ints, *, refills: tuple[int, ...] = ()
) -> list[Fault]:
    """Check a file: `contour` is that of the source which each laid move is of, -1: none."""
    rows = np.flatnonzero(contour >= 0)
    begins, ends = np.full(len(contours), len(contour)), np.full(len(contours), -1)
    np.minimum.at(begins, contour[rows], rows)
    np.maximum.at(ends, contour[rows], rows)
    held = _held(contours, refills)
    soon = [rest[begins[rest] < ends[first].max()] for first, rest in held]
    return _faults(np.unique(np.concatenate([np.empty(0, np.int64), *soon])))


def _held(contours: Contours, refills: tuple[int, ...]) -> Iterator[tuple[Ints, Ints]]:
    """Yield contours that must come first, with those that must come after them."""
    yield from starts_of(contours, refills)
    yield from _brims(contours)


def _brims(contours: Contours) -> Iterator[tuple[Ints, Ints]]:
    """Yield each brim and what touches it later in its layer, of another role."""
    brims = np.flatnonzero(contours.role == Role.SKIRT_BRIM)
    low = np.unique(contours.layer[brims])
    others = np.flatnonzero((contours.role != Role.SKIRT_BRIM) & np.isin(contours.layer, low))
    if not len(others):
        return
    tree = shapely.STRtree([shapely.LineString(contours.polyline(int(c))[:, :2]) for c in others])
    for a in brims.tolist():
        line = shapely.LineString(contours.polyline(a)[:, :2])
        near = others[tree.query(line, "dwithin", distance=float(contours.width.max()) + 1.0)]
        near = near[(near > a) & (contours.layer[near] == contours.layer[a])]
        apart = [line.distance(shapely.LineString(contours.polyline(int(b))[:, :2])) for b in near]
        reach = (contours.width[a] + contours.width[near]) / 2 + TOUCHING_MM
        touching = near[np.array(apart, float) <= reach]
        if len(touching):
            yield np.array([a]), touching


def _faults(rows: Ints) -> list[Fault]:
    lines = [
        f"contour {c} may begin before what primes the nozzle in the source" for c in rows.tolist()
    ]
    return listed(FaultKind.PRIMING, lines)
