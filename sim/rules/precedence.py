"""What must come before what, found anew: the plan's pairs, roles, barriers, layers ahead.

The definitions are in docs/definitions.md; a pair (a, b) of them is kept when the plan's
partial order has the print of a end before that of b begins. Material that would be in
the way is not looked at here: `sim.replay.material` moves the head through what may be there,
which finds every pair of kind GEOMETRY that matters to the head that prints. What primes the
nozzle is `sim.rules.order_rules`.

Barriers: all of epoch k before anything of epoch k + 1, whatever the plan's pairs say. An epoch
ends where the source changes something that no contour may be moved across: a temperature, a tool,
a command nobody knows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.arrays import Flags, Int32s, Ints
from decmcts.print.contours import Contours, Role
from decmcts.print.plan import ActionKind, HeadActions, OrderRules
from sim.faults import Fault, FaultKind, listed
from sim.rules.order import PartialOrder, early

TOUCH_MM = 0.05  # beads nearer than this touch,
ROUNDING_MM = 1e-6  # unless by no more than this
SHELLS = (Role.EXTERNAL_PERIMETER, Role.PERIMETER, Role.OVERHANG_PERIMETER)
IN_SHELLS = (
    Role.INFILL,
    Role.SOLID_INFILL,
    Role.TOP_SOLID_INFILL,
    Role.BRIDGE_INFILL,
    Role.GAP_FILL,
)
NOT_PRINTED = -1
PAIRS_AT_ONCE = 2**21  # of boxes that come near: some hundred MB
LEAST_AT_ONCE = 16  # boxes asked about


@dataclass(frozen=True, slots=True)
class Prints:
    """Where in the partial order each contour is printed."""

    head: Ints  # (n,) NOT_PRINTED where no head prints it
    first: Ints  # (n,) leg it begins with
    last: Ints  # (n,) leg it ends with
    clocks: tuple[Ints, ...]  # of `PartialOrder`

    def kept(self, a: Ints, b: Ints) -> Flags:
        """Tell whether a ends before b begins, whatever the timing; also if one is missing."""
        ended = np.empty(len(a), np.int64)
        for h, clock in enumerate(self.clocks):
            rows = self.head[b] == h
            ended[rows] = clock[self.first[b[rows]], np.maximum(self.head[a[rows]], 0)]
        missing = (self.head[a] == NOT_PRINTED) | (self.head[b] == NOT_PRINTED)
        return np.asarray(missing | (ended > self.last[a]))


def prints_of(n: int, all_actions: tuple[HeadActions, ...], order: PartialOrder) -> Prints:
    """Return where a plan prints its `n` contours; its actions are legs (`sim.content.paths`)."""
    head, first, last = (np.full(n, NOT_PRINTED) for _ in range(3))
    for h, actions in enumerate(all_actions):
        printing = np.nonzero(actions.kind == ActionKind.PRINT)[0]
        contour = actions.contour[printing]
        head[contour], last[contour] = h, printing
        first[contour[::-1]] = printing[::-1]
    return Prints(head, first, last, order.clocks)


def check_precedence(pairs: Int32s, prints: Prints) -> list[Fault]:
    """J2: for each pair (a, b) the action of a precedes the action of b, whatever the timing."""
    both = pairs.reshape(-1, 2).astype(np.int64)
    broken = both[~prints.kept(both[:, 0], both[:, 1])]
    lines = [f"contour {x} must end before contour {y} begins" for x, y in broken.tolist()]
    return listed(FaultKind.PRECEDENCE, lines)


def check_touching(contours: Contours, prints: Prints, rules: OrderRules) -> list[Fault]:
    """Check that what touches on a layer keeps the source's order as its roles demand."""
    lines: list[str] = []
    if len(contours) and (rules.quality or rules.process_order == "keep"):
        owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
        shapes = np.asarray(shapely.linestrings(contours.points[:, :2], indices=owner))
        for a, b in _near(contours, shapes, rules):
            wrong = ~prints.kept(a, b)
            a, b = a[wrong], b[wrong]
            reach = (contours.width[a] + contours.width[b]) / 2 + TOUCH_MM - ROUNDING_MM
            met = shapely.dwithin(shapes[a], shapes[b], reach)
            for x, y in zip(a[met].tolist(), b[met].tolist(), strict=True):
                one, other = (Role(int(contours.role[c])).name.lower() for c in (x, y))
                lines.append(
                    f"contour {x} ({one}) must end before contour {y} ({other}) begins: "
                    f"they touch on layer {contours.layer[x]}"
                )
    return listed(FaultKind.PRECEDENCE, lines)


def _near(
    contours: Contours, shapes: NDArray[np.object_], rules: OrderRules
) -> Iterator[tuple[Ints, Ints]]:
    """Yield pairs a < b of a layer whose roles keep their order and whose boxes come near."""
    bounds = shapely.bounds(shapes) + np.outer(contours.width / 2 + TOUCH_MM, [-1, -1, 1, 1])
    boxes = shapely.box(*bounds.T)
    by_layer = np.argsort(contours.layer, kind="stable")
    cuts = np.flatnonzero(np.diff(contours.layer[by_layer])) + 1
    for members in np.split(by_layer, cuts):
        roles: list[int] = np.unique(contours.role[members]).tolist()
        of_role = {r: members[contours.role[members] == r] for r in roles}
        trees = {r: shapely.STRtree(boxes[ids]) for r, ids in of_role.items()}
        for r, s in combinations_with_replacement(of_role, 2):
            if not (must_stay(r, s, rules) or must_stay(s, r, rules)):
                continue
            some = max(LEAST_AT_ONCE, PAIRS_AT_ONCE // len(of_role[r]))
            for first in range(0, len(of_role[s]), some):  # all of a layer may lie on one spot
                asked = of_role[s][first : first + some]
                i, j = trees[r].query(boxes[asked])
                one, two = asked[i], of_role[r][j]
                a, b = np.minimum(one, two), np.maximum(one, two)
                forth = contours.role[a] == r
                fits = np.where(forth, must_stay(r, s, rules), must_stay(s, r, rules)) & (a < b)
                fits &= contours.sources[a] != contours.sources[b]  # pieces of one contour are free
                yield a[fits], b[fits]


def must_stay(first: int, second: int, rules: OrderRules) -> bool:
    """Tell whether a contour stays before a later one of its layer that it touches, by roles."""
    if rules.process_order == "keep" and first != second:
        return True
    if not rules.quality:
        return False
    held = first in SHELLS and (second in SHELLS or second in IN_SHELLS)
    return held or second == Role.IRONING or first == second == Role.UNKNOWN


def check_epochs(
    contours: Contours, all_actions: tuple[HeadActions, ...], order: PartialOrder
) -> list[Fault]:
    """Check a plan: every print follows all prints of earlier epochs, for every timing."""

    def due(other: HeadActions, contour: Ints) -> Ints:
        prints = np.nonzero(other.kind == ActionKind.PRINT)[0]
        last = np.full(int(contours.epoch.max(initial=0)) + 2, -1, np.int64)  # before each epoch
        np.maximum.at(last, contours.epoch[other.contour[prints]] + 1, prints)
        return np.maximum.accumulate(last)[contours.epoch[contour]]

    rows = early(all_actions, order, due)
    lines = [
        f"contour {c} of epoch {contours.epoch[c]} may begin before an earlier epoch has ended"
        for c in rows.tolist()
    ]
    return listed(FaultKind.PRECEDENCE, lines)


def check_file_epochs(line: Ints, match: Ints, source_epoch: Ints) -> list[Fault]:
    """Check a file: the epochs of its extrusions, taken from the source, never go back.

    `line` is that of each extrusion, in the file's order, `match` the source's extrusion it is,
    (n,), `source_epoch` the epoch of each of these, (m,); below 0: none.
    """
    known = np.nonzero(match >= 0)[0]
    epoch = source_epoch[match[known]]
    known, epoch = known[epoch >= 0], epoch[epoch >= 0]
    back = known[np.maximum.accumulate(epoch) > epoch] if len(epoch) else known
    lines = [
        f"line {line[i]} prints what the source prints before a barrier already passed"
        for i in back.tolist()
    ]
    return listed(FaultKind.PRECEDENCE, lines)


def check_lead(
    contours: Contours, all_actions: tuple[HeadActions, ...], order: PartialOrder, ahead: int
) -> list[Fault]:
    """Check that no print begins before all of the layers more than `ahead` below it ended.

    Layers are counted as the source prints them, anew whenever it goes down again.
    """
    if not len(contours):
        return []
    step = np.diff(contours.layer)
    run = np.concatenate([[0], np.cumsum(step != 0)])
    climb = np.concatenate([[0], np.cumsum(step < 0)])
    runs = np.arange(int(run[-1]) + 1)
    climb_of_run = climb[np.searchsorted(run, runs)]
    climbs = np.split(runs, np.flatnonzero(np.diff(climb_of_run)) + 1)

    def due(other: HeadActions, contour: Ints) -> Ints:
        last = np.full(len(runs), -1, np.int64)  # action that prints each run, or one below it
        prints = np.nonzero(other.kind == ActionKind.PRINT)[0]
        np.maximum.at(last, run[other.contour[prints]], prints)
        for part in climbs:
            last[part] = np.maximum.accumulate(last[part])
        below = run[contour] - ahead - 1
        same = climb_of_run[np.maximum(below, 0)] == climb[contour]
        return np.where((below >= 0) & same, last[np.maximum(below, 0)], -1)

    rows = early(all_actions, order, due)
    lines = [
        f"contour {c} of layer {contours.layer[c]} may begin before all that is more than "
        f"{ahead} layers below it has ended"
        for c in rows.tolist()
    ]
    return listed(FaultKind.PRECEDENCE, lines)


def check_freedom(
    contours: Contours, all_actions: tuple[HeadActions, ...], rules: OrderRules
) -> list[Fault]:
    """Check that contours are reversed or entered elsewhere only as the freedom allows."""
    lines: list[str] = []
    for actions in all_actions:
        prints = np.nonzero(actions.kind == ActionKind.PRINT)[0]
        closed = contours.closed[actions.contour[prints]]
        is_reversed = actions.reversed[prints] & (rules.freedom == "fixed")
        is_reversed |= actions.reversed[prints] & closed & (rules.freedom == "reversible")
        entered = (actions.entry[prints] > 0) & (rules.freedom != "seam")
        for what, which in (("runs reversed", is_reversed), ("enters elsewhere", entered)):
            lines += [
                f"contour {c} {what}, freedom is {rules.freedom}"
                for c in actions.contour[prints[which]].tolist()
            ]
    return listed(FaultKind.WRONG_PATH, lines)
