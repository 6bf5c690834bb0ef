"""The source's book of filament: what it pushes and pulls between its contours, and by which tool.

A gap is what lies between two contours. What its moves push less what they pull is its *net*. The
net goes with the contour behind the gap, whatever comes before that in another order, so that each
tool gives in all orders what it gives in the source. Net and not retraction is counted: what a
macro has pushed or pulled is not known, and must not be made up for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.controller.moves_kernels import TOOL
from decmcts.formats.gcode.reading.grouping import Runs

DEPOSIT_MM = 0.2  # filament left in a gap beyond the habit: a blob, not a retraction
SETTLED_MM = 0.01  # of filament; a gap whose net is less has pushed back what it pulled
PULLED = 0.01  # mm of filament that counts as a retraction

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Gaps:
    """Filament between contours k and k + 1, each (n - 1,)."""

    tool: NDArray[np.int64]  # in use where the gap ends
    changes: Bools  # another tool was in use where it begins
    net: Floats  # pushed less pulled, mm, by all tools
    depth: Floats  # most that is pulled and not pushed back within it, mm


def gaps_of(motion: Motion, runs: Runs) -> Gaps:
    """Return the book of a source's gaps; linear in its moves."""
    begin, end = runs.last[:-1] + 1, runs.first[1:]
    total = totals(motion)
    tool = motion.modes[motion.line, TOOL].astype(np.int64)
    lowest = total[begin]
    if len(begin):
        pairs = np.stack([begin, end + 1], axis=1).ravel()
        lowest = np.minimum.reduceat(np.append(total, np.inf), pairs)[::2]
    return Gaps(
        tool[runs.first[1:]], tool[runs.first[1:]] != tool[runs.last[:-1]],
        total[end] - total[begin], total[begin] - lowest,
    )  # fmt: skip


def totals(motion: Motion) -> Floats:
    """Return the filament pushed less what is pulled before each move and behind all, (m + 1,)."""
    return np.concatenate([[0.0], np.cumsum(motion.extrusion)])


def deposits(motion: Motion, runs: Runs, gaps: Gaps) -> Bools:
    """Tell which gaps leave filament that no contour has, (n - 1,).

    Beyond what the tool usually leaves, be it nothing, or what a restart distance adds. In
    a gap in which the tool changes neither the one that comes nor both together may do so: what
    one has pulled another may push, when it is used for the first time.
    """
    net, kept = gaps.net, ~gaps.changes
    usual = np.zeros(len(net))
    for tool in np.unique(gaps.tool[kept]).tolist():
        own = gaps.tool == tool
        usual[own] = np.median(net[own & kept])
    over = net > np.maximum(usual, 0.0) + DEPOSIT_MM
    under = net < np.minimum(usual, 0.0) - DEPOSIT_MM
    found = kept & (over | under)
    found[gaps.changes] = _left_by_changes(motion, runs, gaps)
    return np.asarray(found)


def _left_by_changes(motion: Motion, runs: Runs, gaps: Gaps) -> Bools:
    """Tell which of the gaps with a change of tools leave filament, in their order."""
    held: dict[int, float] = {}  # net of each tool since its last contour
    found = []
    for k in np.flatnonzero(gaps.changes).tolist():
        span = slice(int(runs.last[k]) + 1, int(runs.first[k + 1]))
        for tool, filament in zip(
            motion.modes[motion.line[span], TOOL].tolist(), motion.extrusion[span].tolist(),
            strict=True,
        ):  # fmt: skip
            held[tool] = held.get(tool, 0.0) + filament
        left = held.pop(int(gaps.tool[k]), 0.0)
        found.append(abs(left) > DEPOSIT_MM and abs(gaps.net[k]) > DEPOSIT_MM)
    return np.array(found, np.bool_)


def unsettled(gaps: Gaps, unknown: Bools) -> Bools:
    """Tell which gaps leave to a macro what they pull or push, (n - 1,).

    Parameters
    ----------
    unknown : (n - 1,) bool
        Gaps with a line of which it is not known what it does to the filament.
    """
    usual = float(np.median(gaps.net[~unknown])) if (~unknown).any() else 0.0
    settled = np.abs(gaps.net - (usual if abs(usual) < DEPOSIT_MM else 0.0)) <= SETTLED_MM
    return np.asarray(unknown & ~settled & ~(np.abs(gaps.net) <= SETTLED_MM))


def net_before(motion: Motion, runs: Runs, line: int) -> float:
    """Return the net, mm, of the moves above a line that come after the last contour there."""
    move = int(motion.before[line])
    k = int(np.searchsorted(runs.last, move)) - 1
    since = int(runs.last[k]) + 1 if k >= 0 else move
    return float(motion.extrusion[since:move].sum())


def net_behind(motion: Motion, runs: Runs, line: int) -> float:
    """Return the net, mm, of the moves from a line on that come before the next contour."""
    move = int(motion.before[line])
    k = int(np.searchsorted(runs.first, move))
    until = int(runs.first[k]) if k < len(runs.first) else move
    return float(motion.extrusion[move:until].sum())


def due_at_begins(gaps: Gaps, parted: Bools) -> Floats:
    """Return what the source leaves pulled where each contour begins, (n,) mm.

    Below 0 where it has pushed more than it pulled. What lies around the lines of a block
    (`parted`, (n,): one stands before the contour) is the block's.
    """
    due = np.zeros(len(parted))
    due[1:] = -gaps.net
    due[parted] = 0.0
    due[np.abs(due) < 1e-9] = 0.0
    due.setflags(write=False)
    return due
