"""How far a print has come: from its events, or from the layers that are printed.

A head carries its actions out in order, so what it has done is one number a head and, of the
action it was at, how far its nozzle came. Nothing of an event stream is believed that its plan
does not allow. What was carried out is a plan of its own, at the times of the events (`happened`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.errors import InputError
from decmcts.print.machine import Point
from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, JointPlan, PlanDocument
from decmcts.print.print_events import NO_ACTION, EventKind, EventLog, PrintEvent

SAME_S = 1e-3  # events so near in time may stand in any order
NEAR_MM = 0.01  # a nozzle so near to a bead's begin has printed nothing of it


@dataclass(frozen=True, slots=True)
class HeadState:
    """How far one head has come."""

    head: str
    ended: int  # actions that have ended
    begun: bool = False  # the next action has begun
    point: int = 0  # points of its path behind the first that the nozzle has passed
    at: Point | None = None  # where the nozzle was seen last, mm; None: it was not seen
    clock_s: float = 0.0  # of its last event
    failed: bool = False  # it prints no more, and `at` is where it stopped

    @property
    def is_exact(self) -> bool:
        """Tell whether it is known how much of a bead that has begun is printed."""
        return self.failed and self.at is not None


@dataclass(frozen=True, slots=True)
class PrintState:
    """What is printed of a plan, and where its heads are."""

    heads: tuple[HeadState, ...]  # in the order of the plan
    done: Flags  # (n,) contours of the plan that are printed
    broken: tuple[tuple[int, int], ...] = ()  # head and action of beads that were broken off

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the heads that print no more."""
        return tuple(head.head for head in self.heads if head.failed)


def state_of_layers(document: PlanDocument, layers: int) -> PrintState:
    """Return the state in which so many layers are printed, and nothing above.

    Raises
    ------
    InputError
        Where the print has not so many layers, or the order does not allow that state; for the
        rest of a print, whose layers are not those of the print.
    """
    if document.printed is not None:
        raise InputError(
            "this plan is the rest of a print, and counts layers from its own first",
            advice="give the height that is printed: --height Z",
        )
    layer = document.contours.layer
    count = int(layer.max(initial=-1)) + 1
    if not 1 <= layers <= count:
        raise InputError(
            f"layer {layers}: the plan has layers 1 to {count}",
            advice="name the last layer that is printed whole",
        )
    return _printed_state(document, layer < layers)


def state_of_height(document: PlanDocument, height_mm: float) -> PrintState:
    """Return the state in which all is printed whose beads end at a height, and nothing above.

    Raises
    ------
    InputError
        Where nothing is printed so low, or the order does not allow that state.
    """
    top = document.contours.top
    lowest = float(top.min(initial=np.inf))
    if not lowest <= height_mm + NEAR_MM:
        raise InputError(
            f"height {height_mm:g} mm: the lowest bead of the plan ends at {lowest:g} mm",
            advice="name the height up to which all is printed",
        )
    return _printed_state(document, top <= height_mm + NEAR_MM)


def _printed_state(document: PlanDocument, done: Flags) -> PrintState:
    """Return the state in which these contours are printed, (n,) `done`."""
    heads = tuple(HeadState(head.head, 0) for head in document.plan.heads)
    return _closed(document, PrintState(heads, done))


def state_of_events(document: PlanDocument, log: EventLog) -> PrintState:
    """Return the state a stream of events leaves a plan in.

    Raises
    ------
    InputError
        For events of another plan, and for what no execution of this plan comes to.
    """
    names = tuple(head.head for head in document.plan.heads)
    if log.problem != document.problem or log.heads != names:
        whose = "no plan" if not log.problem else f"the plan of problem {log.problem[:12]}"
        raise InputError(
            f"the events are of {whose} with heads {', '.join(log.heads)}, not of this one "
            f"({document.problem[:12]}, {', '.join(names)})",
            advice="name the events of the plan that was carried out",
        )
    heads = [HeadState(name, 0) for name in names]
    for event in log.events:
        heads[event.head] = _after(heads[event.head], event, document.plan.heads[event.head])
    _refuse_waits(document, heads)
    return state_of_heads(document, heads)


def state_of_heads(document: PlanDocument, heads: Sequence[HeadState]) -> PrintState:
    """Return the state in which heads of a plan, in its order, have come so far.

    Raises
    ------
    InputError
        For what the order of the plan does not allow.
    """
    done = np.zeros(len(document.contours), np.bool_)
    broken = []
    for h, (state, actions) in enumerate(zip(heads, document.plan.heads, strict=True)):
        printed = actions.contour[: state.ended]
        done[printed[printed >= 0]] = True
        if _is_broken(state, actions):
            done[int(actions.contour[state.ended])] = True
            broken.append((h, state.ended))
    return _closed(document, PrintState(tuple(heads), done, tuple(broken)))


def _after(state: HeadState, event: PrintEvent, actions: HeadActions) -> HeadState:
    """Return the state of a head behind one more event; raises InputError for an absurd one."""
    if _is_late(state, event):
        return state
    _refuse_event(state, event, actions)
    fails = event.kind is EventKind.FAILED
    seen = replace(state, at=event.at, clock_s=event.time_s, failed=fails)
    if event.action == NO_ACTION or (fails and event.action < state.ended):
        return seen
    if event.kind is EventKind.ENDED:
        return replace(seen, ended=event.action + 1, begun=False, point=0)
    before = state.begun and event.action == state.ended
    begun = before or event.kind in (EventKind.BEGAN, EventKind.PASSED) or event.point > 0
    return replace(seen, ended=event.action, begun=begun, point=event.point)


def _is_late(state: HeadState, event: PrintEvent) -> bool:
    """Tell whether an event of an action that has ended is reported behind that, at its time.

    Such as its end behind the begin of the next, or that its last point is passed.
    """
    of_last = event.action == state.ended - 1
    of_last = of_last and event.kind in (EventKind.ENDED, EventKind.PASSED)
    return of_last and abs(event.time_s - state.clock_s) <= SAME_S


def _refuse_event(state: HeadState, event: PrintEvent, actions: HeadActions) -> None:
    """Raise InputError for an event that cannot come behind this state of its head."""
    where, k = f"head {state.head} at {event.time_s:g} s", event.action
    if event.time_s < state.clock_s:
        raise InputError(f"{where}: an event before the one at {state.clock_s:g} s")
    if state.failed:
        raise InputError(f"{where}: an event of a head that has failed")
    if k == NO_ACTION:
        return
    size = len(actions.action_path(k)) if k < len(actions) else 0
    if k >= len(actions) or event.point >= max(size, 1):
        raise InputError(
            f"{where}: action {k}, point {event.point}; the plan has {len(actions)} actions, "
            f"and this one {size} points"
        )
    if k < state.ended and event.kind is not EventKind.FAILED:  # it may name the last it did
        raise InputError(f"{where}: action {k} again, which has ended")
    first = state.ended + state.begun  # what had begun has ended when another action begins
    skipped = np.flatnonzero(actions.kind[first:k] == ActionKind.PRINT)
    if len(skipped):
        raise InputError(
            f"{where}: action {k}, and no event says that action {first + int(skipped[0])}, a "
            "bead, has ended",
            advice="name all events of the print, none left out",
        )
    if k == state.ended and event.kind is not EventKind.ENDED and event.point < state.point:
        raise InputError(f"{where}: point {event.point} behind point {state.point}")


def _is_broken(state: HeadState, actions: HeadActions) -> bool:
    """Tell whether a head stopped within a bead."""
    k = state.ended
    if not state.begun or k >= len(actions) or actions.kind[k] != ActionKind.PRINT:
        return False
    if not state.is_exact or state.point or state.at is None:
        return True
    return float(np.linalg.norm(np.subtract(state.at, actions.action_path(k)[0]))) > NEAR_MM


def _refuse_waits(document: PlanDocument, heads: list[HeadState]) -> None:
    """Raise InputError where an action has begun that had to wait for what has not happened."""
    for state, actions in zip(heads, document.plan.heads, strict=True):
        for k in range(min(state.ended + state.begun, len(actions))):
            for edge in actions.after_edges(k):
                other = heads[edge.head]
                passed = edge.action < other.ended
                if edge.action == other.ended and edge.point != ACTION_END and other.begun:
                    passed |= edge.point <= other.point
                if not passed:
                    raise InputError(
                        f"by these events head {state.head} has begun action {k} before "
                        f"action {edge.action} of head {other.head}, for which it waits",
                        advice="name all events of the print, none left out",
                    )


def _closed(document: PlanDocument, state: PrintState) -> PrintState:
    """Return a state that the order of the plan allows; raises InputError for another."""
    pairs, done = document.precedence, state.done
    wrong = np.flatnonzero(done[pairs[:, 1]] & ~done[pairs[:, 0]])
    if len(wrong):
        a, b = pairs[wrong[0]].tolist()
        layer = document.contours.layer
        raise InputError(
            f"contour {b} (layer {layer[b] + 1}) cannot be printed while contour {a} (layer "
            f"{layer[a] + 1}), which comes before it, is not",
            advice="name another layer, or the events of the print",
        )
    return state


def rest_of_line(path: Floats, point: int, at: Point) -> tuple[int, float]:
    """Return behind which point of a path a nozzle stopped, and at which share of the segment.

    Examples
    --------
    >>> rest_of_line(np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0]]), 1, (10.0, 2.5, 0.0))
    (1, 0.25)
    """
    if point + 1 >= len(path):
        return len(path) - 1, 0.0
    along = path[point + 1] - path[point]
    length = float(along @ along)
    share = float((np.subtract(at, path[point]) @ along) / length) if length else 0.0
    return point, min(max(share, 0.0), 1.0)


def nearest_on_segment(a: Floats, b: Floats, at: Point) -> tuple[float, Point]:
    """Return how far a place is from a segment, mm, and the point of it that is nearest.

    Examples
    --------
    >>> nearest_on_segment(np.zeros(3), np.array([10.0, 0.0, 0.0]), (2.0, 0.5, 0.0))
    (0.5, (2.0, 0.0, 0.0))
    """
    _, share = rest_of_line(np.array([a, b]), 0, at)
    x, y, z = (a + share * (b - a)).tolist()
    return float(np.linalg.norm(np.subtract(at, (x, y, z)))), (x, y, z)


def length_of(path: Floats) -> float:
    """Return the length of a polyline, mm."""
    return float(sum(np.linalg.norm(b - a) for a, b in pairwise(path)))


def whereabouts(state: HeadState, actions: HeadActions, park: Point) -> Floats:
    """Return a line on which a nozzle stands somewhere, (k, 3) mm; one point: exactly there.

    A head that was at an action when it was seen last may have gone on to its end; behind an
    action that ended, it stands there. (A wipe never goes back past a point that was passed and
    that another head waits for.) One that was not seen stands at its park.
    """
    if state.at is None:
        return np.array([park], np.float64)
    line = np.array([state.at], np.float64)
    if state.is_exact or not state.begun or state.ended >= len(actions):
        return line
    ahead = actions.action_path(state.ended)[state.point :]
    line = np.concatenate([line, ahead])
    moved = (np.diff(line, axis=0) != 0.0).any(axis=1)
    return np.asarray(line[np.concatenate([[True], moved])])


def taken_to_parks(state: PrintState) -> PrintState:
    """Return a state whose heads that work stand at their parks, wherever they were seen."""
    heads = [one if one.failed else replace(one, at=None) for one in state.heads]
    return replace(state, heads=tuple(heads))


def happened(document: PlanDocument, log: EventLog) -> PlanDocument:
    """Return what was carried out of a plan, as a plan of its own, with the times of events.

    Actions that did not end are left out, with all that their heads should have done behind them.
    Actions of which no event tells, such as waits, last until the next one begins.

    Parameters
    ----------
    log : EventLog
        Events of this plan, see `decmcts.print.print_state.state_of_events`.
    """
    times = [_times(actions, log, h) for h, actions in enumerate(document.plan.heads)]
    counts = np.array([len(begin) for begin, _ in times])
    plan = JointPlan(
        tuple(
            _first(actions, begin, end, counts)
            for actions, (begin, end) in zip(document.plan.heads, times, strict=True)
        )
    )
    return replace(document, plan=plan, metrics={"makespan_s": plan.makespan_s})


def _times(actions: HeadActions, log: EventLog, h: int) -> tuple[Floats, Floats]:
    """Return when the actions of a head began and ended, up to the last that ended, (k,) each."""
    begin, end = np.full(len(actions), np.nan), np.full(len(actions), np.nan)
    for event in log.events:
        if event.head == h and 0 <= event.action < len(actions):
            if event.kind is EventKind.BEGAN:
                begin[event.action] = event.time_s
            elif event.kind is EventKind.ENDED:
                end[event.action] = event.time_s
    ended = np.flatnonzero(np.isfinite(end))
    count = int(ended[-1]) + 1 if len(ended) else 0
    begin, end = begin[:count], end[:count]
    last = np.fmax.accumulate(np.concatenate([[0.0], end]))[:-1]  # when what is before has ended
    begin = np.where(np.isfinite(begin), begin, last)
    following = np.append(begin[1:], end[-1:])
    end = np.where(np.isfinite(end), end, following)
    return begin, np.maximum(end, begin)


def _first(actions: HeadActions, begin: Floats, end: Floats, counts: Ints) -> HeadActions:
    """Return a head's first actions at these times; `counts` says how many each head has."""
    k = len(begin)
    rows, points = int(actions.after_offsets[k]), int(actions.path_offsets[k])
    kept = actions.after_action[:rows] < counts[actions.after_head[:rows]]
    before = np.concatenate([[0], np.cumsum(kept)])
    return HeadActions(
        actions.head, actions.kind[:k], actions.contour[:k], actions.reversed[:k],
        actions.entry[:k], actions.path_offsets[: k + 1], actions.path[:points], begin, end,
        before[actions.after_offsets[: k + 1]], actions.after_head[:rows][kept],
        actions.after_action[:rows][kept], actions.after_point[:rows][kept],
        actions.after_lag_s[:rows][kept],
    )  # fmt: skip
