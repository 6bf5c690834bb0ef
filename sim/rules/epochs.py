"""Barriers: all of epoch k before anything of epoch k + 1, whatever the plan's pairs say.

An epoch ends where the source changes something that no contour may be moved
across: a temperature, a tool, a command nobody knows.
"""

from __future__ import annotations

import numpy as np

from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions
from sim.arrays import Ints
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.rules.order import PartialOrder, early


def check_epochs(
    contours: Contours, all_actions: tuple[HeadActions, ...], order: PartialOrder
) -> list[Fault]:
    """Check a plan: every print follows all prints of earlier epochs, for every timing."""
    rows = early(
        all_actions, order, lambda other, c: _last_before(contours, other)[contours.epoch[c]]
    )
    lines = [
        f"contour {c} of epoch {contours.epoch[c]} may begin before an earlier epoch has ended"
        for c in rows[:LIMIT].tolist()
    ]
    return listed(FaultKind.PRECEDENCE, lines, total=len(rows))


def _last_before(contours: Contours, actions: HeadActions) -> Ints:
    """Return for each epoch the last action of a head that prints an earlier one, or -1."""
    prints = np.nonzero(actions.kind == ActionKind.PRINT)[0]
    last = np.full(int(contours.epoch.max(initial=0)) + 2, -1, np.int64)
    np.maximum.at(last, contours.epoch[actions.contour[prints]] + 1, prints)
    return np.maximum.accumulate(last)


def check_file_epochs(line: Ints, match: Ints, source_epoch: Ints) -> list[Fault]:
    """Check a file: the epochs of its extrusions, taken from the source, never go back.

    Parameters
    ----------
    line : (n,) line of each extrusion of the file, in its order
    match : (n,) the source's extrusion each one is, negative when none
    source_epoch : (m,) epoch of each extrusion of the source, negative outside contours
    """
    known = np.nonzero(match >= 0)[0]
    epoch = source_epoch[match[known]]
    known, epoch = known[epoch >= 0], epoch[epoch >= 0]
    back = known[np.maximum.accumulate(epoch) > epoch] if len(epoch) else known
    lines = [
        f"line {line[i]} prints what the source prints before a barrier already passed"
        for i in back[:LIMIT].tolist()
    ]
    return listed(FaultKind.PRECEDENCE, lines, total=len(back))
