"""An old joint order for what is left of its print: no search, but somebody must take over.

What a head leaves that prints no more goes to others in four simple ways, of which the soonest
counts: to the one that parks nearest, or part by part to the one that has the least to do; at its
turn in the old order, or behind all that does not wait for it. The rest of a print may demand more
than the print did: then contours come as soon as they may.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.team.engine.alone import nearest_first
from decmcts.team.engine.plans import StatedOrder, encode_stated
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import Resolved, resolve
from decmcts.team.engine.sweep_kernels import not_before

Ints = NDArray[np.int64]


class Old(NamedTuple):
    """The order of the plan that was carried out, as far as it matters for the rest."""

    order: StatedOrder  # of all contours of the plan
    left: Ints  # (n,) which of these each contour of the rest is, rising
    head: Ints  # (heads,) which of the rest's heads each was; -1: it prints no more


def retimed(team: TeamProblem, old: Old) -> tuple[StatedOrder, Resolved]:
    """Return what is left of an old order, and when heads are done that carry it out.

    Raises
    ------
    InputError
        Where heads cannot carry it out.
    """
    found = []
    for balanced, behind in product((False, True), repeat=2):
        order = _taken_over(team, old, balanced=balanced, behind=behind)
        resolved = _stated(team, order)
        if _is_kept(order, resolved):
            found.append((order, resolved))
    if not found:
        raise InputError("what is left cannot be printed in the old order")
    return min(found, key=lambda one: one[1].makespan_s)


def _stated(team: TeamProblem, order: StatedOrder) -> Resolved:
    heads = len(team.machine.heads)
    return resolve(team, {0: encode_stated(order, heads, team.n_macros)}, range(heads))


def _is_kept(order: StatedOrder, resolved: Resolved) -> bool:
    """Tell whether each head does what the order says; else heads cannot carry it out."""
    return all(
        np.array_equal(found.order, order.order[order.head == r])
        for r, found in enumerate(resolved.toolpaths)
    )


def _taken_over(team: TeamProblem, old: Old, *, balanced: bool, behind: bool) -> StatedOrder:
    """Return what is left of an old order, with what nobody prints taken over."""
    kept = np.isin(old.order.order, old.left)
    was = np.searchsorted(old.left, old.order.order[kept])
    turn, head = np.empty(len(was), np.int64), np.empty(len(was), np.int64)
    turn[was], head[was] = np.arange(len(was)), old.head[old.order.head[kept]]
    due = turn + len(turn) * ((head < 0) & behind)
    not_before(due, team.graph.pred_offsets, team.graph.preds)
    order = np.argsort(due, kind="stable").astype(np.int32)
    _give(team, head, order, balanced=balanced)
    return StatedOrder(order, old.order.reversed[kept][turn[order]], head[order])


def _give(team: TeamProblem, head: Ints, order: NDArray[np.int32], *, balanced: bool) -> None:
    """Fill in who prints each contour that has no head, (n,) `head`."""
    eligible, seconds = team.space.eligible, team.visits.seconds
    heads = range(eligible.shape[1])
    nearest = nearest_first(team.space, heads)
    work = [float(seconds[r, head == r].sum()) for r in heads]
    rows = order[head[order] < 0]
    for part in dict.fromkeys(team.part[rows].tolist()):
        first = sorted(heads, key=work.__getitem__) if balanced else nearest
        for c in rows[team.part[rows] == part].tolist():
            head[c] = next(r for r in first if eligible[c, r])
            work[head[c]] += float(seconds[head[c], c])
