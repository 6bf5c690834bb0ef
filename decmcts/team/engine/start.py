"""A joint order to begin with, as macro-actions that the heads' plans change.

A macro-action of a stated order is a run of contours that one head prints on one layer, one
after the other: a strip of a sweep, or a part of it. A head's plan says of its own
macro-actions how many turns sooner or later they come, and to which other head they are given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.feasibility.graph import DependencyGraph
from decmcts.team.engine.plans import Changes, StatedOrder
from decmcts.team.engine.sweep_kernels import not_before

LONG = 1.5  # runs that take longer than so many medians are parted


@dataclass(frozen=True, slots=True, eq=False)
class StartingOrder:
    """A joint order and its macro-actions, numbered in its order."""

    stated: StatedOrder
    macro: Ints  # (n,) of each contour
    head: Ints  # (n_macros,) who prints it
    layer: Ints  # (n_macros,)
    middle_mm: Floats  # (n_macros,) where it lies along the heads' axis

    @property
    def n_macros(self) -> int:
        """How many macro-actions there are."""
        return len(self.head)


def start_of(stated: StatedOrder, layer: Ints, middle_mm: Floats, seconds: Floats) -> StartingOrder:
    """Return a joint order cut into macro-actions.

    Parameters
    ----------
    stated : StatedOrder
        Of all contours.
    layer, middle_mm, seconds : (n,)
        Of each contour: its layer, its place along the heads' axis and how long it takes.
    """
    order, n = stated.order, len(stated.order)
    begins = (np.diff(stated.head, prepend=-1) != 0) | (np.diff(layer[order], prepend=-1) != 0)
    run = np.cumsum(begins) - 1
    took = np.bincount(run, weights=seconds[order])
    done = np.cumsum(seconds[order]) - seconds[order] - (np.cumsum(took) - took)[run]
    longest = LONG * float(np.median(took)) if len(took) else 1.0
    parts = np.maximum(1, np.ceil(took / max(longest, 1e-9))).astype(np.int64)
    part = np.minimum((done / took[run] * parts[run]).astype(np.int64), parts[run] - 1)
    first = begins | (np.diff(part, prepend=-1) != 0)
    number = np.cumsum(first) - 1
    macro = np.empty(n, np.int64)
    macro[order] = number
    rows = np.flatnonzero(first)
    middle = np.bincount(number, weights=middle_mm[order]) / np.bincount(number)
    return StartingOrder(
        stated, macro, stated.head[rows], layer[order[rows]].astype(np.int64), middle
    )


def changed_order(
    start: StartingOrder,
    changes: Mapping[int, Changes],
    eligible: Flags,
    graph: DependencyGraph,
) -> StatedOrder:
    """Return the joint order after what each head changes of its own macro-actions.

    What must come before something comes no later than that. A head gets only what it may print.
    """
    key, to = 2 * np.arange(start.n_macros), start.head.copy()
    for r, change in changes.items():
        known = (change.macro < start.n_macros) & (change.head < eligible.shape[1])
        rows = np.flatnonzero(known)
        rows = rows[start.head[change.macro[rows]] == r]
        key[change.macro[rows]] += change.later[rows]
        to[change.macro[rows]] = change.head[rows]
    order = start.stated.order
    head = np.empty(len(order), np.int64)
    head[order] = start.stated.head
    wanted = to[start.macro]
    head = np.where(eligible[np.arange(len(head)), wanted], wanted, head)
    turn = key[start.macro]
    not_before(turn, graph.pred_offsets, graph.preds)
    row = np.argsort(turn[order], kind="stable")
    return StatedOrder(order[row], start.stated.reversed[row], head[order[row]])
