"""The rest of a print planned anew behind a failure, while the heads that live go on.

1. All heads *hold*: they release no more, and say how much is released.
2. Each is told how far it goes on: with all that needs nothing of a head that failed.
3. A thread finds paths to the parks, which are a plan of their own, and plans the rest.
4. Heads take up both behind what they go on with. Without such a plan they do all they can.

What is planned is left when another head fails meanwhile: it is not true any more. While a head is
lost nothing is planned, and the others do all they can.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from agents.running.carrier import committed
from agents.running.report import Reached
from decmcts.arrays import Floats
from decmcts.errors import InputError, VerificationError
from decmcts.planning.events import Note
from decmcts.planning.problem.made_from import rules_of
from decmcts.planning.problem.source import Source
from decmcts.planning.replanning.park_files import routes_to_parks, top_of
from decmcts.planning.replanning.replan import replan, rest_of, search_of
from decmcts.planning.running.recorded import Carried
from decmcts.planning.running.team import RunOptions, Team, is_whole
from decmcts.print.contours import taken
from decmcts.print.machine import Machine, Point
from decmcts.print.metrics import Metrics
from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, JointPlan, PlanDocument
from decmcts.print.print_state import PrintState

MORE_S = 30.0  # nominal seconds that heads go on for, besides those of the search


@dataclass(frozen=True, slots=True, eq=False)
class Begin:
    """From where the rest is planned."""

    document: PlanDocument  # the plan that is broken off
    whole: Machine  # with all heads of the first plan
    source: Source
    state: PrintState  # when heads have done what they go on with
    standing: Mapping[str, Point]  # heads that go to their parks, and where they stand then
    fenced: Mapping[str, Point]  # heads of that plan that print no more, and where they will stand
    obstacles: Mapping[str, Point]  # heads that do not move, those that failed before too


@dataclass(frozen=True, slots=True)
class Parking:
    """A plan by which heads go to their parks."""

    begin: Begin
    document: PlanDocument


@dataclass(frozen=True, slots=True)
class Renewed:
    """The rest, planned and judged."""

    begin: Begin
    document: PlanDocument
    source: Source  # it alone, from which it may be planned once more
    left_out: int  # contours that no living head can finish
    lines: tuple[str, ...]  # what is missing
    others: tuple[str, ...] = ()  # what is printed with another tool


@dataclass(frozen=True, slots=True)
class NotRenewed:
    """The rest cannot be planned."""

    begin: Begin
    why: str
    parked: bool  # heads were sent to their parks before that was known


News = Parking | Renewed | NotRenewed


def renew(begin: Begin, options: RunOptions, hand_over: Callable[[News], None]) -> None:
    """Plan the rest in a thread; hand over paths to the parks once they are found, and the plan."""

    def work() -> None:
        parked = False
        try:
            rest = rest_of(
                begin.document, begin.source, begin.state, begin.fenced, options.left_beads,
                print_with=dict(options.print_with),
            )  # fmt: skip
            parking = parking_plan(begin.document, begin.whole, begin.standing, begin.obstacles)
            if parking is not None:
                hand_over(Parking(begin, parking))
                parked = True
            search = search_of(begin.document, options.replan_s, options.seed)
            result = replan(rest, search, rules_of(begin.document), writes=False)
            left_out, lines = int(rest.left.rows.sum()), tuple(rest.unfinished)
            hand_over(Renewed(begin, result.document, rest.source, left_out, lines, rest.others))
        except (InputError, VerificationError) as error:
            hand_over(NotRenewed(begin, " ".join(str(error).split()), parked))
        except Exception as error:  # whatever it is, heads must not wait for it for ever
            why = f"internal error: {type(error).__name__}: {error}"
            hand_over(NotRenewed(begin, why, parked))

    threading.Thread(target=work, name="renew", daemon=True).start()


@dataclass(slots=True)
class Renewal:
    """How far a team is with what comes behind a failure."""

    team: Team
    options: RunOptions
    hand_over: Callable[[News], None]  # takes what the thread finds; the launcher's gives it back
    sources: dict[int, Source]  # of plans that print, by number; one without is not renewed
    unplanned: set[int] = field(default_factory=set)  # fenced, and no plan is without them yet
    held: dict[int, tuple[int, int]] = field(default_factory=dict)  # plan, and actions released
    reason: str = ""  # why the rest is not planned
    renewed: dict[int, Renewed] = field(default_factory=dict)  # by the number of its plan
    _is_holding: bool = False
    _holds: int = 0  # how often heads were told to
    _begin: Begin | None = None  # of the plan that is being made

    @property
    def is_busy(self) -> bool:
        """Tell whether heads hold, or are planned for."""
        return self._is_holding or self._begin is not None

    def carried_out(self) -> list[Renewed]:
        """Return the rests that heads began, each of which follows from the one before."""
        return [self.renewed[p.number] for p in self.team.begun() if p.number in self.renewed]

    @property
    def left(self) -> list[str]:
        """What is not finished, in words."""
        return list(dict.fromkeys(line for news in self.carried_out() for line in news.lines))

    @property
    def left_out(self) -> int:
        """Contours that no living head could finish."""
        return sum(news.left_out for news in self.carried_out())

    @property
    def others(self) -> list[str]:
        """What is printed with another tool, in words."""
        return [line for news in self.carried_out() for line in news.others]

    def hold(self) -> None:
        """Have heads hold, as one is lost or fenced: what is planned is not true any more."""
        self._begin, self.held, self._is_holding = None, {}, True
        self._holds += 1
        self.team.send_to_all(command="hold", count=self._holds)

    def take_held(self, h: int, count: int, number: int, released: int) -> None:
        """Take that a head holds, and what; what it said when it was told before is no more."""
        if count == self._holds:
            self.held[h] = (number, released)

    def step(self) -> None:
        """Have heads go on when all of them hold."""
        if self._is_holding and all(h in self.held for h in self.team.listening()):
            self._divide()

    def take(self, news: News) -> None:
        """Take what was planned, unless it was left since."""
        if news.begin is not self._begin:
            return
        match news:
            case Parking(_, document):
                self.team.announce(document, is_print=False)
            case Renewed():
                self._begin = None
                self._take_renewed(news)
            case NotRenewed(_, why, parked):
                self._begin = None
                self.reason = f"the rest is not planned: {why}"
                if parked:
                    self.team.report(Note(self.reason))
                else:
                    self._give_up(self.team.begun()[-1])

    def _take_renewed(self, news: Renewed) -> None:
        self.reason = ""
        for line in news.others:
            self.team.report(Note(line))
        carried = self.team.announce(news.document, is_print=True)
        self.sources[carried.number] = news.source
        self.renewed[carried.number] = news
        for failure in self.team.failures:
            if math.isnan(failure.planned_s):
                failure.planned_s = self.team.clock.now()
        self.team.note("the rest is planned")

    def _divide(self) -> None:
        """Say how far each head goes on, and have the rest planned."""
        team, held = self.team, self.held
        self._is_holding = False
        if not team.living():
            return
        begun = [number for number, released in held.values() if released]
        carried = team.plans[max([team.begun()[-1].number, *begun])]
        stopped = self._stopped(carried)
        least = [
            held[h][1] if held.get(h, (-1, 0))[0] == carried.number else 0 for h in carried.heads
        ]
        plan = carried.document.plan
        whole = committed(plan, least, stopped, math.inf)
        if team.lost():  # what is planned without knowing where it is might meet it
            self._limit(carried, whole)
            return
        printing = team.printing()
        is_printed = not carried.is_print and is_whole(team.state_at_limits(printing))
        if is_printed or is_whole(team.state(carried, whole)):
            self._limit(carried, whole)
            self.unplanned.clear()
            return
        self._limit(carried, committed(plan, least, stopped, self.options.replan_s + MORE_S))
        self._plan_rest(carried, printing)

    def _stopped(self, carried: Carried) -> dict[int, Reached]:
        """Return how far heads came that do no more of a plan, by place in it.

        They failed, or hold a later plan, from which none comes back.
        """
        found = dict[int, Reached]()
        for k, h in enumerate(carried.heads):
            if not self.team.goes_on_in(carried, h):
                found[k] = self.team.stopped(carried, h)
            elif self.held.get(h, (-1, 0))[0] > carried.number:
                found[k] = Reached(carried.count(h))
        return found

    def _limit(self, carried: Carried, until: list[int]) -> None:
        """Tell all up to which action each head goes on, and how far others came."""
        team = self.team
        for later in team.plans[carried.number + 1 :]:
            later.is_void = True
        carried.until.update(zip(carried.heads, until, strict=True))
        for gone in carried.heads:
            if team.heads[gone].fenced and not team.goes_on_in(carried, gone):
                team.send_fenced(carried, gone)
        for h in team.listening():
            team.send(h, command="limit", number=carried.number, until=carried.until.get(h, 0))

    def _plan_rest(self, carried: Carried, printing: Carried) -> None:
        """Have planned what is left of the plan that `printing` is, behind a plan's limits."""
        team = self.team
        self.unplanned.clear()
        source = self.sources.get(printing.number)
        if source is None:
            self.reason = "the source is not named (--source), so the rest cannot be planned"
            self._give_up(carried)
            return
        self._begin = self._begin_of(carried, printing, source)
        names = ", ".join(team.heads[h].name for h in team.living())
        team.note(f"the rest is planned for {names}")
        renew(self._begin, self.options, self.hand_over)

    def _begin_of(self, carried: Carried, printing: Carried, source: Source) -> Begin:
        team = self.team
        stands = {h: self._stands(carried, h) for h in range(len(team.heads))}
        places = {h: at for h, at in stands.items() if at is not None}
        listening, living = team.listening(), team.living()
        going = [h for h in listening if not team.is_parked(h)]
        in_plan = {actions.head for actions in printing.document.plan.heads}
        fenced = {  # those that can will have gone to their parks
            team.heads[h].name: team.park(h) if h in listening else at
            for h, at in places.items() if h not in living
        }  # fmt: skip
        return Begin(
            printing.document, team.document.machine, source, team.state_at_limits(printing),
            {team.heads[h].name: at for h, at in places.items() if h in going},
            {name: at for name, at in fenced.items() if name in in_plan},
            {team.heads[h].name: at for h, at in places.items() if h not in going},
        )  # fmt: skip

    def _stands(self, carried: Carried, h: int) -> Point | None:
        """Return where a head stands that has gone on in a plan as far as it may."""
        if h in carried.heads and self.team.goes_on_in(carried, h):
            return carried.stands(h, carried.until[h])
        failure = self.team.heads[h].failure
        return self.team.park(h) if failure is None else failure.at

    def _give_up(self, carried: Carried) -> None:
        """Have heads go on with all that needs no head that failed."""
        stopped = self._stopped(carried)
        least = [carried.until.get(h, 0) for h in carried.heads]
        self._limit(carried, committed(carried.document.plan, least, stopped, math.inf))
        self.team.report(Note(self.reason))


def parking_plan(
    document: PlanDocument, machine: Machine, standing: Mapping[str, Point],
    fenced: Mapping[str, Point],
) -> PlanDocument | None:  # fmt: skip
    """Return a plan by which heads go to their parks one after another; None where none is to go.

    Those at their parks have no action; they take up the plan too, so all know that they stand.
    `machine` has all heads; `standing` are those that are to go, or are at their parks. Raises
    InputError when some head has no clear path.
    """
    lines = {name: np.array([at], np.float64) for name, at in standing.items()}
    routes = routes_to_parks(machine, lines, fenced, top_of(document.contours, document.printed))
    order = [(route.head, route.path(standing[route.head])) for route in routes]
    gone = {name for name, _ in order}
    order += [(name, np.empty((0, 3))) for name in standing if name not in gone]
    return _document(document, machine, order) if order else None


def _document(
    document: PlanDocument, machine: Machine, order: list[tuple[str, Floats]]
) -> PlanDocument:
    """Return paths as a plan in which each head waits for the one before."""
    begin, heads = 0.0, list[HeadActions]()
    for k, (name, path) in enumerate(order):
        length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        end = begin + length / machine.limits_of(machine.head(name)).travel_feed
        n = int(len(path) > 0)  # actions
        m = n * int(k > 0)
        heads.append(
            HeadActions(
                head=name, kind=np.full(n, ActionKind.PARK, np.int8),
                contour=np.full(n, -1, np.int32), reversed=np.zeros(n, np.bool_),
                entry=np.zeros(n, np.int32), path_offsets=np.array([0, len(path)][: n + 1]),
                path=path, begin_s=np.full(n, begin), end_s=np.full(n, end),
                after_offsets=np.array([0, m][: n + 1]),
                after_head=np.full(m, k - 1, np.int32), after_action=np.zeros(m, np.int32),
                after_point=np.full(m, ACTION_END, np.int32), after_lag_s=np.zeros(m),
            )
        )  # fmt: skip
        begin = end
    none = np.empty(0, np.int64)
    return replace(
        document, machine=machine, contours=taken(document.contours, none),
        plan=JointPlan(tuple(heads)), precedence=np.empty((0, 2), np.int32), metrics=Metrics(),
        acceleration=None, printed=None, fenced=None,
    )  # fmt: skip
