"""What each head does on its own: each contour once, along its polyline, by a head that can.

A head starts and ends at its park, never jumps between two actions, and stays within its
reach.

**Legs.** Where another head waits for a vertex of an action's path, the action is cut there: the
legs are joined end to end, one follows the other, and only the first waits for what the action
waits for. Every wait then is for the end of a leg, so whatever is true of chains of actions
(`sim.rules.order`, `sim.replay`) is true of chains of legs. Between two legs a head may rest as
long as it likes: no timing is believed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours
from decmcts.print.machine import Head
from decmcts.print.plan import ACTION_END, ActionKind, After, HeadActions, PlanDocument
from sim.content.seams import Moved, run_of
from sim.faults import Fault, FaultKind, listed

SAME_MM = 1e-3  # points nearer than this are one point: files keep three decimals
LARGEST_LAG_S = 1e7


def describe(actions: HeadActions, action: int) -> str:
    """Return the words for one action: head, number, kind and contour."""
    kind = ActionKind(int(actions.kind[action])).name.lower()
    contour = int(actions.contour[action])
    what = f"{kind} contour {contour}" if kind == "print" else kind
    return f"head {actions.head} action {action} ({what})"


def check_structure(document: PlanDocument) -> list[Fault]:
    """Check that indices mean something; nothing else can be checked where they do not."""
    heads = document.plan.heads
    names = [h.name for h in document.machine.heads]
    lines = [
        f"the plan has a head {h.head!r} that the machine lacks"
        for h in heads
        if h.head not in names
    ]
    if len({h.head for h in heads}) < len(heads):
        lines.append("a head appears twice in the plan")
    wrong = [line for h in heads for line in _bad_indices(h, heads, len(document.contours))]
    return listed(FaultKind.MACHINE, lines) + listed(FaultKind.WRONG_PATH, wrong)


def _bad_indices(actions: HeadActions, heads: tuple[HeadActions, ...], n: int) -> list[str]:
    """Return lines for actions that name things which do not exist, or have no path."""
    name = f"head {actions.head}"
    printing = actions.kind == ActionKind.PRINT
    lines = []
    if ((actions.contour[printing] < 0) | (actions.contour[printing] >= n)).any():
        lines.append(f"{name} prints a contour outside 0..{n - 1}")
    if not np.isin(actions.kind, [int(k) for k in ActionKind]).all():
        lines.append(f"{name} has an action of unknown kind")
    if len(actions) and int(np.diff(actions.path_offsets).min()) < 1:
        lines.append(f"{name} has an action without a path")
    if not np.isfinite(actions.path).all():
        lines.append(f"{name} has a path that is not finite")
    return lines + _bad_waits(actions, heads)


def _bad_waits(actions: HeadActions, heads: tuple[HeadActions, ...]) -> list[str]:
    """Return lines for waits that name no action, no point of one, or an impossible lag."""
    name, lines = f"head {actions.head}", []
    columns = (actions.after_head, actions.after_action, actions.after_point, actions.after_lag_s)
    for edge in map(After, *(column.tolist() for column in columns)):
        if not (0 <= edge.head < len(heads) and 0 <= edge.action < len(heads[edge.head])):
            lines.append(
                f"{name} waits for action {edge.action} of head number {edge.head}, "
                "which is not there"
            )
            continue
        other = heads[edge.head]
        size = int(other.path_offsets[edge.action + 1] - other.path_offsets[edge.action])
        moves = int(other.kind[edge.action]) != ActionKind.WAIT
        if edge.point != ACTION_END and not (moves and 0 < edge.point < size):
            points = f"1 to {size - 1}" if moves and size > 1 else "none"
            lines.append(
                f"{name} waits for point {edge.point} of {describe(other, edge.action)}, "
                f"points to pass: {points}"
            )
        if not 0.0 <= edge.lag_s <= LARGEST_LAG_S:
            lines.append(f"{name} waits {edge.lag_s:g} s after {describe(other, edge.action)}")
    return lines


def check_release(document: PlanDocument) -> list[Fault]:
    """Check that heads which signal only at rest are waited for only where an action ends."""
    if document.machine.release == "point":
        return []
    heads = document.plan.heads
    lines = [
        f"{describe(actions, k)} waits for point {edge.point} of "
        f"{describe(heads[edge.head], edge.action)}; heads of {document.machine.name} signal "
        "only that an action has ended"
        for actions in heads
        for k in np.flatnonzero(np.diff(actions.after_offsets)).tolist()
        for edge in actions.after_edges(k)
        if edge.point != ACTION_END
    ]
    return listed(FaultKind.MACHINE, lines)


def check_once(document: PlanDocument) -> list[Fault]:
    """J1: every contour is printed exactly once."""
    printed = [h.contour[h.kind == ActionKind.PRINT] for h in document.plan.heads]
    count = np.bincount(
        np.concatenate([*printed, np.empty(0, np.int32)]).astype(np.int64),
        minlength=len(document.contours),
    )
    missing = [f"contour {c} is never printed" for c in np.nonzero(count == 0)[0].tolist()]
    doubled = [
        f"contour {c} is printed {count[c]} times" for c in np.nonzero(count > 1)[0].tolist()
    ]
    return listed(FaultKind.MISSING, missing) + listed(FaultKind.DOUBLED, doubled)


def check_head(contours: Contours, actions: HeadActions, head: Head) -> list[Fault]:
    """Check one head's paths: joined, as the contours are, in reach, parked at both ends."""
    return [
        *_check_joined(actions, head),
        *_check_waits(actions),
        *_check_prints(contours, actions),
        *_check_reach(actions, head),
        *_check_tools(contours, actions, head),
    ]


def _check_joined(actions: HeadActions, head: Head) -> list[Fault]:
    """Each path starts where the last one ended; the first and the last point is the park."""
    if not len(actions):
        return []
    park = np.array(head.park)
    first, last = (
        actions.path[actions.path_offsets[:-1]],
        actions.path[actions.path_offsets[1:] - 1],
    )
    jump = np.linalg.norm(first[1:] - last[:-1], axis=1)
    lines = [
        f"{describe(actions, a + 1)} starts {jump[a]:.3f} mm from where the head stands"
        for a in np.nonzero(jump > SAME_MM)[0].tolist()
    ]
    parked = [
        f"head {actions.head} {verb} {np.linalg.norm(point - park):.3f} mm from its park position"
        for verb, point in (("starts", first[0]), ("ends", last[-1]))
        if np.linalg.norm(point - park) > SAME_MM
    ]
    parked += [
        f"{describe(actions, a)} does not end at the park position"
        for a in np.nonzero(actions.kind == ActionKind.PARK)[0].tolist()
        if np.linalg.norm(last[a] - park) > SAME_MM
    ]
    return listed(FaultKind.WRONG_PATH, lines) + listed(FaultKind.NOT_PARKED, parked)


def _check_waits(actions: HeadActions) -> list[Fault]:
    """Check that a head that waits stands still and one that moves takes time."""
    if not len(actions):
        return []
    begins, sizes = actions.path_offsets[:-1], np.diff(actions.path_offsets)
    x, y, z = np.abs(actions.path - np.repeat(actions.path[begins], sizes, axis=0)).T
    far = np.maximum.reduceat(np.maximum(np.maximum(x, y), z), begins)
    strays = np.flatnonzero((actions.kind == ActionKind.WAIT) & (far > SAME_MM))
    lines = [f"{describe(actions, a)} moves by {far[a]:.3f} mm" for a in strays.tolist()]
    hurried = np.flatnonzero((far > SAME_MM) & (actions.end_s <= actions.begin_s))
    timeless = [f"{describe(actions, a)} moves in no time" for a in hurried.tolist()]
    return listed(FaultKind.WRONG_PATH, lines) + listed(FaultKind.TIMES, timeless)


def _check_prints(contours: Contours, actions: HeadActions) -> list[Fault]:
    lines = [
        f"{describe(actions, a)} {problem}"
        for a in np.flatnonzero(actions.kind == ActionKind.PRINT).tolist()
        if (problem := _print_problem(contours, actions, a))
    ]
    return listed(FaultKind.WRONG_PATH, lines)


def _print_problem(contours: Contours, actions: HeadActions, a: int) -> str:
    contour, entry = int(actions.contour[a]), int(actions.entry[a])
    is_reversed = bool(actions.reversed[a])
    if is_reversed and not contours.reversible[contour]:
        return "runs reversed, but the source forbids that"
    path = actions.action_path(a)[:: -1 if is_reversed else 1]
    if entry:
        run = run_of(contours, Moved(contour, entry, path))
        return run if isinstance(run, str) else ""
    due = contours.polyline(contour)
    if path.shape != due.shape:
        return f"has {len(path)} points where the contour has {len(due)}"
    off = float(np.abs(path - due).max())
    return f"leaves the contour by {off:.3f} mm" if off > SAME_MM else ""


def _check_reach(actions: HeadActions, head: Head) -> list[Fault]:
    """Check that prints stay within the reach, other paths within it and the way to the park."""
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    printing = actions.kind[owner] == ActionKind.PRINT
    beyond = np.zeros(len(actions.path), np.bool_)
    limits = zip(head.reach_min, head.reach_max, head.park, strict=True)
    for axis, (low, high, park) in zip(actions.path.T.copy(), limits, strict=True):
        beyond |= axis < np.where(printing, low, min(low, park)) - SAME_MM
        beyond |= axis > np.where(printing, high, max(high, park)) + SAME_MM
    lines = [
        f"{describe(actions, a)} goes beyond the head's reach"
        for a in np.unique(owner[beyond]).tolist()
    ]
    return listed(FaultKind.OUT_OF_REACH, lines)


def _check_tools(contours: Contours, actions: HeadActions, head: Head) -> list[Fault]:
    if not head.tools:
        return []
    printed = np.nonzero(actions.kind == ActionKind.PRINT)[0]
    tool = contours.tool[actions.contour[printed]]
    lines = [
        f"{describe(actions, a)} needs tool {t}, the head has {', '.join(map(str, head.tools))}"
        for a, t in zip(printed.tolist(), tool.tolist(), strict=True)
        if t not in head.tools
    ]
    return listed(FaultKind.INELIGIBLE, lines)


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

    def station(self, head: int, leg: int, rest: bool = False) -> str:
        """Return the words for a leg, the rest behind it, or (-1) what is before the first."""
        if leg < 0:
            return f"head {self.whole[head].head} before its first action"
        if not rest:
            return self.describe(head, leg)
        words = describe(self.whole[head], int(self.origin[head][leg]))
        inside = leg + 1 < len(self.origin[head]) and not np.diff(self.origin[head])[leg]
        return (
            f"{words} at point {self._points(head, leg)[1]}"
            if inside
            else f"the rest after {words}"
        )

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
        rows_of_edges = _row(actions, all_actions)
        for head, cut in enumerate(cuts):
            cut[rows_of_edges[actions.after_head == head]] = True
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
    whole = ("kind", "contour", "reversed", "entry", "begin_s", "end_s")
    return replace(
        actions,
        **{name: getattr(actions, name)[origin] for name in whole},
        path_offsets=np.concatenate([begins, [len(rows)]]).astype(np.int64),
        path=actions.path[rows],
        after_offsets=np.concatenate([[0], np.cumsum(edges)]).astype(np.int64),
        after_action=leg.astype(np.int32),
        after_point=np.full(len(leg), ACTION_END, np.int32),
    )
