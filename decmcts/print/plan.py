"""Joint plans: for each head a sequence of actions, plus cross-head order.

A plan for one head is a joint plan of one head. Rules J1-J5 that make a joint
plan safe are stated in docs/definitions.md; `sim` checks them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.print.brief import brief
from decmcts.print.contours import Contours
from decmcts.print.machine import Fenced, Machine
from decmcts.print.metrics import Metrics

T = TypeVar("T", bound=np.generic)


class ActionKind(IntEnum):
    """What a head does in one action."""

    PRINT = 0
    TRAVEL = 1
    PARK = 2
    WAIT = 3


NO_CONTOUR = -1
ACTION_END = -1  # for a point: the action must have ended


class After(NamedTuple):
    """What an action waits for: another head's action, a point of its path and a lag."""

    head: int  # index of another head in the plan
    action: int
    point: int = ACTION_END  # vertex of that action's path its nozzle must have passed
    lag_s: float = 0.0  # seconds that must pass after that


@dataclass(frozen=True, slots=True)
class HeadActions:
    """The actions of one head in the order it executes them.

    Each action's path is the whole polyline its nozzle follows; it starts where
    the previous one ended, the first at the head's park position.
    """

    head: str
    kind: NDArray[np.int8]  # (k,) ActionKind
    contour: Int32s  # (k,) contour id or NO_CONTOUR
    reversed: Flags  # (k,)
    entry: Int32s  # (k,) entry vertex of a closed contour
    path_offsets: Ints  # (k + 1,)
    path: Floats  # (path_offsets[-1], 3)
    begin_s: Floats  # (k,) nominal, seconds
    end_s: Floats  # (k,)
    after_offsets: Ints  # (k + 1,) rows of after_head / after_action
    after_head: Int32s  # (m,) index of another head in the plan
    after_action: Int32s  # (m,) its action that is waited for,
    after_point: Int32s  # (m,) the vertex of it that must be passed, or ACTION_END
    after_lag_s: Floats  # (m,) and seconds that must pass after that

    __repr__ = brief("head", "kind", "end_s")

    def __len__(self) -> int:
        return len(self.kind)

    def action_path(self, action: int) -> Floats:
        """Polyline of one action, (k, 3)."""
        return self.path[self.path_offsets[action] : self.path_offsets[action + 1]]

    def after(self, action: int) -> list[tuple[int, int]]:
        """Return (head index, action index) pairs that `action` waits for, whatever the point."""
        rows = slice(int(self.after_offsets[action]), int(self.after_offsets[action + 1]))
        return list(
            zip(self.after_head[rows].tolist(), self.after_action[rows].tolist(), strict=True)
        )

    def after_edges(self, action: int) -> list[After]:
        """Return what must have happened before `action` begins."""
        rows = slice(int(self.after_offsets[action]), int(self.after_offsets[action + 1]))
        columns = (self.after_head, self.after_action, self.after_point, self.after_lag_s)
        return list(map(After, *(column[rows].tolist() for column in columns)))


def end_edges(m: int) -> tuple[Int32s, Floats]:
    """Return `after_point` and `after_lag_s` of m edges that wait for ends, without lags."""
    return np.full(m, ACTION_END, np.int32), np.zeros(m)


@dataclass(frozen=True, slots=True)
class JointPlan:
    """What every head does, in an order that is safe for every timing."""

    heads: tuple[HeadActions, ...]

    __repr__ = brief("makespan_s", "heads")

    @property
    def makespan_s(self) -> float:
        """Nominal end of the last action."""
        return max((float(h.end_s[-1]) for h in self.heads if len(h)), default=0.0)

    @property
    def assignments(self) -> Int32s:
        """Place in `heads` of the head that prints each contour, (n,)."""
        prints = [np.full(len(h), k, np.int32) for k, h in enumerate(self.heads)]
        return self._by_contour(prints)

    @property
    def schedule(self) -> Floats:
        """When each contour begins and ends, (n, 2) s since the print began."""
        return self._by_contour([np.stack([h.begin_s, h.end_s], axis=1) for h in self.heads])

    @property
    def order(self) -> NDArray[np.intp]:
        """Contours in the order in which they begin, (n,)."""
        return np.argsort(self.schedule[:, 0], kind="stable")

    def _by_contour(self, of_actions: Sequence[NDArray[T]]) -> NDArray[T]:
        """Return what holds for actions, an array a head, by the contour that is printed."""
        contour = np.concatenate([head.contour for head in self.heads])
        prints = np.concatenate([head.kind for head in self.heads]) == ActionKind.PRINT
        found: NDArray[T] = np.concatenate(of_actions)[prints]
        return found[np.argsort(contour[prints])]


@dataclass(frozen=True, slots=True)
class OrderRules:
    """What was asked of the order besides safety."""

    process_order: str = "keep"  # "keep" or "free"
    quality: bool = True  # shells and what is anchored in them stay as sliced
    max_layers_ahead: int | None = None  # None: no limit
    freedom: str = "seam"  # "fixed", "reversible" or "seam"
    cut: str = "none"  # what may be cut: "none", "inside" or "all"
    weld_limit_s: float | None = None  # no weld of a cut is older; None: no limit


@dataclass(frozen=True, slots=True)
class PlanDocument:
    """A plan with all that is needed to check or draw it without the source."""

    problem: str  # digest of contours, precedence and machine
    machine: Machine
    contours: Contours
    precedence: Int32s  # (m, 2) pairs (a, b): a ends before b begins
    plan: JointPlan
    metrics: Metrics
    min_layer_time_s: float = 0.0  # no spot is printed over sooner, or than in source order
    rules: OrderRules | None = None  # None: it does not say
    acceleration: Floats | None = None
    # (n_points,) mm/s² set for the segment ending at each point of the contours; 0: the head's
    # own; None: it does not say
    printed: Contours | None = None  # what stands on the bed before the plan begins
    fenced: Fenced | None = None  # heads that stand in the way and print no more
    print_with: tuple[tuple[int, int], ...] = ()  # of a rest: tools of the print it is left of, and
    # those that print for them, as a person has allowed

    __repr__ = brief("problem", "machine.name", "contours", "plan", "rules")
