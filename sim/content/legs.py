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

from decmcts.print.plan import ACTION_END, HeadActions
from sim.arrays import Flags, Floats, Ints
from sim.content.paths import describe


@dataclass(frozen=True, slots=True)
class Legs:
    """The heads' actions, and the legs they are cut into."""

    whole: tuple[HeadActions, ...]  # as the plan has them
    all_actions: tuple[HeadActions, ...]  # leg by leg; every wait is for the end of a leg
    origin: tuple[Ints, ...]  # per head (n_legs,) the action a leg is of
    rows: tuple[Ints, ...]  # per head (n_points,) the row of `whole`'s path that each point is

    @property
    def cut(self) -> bool:
        """Whether any action has more than one leg."""
        return any(len(a) < len(b) for a, b in zip(self.whole, self.all_actions, strict=True))

    def begins(self, head: int) -> Flags:
        """Tell of each leg of a head whether its action begins with it."""
        return np.asarray(np.diff(self.origin[head], prepend=-1) > 0)

    def last(self, head: int) -> Ints:
        """Return for each leg of a head the last leg of its action."""
        ends = np.searchsorted(self.origin[head], self.origin[head], side="right") - 1
        return ends.astype(np.int64)

    def arrivals(self, head: int, whole: Floats) -> Floats:
        """Return the seconds since each leg began from those since its action began."""
        offsets, at = self.all_actions[head].path_offsets, whole[self.rows[head]]
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

    def station(self, head: int, leg: int, rest: bool = False) -> str:
        """Return the words for a leg, the rest behind it, or (-1) what is before the first."""
        if leg < 0:
            return f"head {self.whole[head].head} before its first action"
        return self.describe_rest(head, leg) if rest else self.describe(head, leg)

    def _points(self, head: int, leg: int) -> tuple[int, int]:
        """Return the first and the last vertex of a leg, counted in its action's path."""
        offsets = self.all_actions[head].path_offsets
        first = int(self.whole[head].path_offsets[self.origin[head][leg]])
        rows = self.rows[head][[int(offsets[leg]), int(offsets[leg + 1]) - 1]] - first
        return int(rows[0]), int(rows[1])


def legs_of(all_actions: tuple[HeadActions, ...]) -> Legs:
    """Cut every action at the points that are waited for.

    Complexity O(points + after edges).
    """
    cuts = [np.zeros(len(actions.path), np.bool_) for actions in all_actions]
    for actions in all_actions:
        for head, row in zip(
            actions.after_head.tolist(), _row(actions, all_actions).tolist(), strict=True
        ):
            cuts[head][row] = True
    for actions, cut in zip(all_actions, cuts, strict=True):
        cut[actions.path_offsets[1:] - 1] = False  # where a leg ends anyway
    origin, rows = [], []
    for actions, cut in zip(all_actions, cuts, strict=True):
        owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
        ends = np.concatenate([np.arange(len(actions)), owner[cut]])
        origin.append(np.sort(ends).astype(np.int64))
        rows.append(np.repeat(np.arange(len(cut)), 1 + cut))
    cut_actions = tuple(
        _cut(h, all_actions, cuts, origin[h], rows[h]) for h in range(len(all_actions))
    )
    return Legs(all_actions, cut_actions, tuple(origin), tuple(rows))


def _row(actions: HeadActions, all_actions: tuple[HeadActions, ...]) -> Ints:
    """Return for each edge into a head the row of the other's path that must be passed."""
    rows = np.empty(len(actions.after_head), np.int64)
    for head, other in enumerate(all_actions):
        mine = actions.after_head == head
        action, point = actions.after_action[mine], actions.after_point[mine]
        end = other.path_offsets[1:][action] - 1
        rows[mine] = np.where(point == ACTION_END, end, other.path_offsets[:-1][action] + point)
    return rows


def _cut(
    h: int, all_actions: tuple[HeadActions, ...], cuts: list[Flags], origin: Ints, rows: Ints
) -> HeadActions:
    """Return the legs of one head; each wait names the leg that ends where it waits for."""
    actions, before = all_actions[h], [np.concatenate([[0], np.cumsum(cut)]) for cut in cuts]
    starts, inner = actions.path_offsets[:-1], np.flatnonzero(cuts[h])
    begins = np.sort(np.concatenate([starts + before[h][starts], inner + before[h][inner] + 1]))
    leg = np.empty(len(actions.after_head), np.int64)
    for head in range(len(all_actions)):
        mine = actions.after_head == head
        leg[mine] = actions.after_action[mine] + before[head][_row(actions, all_actions)[mine]]
    edges = np.zeros(len(origin), np.int64)
    first = np.searchsorted(origin, np.arange(len(actions)))
    edges[first] = np.diff(actions.after_offsets)
    return replace(
        actions,
        kind=actions.kind[origin],
        contour=actions.contour[origin],
        reversed=actions.reversed[origin],
        entry=actions.entry[origin],
        path_offsets=np.concatenate([begins, [len(rows)]]).astype(np.int64),
        path=actions.path[rows],
        begin_s=actions.begin_s[origin],
        end_s=actions.end_s[origin],
        after_offsets=np.concatenate([[0], np.cumsum(edges)]).astype(np.int64),
        after_action=leg.astype(np.int32),
        after_point=np.full(len(leg), ACTION_END, np.int32),
    )
