"""One head's part in carrying plans out, as a state machine without socket, pipe or clock.

The theory of operation. Plans of one run are numbered. A head takes up plan n when it has done
its share of plan n - 1; it says so in its reports, with the digest of n, and begins nothing of n
until every head of n has said the same digest, and every head without a part in n that it has done
its last plan, its path to its park. One that was fenced there, or since, need say nothing. So no
head is ever two plans ahead, and none carries out what another does not know. Numbers of dropped
plans are not used again.

Within a plan an action is released to the controller once all it waits for *has happened*: the
other head's controller said so, and its report arrived. What a dead head has not done never
happens, so whatever waits for it is never released, and the space it may be in stays reserved.

When plans change the launcher has all heads `hold`: no more is released, and each says how much
is. Then it names the action up to which each goes on; all that lies below needs nothing that will
not happen. Reports and commands are states and may be said again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from agents.running.port import (
    Alive,
    Command,
    Pause,
    Ready,
    ReleaseActions,
    Resume,
    Start,
    Statement,
)
from agents.running.report import NOTHING, HeadReport, Reached, newer
from decmcts.print.plan import After, HeadActions, JointPlan
from decmcts.print.print_events import NO_ACTION, EventKind, PrintEvent

LEAST_AHEAD = 2  # actions that are released ahead of the one that is carried out, if they may be
NO_LIMIT = 2**31 - 1


@dataclass(frozen=True, slots=True)
class NumberedPlan:
    """A plan to be carried out."""

    number: int
    path: str
    digest: str
    plan: JointPlan
    heads: tuple[int, ...]  # of the first plan: which each head of this one is

    def of(self, head: int) -> HeadActions | None:
        """Return the actions of a head of the first plan, None where it has none here."""
        return self.plan.heads[self.heads.index(head)] if head in self.heads else None


@dataclass(slots=True)
class Carrier:
    """What one head knows and may do; everything changes in place."""

    head: int
    ahead_s: float = 0.0  # nominal seconds of actions that are released ahead
    plans: dict[int, NumberedPlan] = field(default_factory=dict)
    number: int = -1  # of the plan the controller holds
    reached: Reached = NOTHING  # in that plan
    released: int = 0  # actions of it
    limit: int = NO_LIMIT  # up to which it goes on
    limited: int = -1  # number of the plan that `limit` is of
    holding: bool = False
    paused: bool = False
    off: bool = False  # the controller said so
    event: PrintEvent | None = None
    at: tuple[float, float, float] | None = None
    reports: dict[int, HeadReport] = field(default_factory=dict)
    fenced: dict[int, tuple[int, Reached]] = field(default_factory=dict)  # plan, and how far
    received_s: dict[tuple[int, int, int, int], float] = field(default_factory=dict)
    out: list[Command] = field(default_factory=list)
    seq: int = 0
    agreed: int = -1  # the newest plan that all its heads held when this one began
    held: str = ""  # digest of the plan the controller holds
    _starting: tuple[int, str] | None = None

    # What is heard ----------------------------------------------------------

    def take_plan(self, plan: NumberedPlan) -> None:
        """Take a plan to be carried out behind those before."""
        self.plans[plan.number] = plan

    def take_statement(self, stated: Statement) -> None:
        """Take what the controller states."""
        match stated:
            case Ready(number, digest):
                if (number, digest) == self._starting:
                    self.number, self.reached, self.released = number, Reached(), 0
                    self.off = False  # it only clogged, and goes to its park
                    self.held = digest
                self._starting = None
            case Alive(_, at):
                self.at = at
            case PrintEvent():
                self.event, self.at = stated, stated.at
                if stated.kind is EventKind.FAILED:
                    self.off = True
                elif stated.action != NO_ACTION:
                    self.reached = self.reached.after(stated)

    def take_report(self, report: HeadReport) -> None:
        """Take what another head reports."""
        if report.head != self.head:
            self.reports[report.head] = newer(self.reports.get(report.head), report)

    def hold(self) -> None:
        """Release no more until limits are stated."""
        self.holding = True

    def take_limit(self, number: int, until: int) -> None:
        """Go on up to an action of a plan; plans behind it that are known by now are void."""
        self.limit, self.limited, self.holding = until, number, False
        self.plans = {k: plan for k, plan in self.plans.items() if k <= number}

    def fence(self, head: int, number: int, reached: Reached) -> None:
        """Take that a head prints no more, and how far it came."""
        self.fenced[head] = (number, reached)

    def pause(self) -> None:
        """Stand at the end of the action that has begun."""
        self.paused = True
        self.out.append(Pause())

    def resume(self) -> None:
        """Go on."""
        self.paused = False
        self.out.append(Resume())

    # What follows -----------------------------------------------------------

    @property
    def actions(self) -> HeadActions | None:
        """Actions of this head in the plan the controller holds."""
        held = self.plans.get(self.number)
        return None if held is None else held.of(self.head)

    @property
    def holds(self) -> tuple[int, int]:
        """The plan the controller holds or is taking up, and how much of it is released."""
        return (self.number, self.released) if self._starting is None else (self._starting[0], 0)

    @property
    def is_starting(self) -> bool:
        """Whether the controller is taking up a plan."""
        return self._starting is not None

    @property
    def until(self) -> int:
        """Up to which action of its plan the head goes on."""
        actions = self.actions
        count = 0 if actions is None else len(actions)
        return min(count, self.limit) if self.limited == self.number else count

    @property
    def done(self) -> bool:
        """Whether the head has done its share of the plan the controller holds."""
        return self.number >= 0 and self.reached.ended >= self.until and not self.reached.begun

    def step(self, now_s: float) -> list[Command]:
        """Return what the controller is to be told at a time of the print."""
        found, self.out = self.out, []
        following = self._next()
        free = (self.number < 0 or self.done or self.off) and not self.holding
        if following is not None and free and self._starting is None:
            self._starting = (following.number, following.digest)
            found.append(Start(following.number, following.path, following.digest))
        if self.number >= 0:
            if self.number in self.plans and not self.off:
                self._release(now_s)
            found.append(ReleaseActions(self.number, self.released))
        return found

    def report(self) -> HeadReport:
        """Return what is reported to the others now."""
        self.seq += 1
        return HeadReport(
            self.head, self.seq, self.number, self.held, self.reached, self.event, self.off
        )

    def waits_for(self) -> int | None:
        """Return the head that the next action of a head that stands waits for; None: none."""
        actions = self.actions
        if actions is None or self.off or self.reached.begun or self.paused:
            return None
        if self.released > self.reached.ended or self.done:
            return None
        plan = self.plans[self.number]
        if not self.may_begin(plan):
            disagree = (head for head in plan.heads if not self._agrees(plan, head))
            return next(disagree, self.moving(plan))
        for edge in actions.after_edges(self.released):
            if not self.has_passed(plan, edge):
                return plan.heads[edge.head]
        return None

    def may_begin(self, plan: NumberedPlan) -> bool:
        """Tell whether all heads of a plan hold it and no other moves, or so it was when begun."""
        if self.agreed == plan.number:
            return True
        return all(self._agrees(plan, head) for head in plan.heads) and self.moving(plan) is None

    def moving(self, plan: NumberedPlan) -> int | None:
        """Return a head without a part in a plan that may not stand yet: it goes to its park."""
        before = [self.plans[k] for k in sorted(self.plans) if k < plan.number]
        last = {head: each for each in before for head in each.heads}
        for head, each in last.items():
            if head in plan.heads or self._does_no_more(each, head):
                continue
            report, actions = self.reports.get(head), each.of(head)
            if report is None or actions is None or report.digest != each.digest:
                return head
            if report.number != each.number or report.reached.ended < len(actions):
                return head
        return None

    def _next(self) -> NumberedPlan | None:
        """Return the plan that is taken up behind the one the controller holds."""
        later = [k for k, plan in self.plans.items() if k > self.number and self.head in plan.heads]
        return self.plans[min(later)] if later else None

    def _does_no_more(self, plan: NumberedPlan, head: int) -> bool:
        """Tell whether a head was fenced in a plan, or in a later one."""
        return self.fenced.get(head, (-1, NOTHING))[0] >= plan.number

    def _agrees(self, plan: NumberedPlan, head: int) -> bool:
        """Tell whether a head holds a plan, or failed and does nothing of it any more."""
        if head == self.head or self._does_no_more(plan, head):
            return True
        report = self.reports.get(head)
        if report is None:
            return False
        return report.number > plan.number or (report.number, report.digest) == (
            plan.number, plan.digest,
        )  # fmt: skip

    def _release(self, now_s: float) -> None:
        """Release what may be carried out, some seconds ahead of what is."""
        plan, actions = self.plans[self.number], self.actions
        assert actions is not None
        if self.holding or self.paused or not self.may_begin(plan):
            return
        self.agreed = plan.number
        while self.released < self.until:
            k, at = self.released, self.reached.ended
            far = k - at >= LEAST_AHEAD
            if far and actions.begin_s[k] > actions.begin_s[at] + self.ahead_s:
                return
            if not self._has_happened(plan, actions, k, now_s):
                return
            self.released += 1

    def _has_happened(
        self, plan: NumberedPlan, actions: HeadActions, action: int, now_s: float
    ) -> bool:
        """Tell whether all that an action waits for has happened, lags included."""
        for edge in actions.after_edges(action):
            if not self.has_passed(plan, edge):
                return False
            if edge.lag_s > 0.0:  # counted from when the report came: that is no sooner
                event = plan.number, edge.head, edge.action, edge.point
                since = self.received_s.setdefault(event, now_s)
                if now_s - since < edge.lag_s:
                    return False
        return True

    def has_passed(self, plan: NumberedPlan, edge: After) -> bool:
        """Tell whether what an action of a plan waits for has happened, as far as is known."""
        place, action, point = edge.head, edge.action, edge.point
        head = plan.heads[place]
        if head == self.head:
            return self.released > action  # its own order keeps that
        if head in self.fenced:
            number, reached = self.fenced[head]
            if number >= plan.number:  # of a later plan, that takes it to its park, it tells itself
                return number > plan.number or reached.passed(action, point)
        report = self.reports.get(head)
        if report is None or report.number < plan.number:
            return False
        if report.number > plan.number:  # it has done its share of this one, as told to all
            return True
        return report.digest == plan.digest and report.reached.passed(action, point)


def committed(
    plan: JointPlan, least: Sequence[int], stopped: Mapping[int, Reached], budget_s: float
) -> list[int]:
    """Return up to which action each head of a plan goes on: all below needs no other head.

    Parameters
    ----------
    least : Sequence[int]
        Actions that each head's controller has been released already.
    stopped : Mapping[int, Reached]
        Heads that print no more, and how far they came.
    budget_s : float
        Nominal seconds from the earliest of these that heads may go on.
    """
    until = list(least)
    for head, reached in stopped.items():
        until[head] = reached.ended
    living = [h for h in range(len(plan.heads)) if h not in stopped]
    starts = [
        float(plan.heads[h].begin_s[until[h]]) for h in living if until[h] < len(plan.heads[h])
    ]
    latest = min(starts, default=0.0) + budget_s
    moved = True
    while moved:
        moved = False
        for h in living:
            actions = plan.heads[h]
            while (k := until[h]) < len(actions) and actions.begin_s[k] <= latest:
                edges = actions.after_edges(k)
                if not all(
                    stopped[e.head].passed(e.action, e.point)
                    if e.head in stopped
                    else e.action < until[e.head] or e.head == h
                    for e in edges
                ):
                    break
                until[h], moved = k + 1, True
    return until
