"""What the controllers of a run stated, plan by plan, and what follows from it.

That is where heads were, what is printed, who waited. Nothing here asks an agent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from agents.running.report import Reached
from decmcts.arrays import Floats
from decmcts.print.brief import brief
from decmcts.print.machine import Machine, Point
from decmcts.print.plan import ACTION_END, PlanDocument
from decmcts.print.print_events import NO_ACTION, EventKind, EventLog, PrintEvent
from decmcts.print.print_state import HeadState, nearest_on_segment
from sim.controllers.feeding import Work
from sim.controllers.motion import Profile
from sim.controllers.nearness import Course, Near, nearness

LEAST_WAIT_S = 0.05
SEEN_MM = 0.5  # that a person may be wrong about where a head stopped
LEAST_MM = 1e-9  # of a move
BY_A_PERSON = "seen by a person"


@dataclass(frozen=True, slots=True)
class RecordedWait:
    """A head that stood for another."""

    number: int  # of the plan
    head: int  # of the first plan
    by: int
    seconds: float
    event: PrintEvent  # heads as in this plan


@dataclass(slots=True)
class Carried:
    """One plan of a run, and what controllers stated while it was carried out."""

    number: int
    document: PlanDocument
    heads: tuple[int, ...]  # of the first plan
    is_print: bool  # it prints; else heads only go to their parks
    events: list[PrintEvent] = field(default_factory=list)  # heads as in this plan
    reached: dict[int, Reached] = field(default_factory=dict)  # by head of the first plan
    until: dict[int, int] = field(default_factory=dict)  # up to which action each head goes on
    is_void: bool = False  # heads fell back on the plan before, and nobody begins it
    _works: dict[int, Work] = field(default_factory=dict)

    __repr__ = brief("number", "document", "heads", "events")

    def take(self, head: int, event: PrintEvent) -> None:
        """Take an event of a head of the first plan."""
        self.events.append(event)
        self.reached[head] = self.reached.get(head, Reached()).after(event)

    @property
    def begun(self) -> bool:
        """Whether it is the first, or a head began an action of it; one may fail that holds it."""
        return not self.number or any(event.kind is EventKind.BEGAN for event in self.events)

    def count(self, head: int) -> int:
        """Return how many actions a head carries out of this plan."""
        actions = self.document.plan.heads[self.heads.index(head)]
        return self.until.get(head, len(actions))

    def work(self, place: int) -> Work:
        """Return what a head of the plan, by its place in it, does without errors of time."""
        if place not in self._works:
            name = self.document.plan.heads[place].head
            self._works[place] = Work.of_plan(self.document, name)
        return self._works[place]

    def log(self, waits: Sequence[RecordedWait] = ()) -> EventLog:
        """Return all events in the order of their times, waits of this plan with them."""
        names = tuple(actions.head for actions in self.document.plan.heads)
        stood = [wait.event for wait in waits if wait.number == self.number]
        events = tuple(sorted([*self.events, *stood], key=lambda event: event.time_s))
        return EventLog(self.document.problem, names, events)

    def events_of(self, head: int) -> list[PrintEvent]:
        """Return the events of a head of the first plan; none where it is not in this one."""
        place = self.heads.index(head) if head in self.heads else -1
        return [event for event in self.events if event.head == place]

    def last(self, head: int) -> PrintEvent | None:
        """Return the last event of a head."""
        return next(reversed(self.events_of(head)), None)

    def state(self, head: int) -> HeadState:
        """Return how far a head came; one that goes on, to where it goes on."""
        place = self.heads.index(head)
        name = self.document.plan.heads[place].head
        reached, last = self.reached.get(head, Reached()), self.last(head)
        if last is not None and last.kind is EventKind.FAILED:
            inside = last.action != NO_ACTION and last.action == reached.ended
            point = max(reached.point, last.point) if inside else 0
            return HeadState(name, reached.ended, reached.begun, point, last.at, last.time_s, True)
        return HeadState(name, reached.ended, reached.begun, reached.point)

    def stop(self, head: int, at: Point, time_s: float) -> bool:
        """Take a person's word where a head stopped; False where it cannot have stopped there.

        The nozzle is at most `SEEN_MM` from the path of the action it had begun, not behind what
        it had passed. Where it had begun none, or has stated where it stopped, nothing is missing.
        """
        place = self.heads.index(head)
        actions, state = self.document.plan.heads[place], self.state(head)
        k = state.ended
        if state.failed or not state.begun or k >= len(actions):
            return True
        path = actions.action_path(k)
        near = [
            (*nearest_on_segment(path[i], path[i + 1], at), i)
            for i in range(state.point, len(path) - 1)
        ]
        distance, spot, point = min(near, key=lambda one: one[0], default=(math.inf, at, 0))
        if distance > SEEN_MM:
            return False
        last = self.last(head)
        assert last is not None
        when = max(time_s, last.time_s)
        failed = PrintEvent(EventKind.FAILED, place, when, k, point, spot, what=BY_A_PERSON)
        self.take(head, failed)
        return True

    def stands(self, head: int, action: int) -> Point:
        """Return where a head stands before an action."""
        actions = self.document.plan.heads[self.heads.index(head)]
        if not len(actions):
            return self.document.machine.head(actions.head).park
        path = actions.action_path(action)[0] if action < len(actions) else actions.path[-1]
        x, y, z = path.tolist()
        return x, y, z


Keep = Callable[[Sequence[Carried]], None]


def unkept(prints: Sequence[Carried]) -> None:
    """Keep nothing of what happens."""


def prints_of(plans: Sequence[Carried]) -> list[Carried]:
    """Return those that print and that heads began: the first, and each of the last one's rest."""
    return [carried for carried in plans if carried.is_print and carried.begun]


@dataclass(slots=True)
class _HeadMoves:
    """The moves of one head, gathered."""

    points: list[Floats]
    columns: list[Floats] = field(default_factory=list)  # (8, m) each: those of `Course`

    def add(self, points: Floats, columns: Floats) -> None:
        """Add moves that begin where the last one ended, or jump there."""
        if float(np.abs(points[0] - self.points[-1][-1]).max()) > 1e-3:
            self.jump(points[0], float(columns[0, 0]))
        self.points.append(points[1:])
        self.columns.append(columns)

    def add_action(
        self, work: Work, begun: PrintEvent, last: PrintEvent | None = None,
        until_s: float = math.inf,
    ) -> None:  # fmt: skip
        """Add the moves of an action: to its end, to where its head failed, or as planned.

        As planned it goes on no longer than `until_s`.
        """
        ends, action, begin_s = work.ends(begun.action), begun.action, begun.time_s
        if not len(ends):
            return
        if last is not None and last.kind is EventKind.ENDED:
            self.add(*_moved(work, action, begin_s, last.time_s))
            return
        points, columns = _moved(work, action, begin_s, begin_s + float(ends[-1]))
        if last is not None:
            point = min(last.point, len(ends) - 1)
            points, columns = _broken(points, columns, point, last.at, last.time_s)
        elif until_s < float(columns[1, -1]):
            k = int(np.searchsorted(columns[1], until_s))
            share = (until_s - columns[0, k]) / (columns[1, k] - columns[0, k])
            x, y, z = (points[k] + max(share, 0.0) * (points[k + 1] - points[k])).tolist()
            points, columns = _broken(points, columns, k, (x, y, z), until_s)
        self.add(points, columns)

    def jump(self, to: Floats, time_s: float) -> None:
        """Have somebody put the head elsewhere."""
        self.points.append(to.reshape(1, 3))
        self.columns.append(np.array([[time_s, time_s, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0]]).T)

    def course(self) -> Course:
        """Return all of it."""
        none = [np.zeros((8, 0))]
        columns = np.ascontiguousarray(np.concatenate([*none, *self.columns], axis=1))
        return Course(np.concatenate(self.points), *columns)


def _moved(work: Work, action: int, begin_s: float, end_s: float) -> tuple[Floats, Floats]:
    """Return the moves of an action that lasted from one time to another, as columns."""
    rows = slice(int(work.first[action]), int(work.first[action + 1]))
    points = work.program.points[rows.start : rows.stop + 1]
    its: Profile = work.profile
    due = its.seconds[rows]
    slow = max((end_s - begin_s) / max(float(due.sum()), 1e-12), 1e-9)
    ends = begin_s + np.cumsum(due) * slow
    columns = [
        ends - due * slow, ends, its.length[rows], its.enters[rows], its.leaves[rows],
        its.top[rows], its.rate[rows], np.full(len(due), slow),
    ]  # fmt: skip
    return points, np.array(columns)


def _broken(
    points: Floats, columns: Floats, point: int, at: Point, end_s: float
) -> tuple[Floats, Floats]:
    """Return the moves of an action up to where the head stopped."""
    points = np.concatenate([points[: point + 1], [at]])
    begin_s = float(columns[1, point - 1]) if point else float(columns[0, 0])
    length = max(float(np.linalg.norm(points[-1] - points[-2])), LEAST_MM)
    speed = length / max(end_s - begin_s, 1e-6)
    last = [begin_s, max(end_s, begin_s + 1e-6), length, speed, speed, speed, 1e6, 1.0]
    return points, np.concatenate([columns[:, :point], np.array([last]).T], axis=1)


def course_of(
    plans: Sequence[Carried], head: int, park: Point, moved: Mapping[int, tuple[float, Point]]
) -> Course:
    """Return where a head was over time.

    One that never stated how an action ended is taken to have ended it. `moved` has when people put
    heads that failed elsewhere, and where: they do nothing more from then on.
    """
    moves = _HeadMoves([np.array([park])])
    until_s = moved[head][0] if head in moved else math.inf
    for carried in plans:
        begun: PrintEvent | None = None
        for event in carried.events_of(head):
            if event.kind is EventKind.BEGAN:
                begun = event
            elif event.kind in (EventKind.ENDED, EventKind.FAILED) and begun is not None:
                moves.add_action(carried.work(event.head), begun, event)
                begun = None
        if begun is not None:
            moves.add_action(carried.work(begun.head), begun, until_s=until_s)
    if head in moved:
        time_s, to = moved[head]
        moves.jump(np.array(to), time_s)
    return moves.course()


def waits_of(carried: Carried) -> list[RecordedWait]:
    """Return for whom heads stood in a plan: of all an action waited for, what came last."""
    plan, found = carried.document.plan, list[RecordedWait]()
    passed = {
        (e.head, e.action, e.point if e.kind is EventKind.PASSED else ACTION_END): e.time_s
        for e in carried.events if e.kind in (EventKind.PASSED, EventKind.ENDED)
    }  # fmt: skip
    heads = carried.heads
    for place, actions in enumerate(plan.heads):
        last_s = 0.0
        for event in carried.events_of(heads[place]):
            if event.kind is EventKind.ENDED:
                last_s = event.time_s
            edges = actions.after_edges(event.action) if event.kind is EventKind.BEGAN else []
            others = [edge for edge in edges if edge.head != place]
            if not others:
                continue
            before_s = carried.work(place).before_s
            stood_s = event.time_s - float(before_s[event.action]) - last_s
            if stood_s > LEAST_WAIT_S:
                by = max(others, key=lambda e: passed.get((e.head, e.action, e.point), 0.0)).head
                began = PrintEvent(EventKind.WAITS, place, last_s, event.action, 0, event.at, by=by)
                found.append(RecordedWait(carried.number, heads[place], heads[by], stood_s, began))
    return found


def nearest(
    machine: Machine, names: Sequence[str], plans: Sequence[Carried],
    moved: Mapping[int, tuple[float, Point]], end_s: float,
) -> tuple[Near, ...]:  # fmt: skip
    """Return how near heads came to each other in a run, by their controllers' words.

    `names` are those of the first plan's heads; the pairs of what is returned count them.
    """
    known = {head.name: head for head in machine.heads}
    heads = [known[name] for name in names]
    courses = [course_of(plans, h, head.park, moved) for h, head in enumerate(heads)]
    return nearness(machine, heads, courses, 0.0, end_s)
