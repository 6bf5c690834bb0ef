"""Actions cut into legs at the points other heads wait for.

Where another head waits for a vertex of an action's path, the action is cut there: the
legs are joined end to end, one follows the other, and only the first waits for what the action
waits for. Every wait then is for the end of a leg, so whatever is true of chains of actions
(`sim.rules.order`, `sim.replay`) is true of chains of legs. Between two legs a head may rest as
long as it likes: no timing is believed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decmcts.print.plan import ACTION_END, HeadActions
from sim.content.paths import describe

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Legs:
    """The heads' actions, and the legs they are cut into."""

    whole: tuple[HeadActions, ...]  # as the plan has them
    lanes: tuple[HeadActions, ...]  # leg by leg; every wait is for the end of a leg
    origin: tuple[Ints, ...]  # per head (n_legs,) the action a leg is of
    rows: tuple[Ints, ...]  # per head: of which point of the action's path each point is

    @property
    def cut(self) -> bool:
        """Whether any action has more than one leg."""
        return any(len(a) < len(b) for a, b in zip(self.whole, self.lanes, strict=True))

    def begins(self, head: int) -> Flags:
        """Tell of each leg of a head whether its action begins with it."""
        return np.asarray(np.diff(self.origin[head], prepend=-1) > 0)

    def last(self, head: int) -> Ints:
        """Return for each leg of a head the last leg of its action."""
        ends = np.searchsorted(self.origin[head], self.origin[head], side="right") - 1
        return ends.astype(np.int64)

    def arrivals(self, head: int, whole: Floats) -> Floats:
        """Return the seconds since each leg began from those since its action began."""
        offsets, at = self.lanes[head].path_offsets, whole[self.rows[head]]
        begun = at[offsets[:-1]]
        begun[self.begins(head)] = 0.0  # a wait has all its time here
        return np.asarray(at - np.repeat(begun, np.diff(offsets)))

    def describe(self, head: int, leg: int) -> str:
        """Return the words for one leg: its action and, where that is cut, from where to where."""
        action = int(self.origin[head][leg])
        words = describe(self.whole[head], action)
        low, high = self._points(head, leg)
        size = int(np.diff(self.whole[head].path_offsets)[action])
        return words if high - low == size - 1 else f"{words}, points {low} to {high}"

    def describe_rest(self, head: int, leg: int) -> str:
        """Return the words for the rest behind one leg: within its action or after it."""
        words = describe(self.whole[head], int(self.origin[head][leg]))
        inside = leg + 1 < len(self.origin[head]) and not np.diff(self.origin[head])[leg]
        if inside:
            return f"{words} at point {self._points(head, leg)[1]}"
        return f"the rest after {words}"

    def _points(self, head: int, leg: int) -> tuple[int, int]:
        """Return the first and the last vertex of a leg, counted in its action's path."""
        offsets = self.lanes[head].path_offsets
        first = int(self.whole[head].path_offsets[self.origin[head][leg]])
        rows = self.rows[head][[int(offsets[leg]), int(offsets[leg + 1]) - 1]] - first
        return int(rows[0]), int(rows[1])


def legs_of(lanes: tuple[HeadActions, ...]) -> Legs:
    """Cut every action at the points that are waited for.

    Complexity O(points + after edges).
    """
    cuts = [np.zeros(len(lane.path), np.bool_) for lane in lanes]
    for lane in lanes:
        for head, row in zip(lane.after_head.tolist(), _row(lane, lanes).tolist(), strict=True):
            cuts[head][row] = True
    for lane, cut in zip(lanes, cuts, strict=True):
        cut[lane.path_offsets[1:] - 1] = False  # where a leg ends anyway
    origin, rows = [], []
    for lane, cut in zip(lanes, cuts, strict=True):
        owner = np.repeat(np.arange(len(lane)), np.diff(lane.path_offsets))
        ends = np.concatenate([np.arange(len(lane)), owner[cut]])
        origin.append(np.sort(ends).astype(np.int64))
        rows.append(np.repeat(np.arange(len(cut)), 1 + cut))
    cut_lanes = tuple(_cut(h, lanes, cuts, origin[h], rows[h]) for h in range(len(lanes)))
    return Legs(lanes, cut_lanes, tuple(origin), tuple(rows))


def _row(lane: HeadActions, lanes: tuple[HeadActions, ...]) -> Ints:
    """Return for each edge into a head the row of the other's path that must be passed."""
    rows = np.empty(len(lane.after_head), np.int64)
    for head, other in enumerate(lanes):
        mine = lane.after_head == head
        action, point = lane.after_action[mine], lane.after_point[mine]
        end = other.path_offsets[1:][action] - 1
        rows[mine] = np.where(point == ACTION_END, end, other.path_offsets[:-1][action] + point)
    return rows


def _cut(
    h: int, lanes: tuple[HeadActions, ...], cuts: list[Flags], origin: Ints, rows: Ints
) -> HeadActions:
    """Return the legs of one head; each wait names the leg that ends where it waits for."""
    lane, before = lanes[h], [np.concatenate([[0], np.cumsum(cut)]) for cut in cuts]
    starts, inner = lane.path_offsets[:-1], np.flatnonzero(cuts[h])
    begins = np.sort(np.concatenate([starts + before[h][starts], inner + before[h][inner] + 1]))
    leg = np.empty(len(lane.after_head), np.int64)
    for head in range(len(lanes)):
        mine = lane.after_head == head
        leg[mine] = lane.after_action[mine] + before[head][_row(lane, lanes)[mine]]
    edges = np.zeros(len(origin), np.int64)
    first = np.searchsorted(origin, np.arange(len(lane)))
    edges[first] = np.diff(lane.after_offsets)
    return replace(
        lane,
        kind=lane.kind[origin],
        contour=lane.contour[origin],
        reversed=lane.reversed[origin],
        entry=lane.entry[origin],
        path_offsets=np.concatenate([begins, [len(rows)]]).astype(np.int64),
        path=lane.path[rows],
        begin_s=lane.begin_s[origin],
        end_s=lane.end_s[origin],
        after_offsets=np.concatenate([[0], np.cumsum(edges)]).astype(np.int64),
        after_action=leg.astype(np.int32),
        after_point=np.full(len(leg), ACTION_END, np.int32),
    )
