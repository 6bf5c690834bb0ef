"""What the numbers in a head's plan mean.

A plan is a flat int32 sequence, so that it travels in a message as it is:

- a policy, `n_macros + k`: how the head chooses between contours that are ready (row k of
  `POLICIES`); then a shift for each macro-action, or none: how much later than usual the
  head wants to do it, in hundredths of a part. So a plan is a sequence of macro-actions,
  those with the least progress + shift first (random keys, Bean 1994, ORSA Journal on
  Computing 6(2));
- or a serial plan: the symbol `n_macros + len(POLICIES)`, then 2·contour +
  reversed for every contour: everything in this order, one head at a time;
- or a stated order: the symbol `n_macros + len(POLICIES) + 1`, the number of heads, then
  (2·contour + reversed)·heads + head for every contour: all heads do exactly this;
- or changes of the order that heads begin with (`decmcts.team.engine.start`): the symbol
  `n_macros + len(POLICIES) + 2`, then for each of this head's macro-actions of that order which
  it changes: its number, how many half turns later it comes, and who prints it.

A sequence that means nothing counts as policy 0 without shifts, since a plan may come
from a peer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.print.toolpath import Toolpath

# Columns of POLICIES; `decmcts.team.engine.dispatch_kernels` has the score they weigh, and the key.
# 0: weight of the key.
# 1: weight of waste, the share of the time until a contour's end in which nothing is printed.
# 2: weight of being out of step with the other heads.
# 3: what the key is: the progress of the part (0), the urgency (1; it falls with the length of
#    the chain that must come after), or a mix of both.
# 4: how much sooner contours in the bottleneck come, in progress of a part.
# 5: how much later contours in another head's share of the machine come, likewise.
STEP = 2

_TUNED = np.array(
    [
        [20.0, 1.0, 3.0, 1.0],
        [10.0, 1.0, 10.0, 0.0],
        [60.0, 2.6, 0.5, 0.5],
        [80.0, 3.8, 5.0, 1.0],
        [8.0, 0.45, 1.4, 0.0],
        [50.0, 0.9, 7.8, 1.0],
        [18.0, 0.6, 3.7, 1.0],
        [15.0, 1.0, 0.5, 0.0],
        [44.0, 3.1, 7.4, 0.5],
        [60.0, 1.6, 30.0, 1.0],
        [10.0, 1.0, 0.0, 0.0],
        [30.0, 0.6, 1.0, 0.5],
        [3.0, 1.0, 3.0, 1.0],
        [1.0, 1.0, 0.0, 0.0],
    ]
)
MOST_STATED = 70_000  # contours; an order of more, by 64 heads, might not fit into a message
TUNED = len(_TUNED)  # policies that come first
HUNDREDTHS = 100.0  # of a part's progress, in which shifts are stated
MOST_SHIFT = 400  # sooner or later
MOST_LATER = 1000  # half turns, sooner or later
_SPREAD = 498  # policies spread evenly over all that make sense


def _spread() -> Floats:
    """Return policies of an additive recurrence, a quasirandom sequence in six dimensions."""
    root = 1.0
    for _ in range(40):  # of x^7 = x + 1: what the golden ratio is to one dimension
        root = (1.0 + root) ** (1.0 / 7.0)
    share = np.modf(0.5 + np.arange(1, _SPREAD + 1)[:, None] / root ** np.arange(1, 7))[0]
    weights = 10.0 ** (share[:, :3] * [2.5, 2.5, 2.0] - [0.5, 1.0, 1.0])
    weights[::2, STEP] = 0.0
    urgency = np.floor(share[:, 3] * 3) / 2
    bonus = np.array([0.0, 0.05, 0.2, 1.0, 3.0])[(share[:, 4] * 5).astype(np.int64)]
    return np.column_stack([weights, urgency, bonus, 10.0 ** (2.5 * share[:, 5] - 2.5)])


POLICIES = np.concatenate([np.column_stack([_TUNED, np.tile([0.0, 0.03], (TUNED, 1))]), _spread()])


@dataclass(frozen=True, slots=True, eq=False)
class StatedOrder:
    """Who prints what, in one order of all; conflicts are decided in this order."""

    order: Int32s  # (n,) contours
    reversed: Flags  # (n,) aligned with order
    head: Ints  # (n,) aligned with order

    @staticmethod
    def of(toolpaths: Sequence[Toolpath]) -> StatedOrder:
        """Return the joint order of toolpaths that all have turns."""
        count = [len(toolpath) for toolpath in toolpaths]
        turn = np.concatenate([np.asarray(toolpath.turn, np.int64) for toolpath in toolpaths])
        row = np.argsort(turn)
        return StatedOrder(
            np.concatenate([toolpath.order for toolpath in toolpaths])[row],
            np.concatenate([toolpath.reversed for toolpath in toolpaths])[row],
            np.repeat(np.arange(len(count)), count)[row],
        )

    def toolpaths(self, heads: int) -> list[Toolpath]:
        """Return the toolpath of each head, with turns."""
        made = []
        for r in range(heads):
            turn = np.flatnonzero(self.head == r)
            entry = np.zeros(len(turn), np.int32)
            made.append(Toolpath(self.order[turn], self.reversed[turn], entry, turn))
        return made


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """What a head changes of its own macro-actions of the order that heads begin with."""

    macro: Ints  # (k,) rising
    later: Ints  # (k,) half turns; below 0: sooner
    head: Ints  # (k,) who prints it


@dataclass(frozen=True, slots=True)
class Intent:
    """A decoded plan."""

    shift: Int32s  # (n_macros,) hundredths of a part that each macro-action comes later
    policy: int  # row of POLICIES
    serial: Toolpath | None = None  # everything in this order instead
    stated: StatedOrder | None = None  # who prints what in which order instead
    changes: Changes | None = None  # of the order that heads begin with, instead


def decode(plan: Int32s, n_macros: int, n_contours: int) -> Intent:
    """Return what a plan says; what means nothing is skipped."""
    serial, unshifted = n_macros + len(POLICIES), np.zeros(n_macros, np.int32)
    if len(plan) == n_contours + 1 and plan[0] == serial and n_contours:
        order, is_reversed = plan[1:] // 2, plan[1:] % 2 == 1
        if np.array_equal(np.sort(order), np.arange(n_contours)):
            return Intent(unshifted, 0, Toolpath.of(order, is_reversed))
    stated = _decode_stated(plan, serial + 1, n_contours)
    if stated is not None:
        return Intent(unshifted, 0, None, stated)
    if len(plan) % 3 == 1 and plan[0] == serial + 2:
        return Intent(unshifted, 0, changes=_decode_changes(plan))
    if not len(plan) or not n_macros <= plan[0] < serial:
        return Intent(unshifted, 0)
    shift = plan[1:] if len(plan) == n_macros + 1 else unshifted
    return Intent(np.clip(shift, -MOST_SHIFT, MOST_SHIFT), int(plan[0]) - n_macros)


def means_something(plan: Int32s, n_macros: int, n_contours: int, heads: int) -> bool:
    """Return whether `decode` skips nothing of a plan; an empty one holds nothing."""
    if not len(plan):
        return True
    policy, rest = int(plan[0]) - n_macros, plan[1:]
    if 0 <= policy < len(POLICIES):
        within = (rest >= -MOST_SHIFT) & (rest <= MOST_SHIFT)
        return len(rest) in (0, n_macros) and bool(within.all())
    intent = decode(plan, n_macros, n_contours)
    if intent.stated is not None:
        return int(plan[1]) <= heads
    if intent.changes is not None:
        known = intent.changes.macro < n_contours
        return 3 * int((known & (intent.changes.head < heads)).sum()) == len(rest)
    return intent.serial is not None


def _decode_stated(plan: Int32s, mark: int, n: int) -> StatedOrder | None:
    """Return the stated order of a plan that begins with `mark`; None: it is none."""
    if len(plan) != n + 2 or plan[0] != mark or plan[1] < 1 or not n:
        return None
    visit, head = plan[2:] // plan[1], plan[2:] % plan[1]
    if not np.array_equal(np.sort(visit // 2), np.arange(n)):
        return None
    return StatedOrder((visit // 2).astype(np.int32), visit % 2 == 1, head.astype(np.int64))


def _decode_changes(plan: Int32s) -> Changes:
    """Return the changes a plan makes; those that mean nothing are skipped."""
    rows = plan[1:].reshape(-1, 3).astype(np.int64)
    rows = rows[(rows[:, 0] >= 0) & (np.abs(rows[:, 1]) <= MOST_LATER) & (rows[:, 2] >= 0)]
    return Changes(*rows[np.unique(rows[:, 0], return_index=True)[1]].T)


def encode_changes(changes: Changes, n_macros: int) -> Int32s:
    """Return the plan that makes these changes; none: the order heads begin with."""
    rows = np.stack([changes.macro, changes.later, changes.head], axis=1)
    return np.concatenate([[n_macros + len(POLICIES) + 2], rows.reshape(-1)]).astype(np.int32)


def encode(policy: int, n_macros: int, shift: Int32s | None = None) -> Int32s:
    """Return the plan of a policy, with macro-actions later than usual by `shift`, (n_macros,)."""
    if shift is None or not shift.any():
        return np.array([n_macros + policy], np.int32)
    within = np.clip(shift, -MOST_SHIFT, MOST_SHIFT)
    return np.concatenate([[n_macros + policy], within]).astype(np.int32)


def encode_serial(toolpath: Toolpath, n_macros: int) -> Int32s:
    """Return the plan that prints everything in this order, one head at a time."""
    symbols = 2 * toolpath.order + toolpath.reversed
    return np.concatenate([[n_macros + len(POLICIES)], symbols]).astype(np.int32)


def encode_stated(stated: StatedOrder, heads: int, n_macros: int) -> Int32s:
    """Return the plan that states who prints what in which order."""
    symbols = (2 * stated.order.astype(np.int64) + stated.reversed) * heads + stated.head
    return np.concatenate([[n_macros + len(POLICIES) + 1, heads], symbols]).astype(np.int32)
