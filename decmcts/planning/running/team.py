"""The heads of a run and the plans they carry out: what is known and shown, how heads are told.

Nothing is decided here. What happens when a head fails is `failing`'s, what comes of the rest
`renewing`'s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from agents.running.clock import PrintClock
from agents.running.heads import HeadProcesses, WitnessProcess
from agents.running.report import NOTHING, Reached
from decmcts.errors import InputError
from decmcts.formats.plans.plan_json import read_plan, write_plan
from decmcts.planning.events import Note, Report
from decmcts.planning.replanning.park_files import same_place
from decmcts.planning.replanning.rest import LeftBeads
from decmcts.planning.running.recorded import Carried, prints_of
from decmcts.print.figures import clock_time
from decmcts.print.machine import Point
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.print_events import EventKind
from decmcts.print.print_state import PrintState, state_of_heads
from sim.controllers.motion import QUEUE
from sim.controllers.timing import Timing

MOST_SPEED = 10_000.0
WAITING = 1e-6  # pace of the clock until all heads are there


@dataclass(frozen=True, slots=True)
class RunOptions:
    """Options of a simulated run; errors of time are as `simulate` has them."""

    speed: float = 1.0  # s of the print in one of the world; 1 while heads are planned for anew
    timing: Timing = Timing.NONE
    error: float = 0.2
    seed: int = 0
    queue: int = QUEUE
    loss: float = 0.0  # share of messages between agents that is lost
    delay_s: float = 0.0  # of the print, by which the others are late at most
    replan_s: float = 5.0  # time limit of the heads' search for what is left
    left_beads: LeftBeads = LeftBeads.FINISH  # what becomes of a bead that was broken off
    # tools, and those that print for them once no living head has them
    print_with: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("speed", self.speed, 0.01, MOST_SPEED), ("loss", self.loss, 0.0, 0.9),
            ("delay", self.delay_s, 0.0, 60.0), ("replan time", self.replan_s, 0.0, 86_400.0),
        ):  # fmt: skip
            if not least <= value <= most:
                raise InputError(f"{name} is {value:g}, must be from {least:g} to {most:g}")


RUN_OPTIONS = RunOptions()


@dataclass(slots=True)
class Failure:
    """A head that failed, and when what followed; seconds of the print."""

    head: str
    why: str
    at_s: float  # its last word
    noticed_s: float
    fenced_s: float = float("nan")  # it is sure that it does nothing any more
    at: Point | None = None  # where it stands then
    planned_s: float = float("nan")  # the rest is planned
    on_s: float = float("nan")  # a head begins an action of it
    stood_s: float = float("nan")  # no head did anything, from when all that needs no plan was done


@dataclass(frozen=True, slots=True)
class HeadView:
    """What is shown of one head while it prints."""

    name: str
    does: str
    share: float  # of its actions in the plan it carries out
    waits_for: str = ""


@dataclass(frozen=True, slots=True)
class RunView:
    """What is shown of a run."""

    time_s: float
    planned_s: float  # of the plan that is carried out, its begin counted in
    heads: tuple[HeadView, ...]


Show = Callable[[RunView], None]


def unseen(view: RunView) -> None:
    """Show nothing."""


@dataclass(slots=True)
class Team:
    """The heads of the first plan, by their places in it, and all plans so far."""

    document: PlanDocument  # the first plan
    folder: Path  # where plans and the clock are written, for the processes of heads
    report: Report
    heads: list[Standing] = field(init=False)
    clock: PrintClock = field(init=False)
    processes: list[HeadProcesses] = field(default_factory=list)
    witness: WitnessProcess | None = None  # where there are others to meet
    plans: list[Carried] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    moved: dict[int, tuple[float, Point]] = field(default_factory=dict)  # by people: when, where

    def __post_init__(self) -> None:
        self.heads = [Standing(actions.head) for actions in self.document.plan.heads]
        self.clock = PrintClock.made(self.clock_path, WAITING)

    @property
    def clock_path(self) -> Path:
        """File of the clock that all processes map."""
        return self.folder / "clock"

    def note(self, text: str) -> None:
        """Report what has happened, with the time of the print."""
        self.report(Note(f"{clock_time(self.clock.now())}: {text}"))

    # Heads ------------------------------------------------------------------

    def living(self) -> list[int]:
        """Return the heads that work."""
        return [h for h, head in enumerate(self.heads) if head.failure is None]

    def listening(self) -> list[int]:
        """Return the heads whose agents are given plans: those that work, or go to their park."""
        return [h for h, head in enumerate(self.heads) if head.failure is None or head.parks]

    def lost(self) -> list[int]:
        """Return the heads that failed and are not fenced."""
        return [h for h, head in enumerate(self.heads) if head.failure and not head.fenced]

    def paused(self) -> list[str]:
        """Return the names of the heads that stand until a person has them go on."""
        return [self.heads[h].name for h in self.listening() if self.heads[h].paused]

    def send(self, head: int, /, **command: object) -> None:
        """Give the agent of a head a command."""
        self.processes[head].agent.send(command)

    def send_to_all(self, **command: object) -> None:
        """Give the agents of all heads that listen a command."""
        for h in self.listening():
            self.send(h, **command)

    def park(self, h: int) -> Point:
        """Return where a head parks."""
        return self.document.machine.head(self.heads[h].name).park

    def is_parked(self, h: int) -> bool:
        """Tell whether a head that failed stands at its park."""
        failure = self.heads[h].failure
        at = None if failure is None else failure.at
        return at is not None and same_place(at, self.park(h))

    # Plans ------------------------------------------------------------------

    def announce(self, document: PlanDocument, *, is_print: bool) -> Carried:
        """Hand a plan to all heads that listen; they begin it when all of them hold it."""
        number = len(self.plans)
        path = self.folder / f"plan-{number}.json"
        write_plan(document, path)
        names = [head.name for head in self.heads]
        heads = tuple(names.index(actions.head) for actions in document.plan.heads)
        self.plans.append(Carried(number, read_plan(path), heads, is_print))
        self.send_to_all(command="plan", number=number, path=str(path), heads=list(heads))
        return self.plans[-1]

    def begun(self) -> list[Carried]:
        """Return the plans that heads began; the first of all counts in any case."""
        return [carried for carried in self.plans if carried.begun]

    def prints(self) -> list[Carried]:
        """Return the plans that print and that heads began."""
        return prints_of(self.plans)

    def printing(self) -> Carried:
        """Return the last plan that prints and that heads began."""
        return self.prints()[-1]

    def last_of(self, h: int, before: int | None = None) -> Carried:
        """Return the last plan that a head is in (before one), and that holds."""
        return [p for p in self.plans[:before] if h in p.heads and not p.is_void][-1]

    def has_done(self, h: int, before: int | None = None) -> bool:
        """Tell whether a head has done its share of the last plan it is in (before one)."""
        last = self.last_of(h, before)
        holds = self.heads[h].number >= last.number
        return holds and last.reached.get(h, NOTHING).ended >= last.count(h)

    def stands(self, h: int) -> bool:
        """Tell whether a head does nothing more before another, or a person, has done something."""
        head = self.heads[h]
        reached = self.plans[max(head.number, 0)].reached.get(h, NOTHING)
        rests = head.paused or head.waits_for is not None
        return self.has_done(h) or (rests and not reached.begun)

    def goes_on_in(self, carried: Carried, h: int) -> bool:
        """Tell whether a head may do more of a plan: it works, or it travels to its park."""
        head, last = self.heads[h], carried.last(h)
        if head.failure is None:
            return True
        failed = last is not None and last.kind is EventKind.FAILED
        return head.parks and not carried.is_print and not failed

    def stopped(self, carried: Carried, h: int) -> Reached:
        """Return how far a head that failed came in a plan."""
        if self.heads[h].number > carried.number:
            return Reached(carried.count(h))
        return carried.reached.get(h, NOTHING)

    def send_fenced(self, carried: Carried, gone: int) -> None:
        """Tell all that a head does no more of a plan, and how far it came."""
        reached = self.stopped(carried, gone)
        self.send_to_all(
            command="fence", head=gone, number=carried.number,
            reached=[reached.ended, reached.begun, reached.point],
        )  # fmt: skip

    # The print --------------------------------------------------------------

    def state(self, carried: Carried, until: list[int]) -> PrintState:
        """Return what is printed when each head has gone on up to an action."""
        found = []
        for h, k in zip(carried.heads, until, strict=True):
            state = carried.state(h)
            if self.heads[h].failure is None:
                state = replace(state, ended=k, begun=False, point=0)
            elif not state.failed:
                state = replace(state, at=None)
            found.append(state)
        return state_of_heads(carried.document, found)

    def state_at_limits(self, carried: Carried) -> PrintState:
        """Return what is printed when each head has gone on as far as it may."""
        return self.state(carried, [carried.count(h) for h in carried.heads])

    @property
    def makespan_s(self) -> float:
        """When the last action ended."""
        ended = (e.time_s for p in self.plans for e in p.events if e.kind is EventKind.ENDED)
        return max(ended, default=0.0)

    @property
    def unprinted(self) -> int:
        """How many contours of the last plan are not printed."""
        carried, done = self.printing(), set[int]()
        for k, h in enumerate(carried.heads):
            actions, ended = carried.document.plan.heads[k], carried.reached.get(h, NOTHING).ended
            rows = actions.kind[:ended] == ActionKind.PRINT
            done.update(actions.contour[:ended][rows].tolist())
        return len(carried.document.contours) - len(done)


def is_whole(state: PrintState) -> bool:
    """Tell whether nothing is left to print, broken beads included."""
    return bool(state.done.all()) and not state.broken


_DOES = {
    ActionKind.PRINT: "prints", ActionKind.TRAVEL: "travels", ActionKind.PARK: "parks",
    ActionKind.WAIT: "rests",
}  # fmt: skip


@dataclass(slots=True)
class Standing:
    """What is known of one head."""

    name: str
    number: int = -1  # of the plan its controller holds
    paused: bool = False  # a person asked for it
    waits_for: int | None = None
    missing: tuple[int, ...] = ()  # heads its agent does not hear
    pulse_at: float = -math.inf
    heard_at: float = math.inf  # its controller
    agent_gone: str = ""
    replaced: bool = False  # its agent; that the one before has ended was not heard yet
    controller_gone: str = ""
    asked: bool = False  # a person, where it is
    fenced: bool = False
    parks: bool = False  # it prints no more, but its controller takes it to its park
    failure: Failure | None = None


def view_of(heads: Sequence[Standing], plans: Sequence[Carried], time_s: float) -> RunView:
    """Return how heads stand."""
    found = []
    for h, head in enumerate(heads):
        carried = plans[max(head.number, 0)]
        if h not in carried.heads:
            continue
        reached = carried.reached.get(h, NOTHING)
        actions = carried.document.plan.heads[carried.heads.index(h)]
        share = reached.ended / max(len(actions), 1)
        if head.failure is not None:
            does = f"{'off' if head.fenced else 'lost'}: {head.failure.why}"
        elif head.paused:
            does = "paused"
        elif not carried.is_print:
            does = "goes to its park"
        elif reached.begun and reached.ended < len(actions):
            does = _DOES[ActionKind(int(actions.kind[reached.ended]))]
        else:
            does = "stands"
        waits = "" if head.waits_for is None else heads[head.waits_for].name
        found.append(HeadView(head.name, does, share, waits if does == "stands" else ""))
    return RunView(time_s, plans[0].document.plan.makespan_s, tuple(found))
