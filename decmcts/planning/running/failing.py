"""What happens when a head fails.

| what fails | how it is noticed | what follows |
|---|---|---|
| the head | its controller says `failed` | fenced there; it goes to its park |
| its agent | its process ends, or is silent | its controller ends its action, then says `failed` |
| its bus | others, or a witness, do not hear it | it is stopped: its controller says `failed` |
| its controller | silent, or ended | lost, until a person says where it stands |

A head that fails is *lost* until it is *fenced*: by its controller's word, or a person's. Only then
is it sure that it does nothing any more, and the rest is planned without it (`renewing`). A head
whose controller lives goes to its park by a plan; where its agent is gone, another is started for
that. One that fails on that path is lost again, and one that stands at its park may fail as it
likes. One that a person aborts, or fences, stays where it is: its processes are ended.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from agents.running.port import ABORTED, SILENT, SILENT_S, STARTS_S, Abort, Finish
from decmcts.planning.events import Note
from decmcts.planning.running.renewing import Renewal
from decmcts.planning.running.team import Failure, Team
from decmcts.print.machine import Point
from decmcts.print.print_events import EventKind

SETTLES_S = 3.0 * SILENT_S  # until others hear the agent that is started in its place
PATIENCE = 3  # times that they may find to one another
AGENT, BUS, HANGS = "its agent was lost", "it lost the bus", "its controller hangs"
FENCED = "fenced by a person"
PERSON = (
    "say `fenced {name} X,Y,Z` once it is sure to be off, or `fenced {name} park X,Y,Z` if you "
    "have put it to its park: X,Y,Z is where it had stopped"
)


@dataclass(slots=True)
class Failing:
    """Notices that heads of a team fail, and fences them."""

    team: Team
    renewal: Renewal
    _settled_at: float = -math.inf  # when a head was last found to have lost its bus
    _undecided: int = 0  # times a witness heard all that do not hear one another, or none of them

    def find(self) -> None:
        """Take in which processes are gone, of heads that work and of those that park."""
        since = time.monotonic() - STARTS_S
        for h in self.team.listening():
            head = self.team.heads[h]
            if head.controller_gone or head.heard_at < since:
                self._lose(h, head.controller_gone or HANGS)
            elif self.reported_off(h) and (head.agent_gone or head.pulse_at < since):
                self._start_another_agent(h)
            elif head.agent_gone:
                why = f"{AGENT} ({head.agent_gone})"
                self._lose(h, why)
                self.team.processes[h].send_to_controller(Finish(why))
        for h in self.team.lost():
            head = self.team.heads[h]
            if not head.asked and (head.controller_gone or head.heard_at < since):
                head.asked = True
                self.team.report(Note(f"{head.name}: {PERSON.format(name=head.name)}"))
        self._settle_missing()

    def _lose(self, h: int, why: str) -> None:
        """Take in that a head goes no further with its print, or to its park."""
        head = self.team.heads[h]
        if self._is_off(h):
            return
        self.fail(h, why)
        assert head.failure is not None
        head.parks, head.fenced, head.failure.fenced_s = False, False, math.nan  # who knows where
        self.renewal.hold()

    def reported_off(self, h: int) -> bool:
        """Tell whether its controller's last word is that a head is off."""
        last = self.team.plans[self.team.heads[h].number].last(h)
        return last is not None and last.kind is EventKind.FAILED

    def _start_another_agent(self, h: int) -> None:
        """Have another agent take a head to its park that is off and has not gone there yet."""
        failure = self.team.heads[h].failure
        assert failure is not None and failure.at is not None
        self.fence(h, failure.at, SILENT)

    def _is_off(self, h: int) -> bool:
        """Tell whether a head failed before and stands at its park; nothing more is told it."""
        head = self.team.heads[h]
        if not head.fenced or not self.team.is_parked(h):
            return False
        head.parks = False
        self.team.send_fenced(self.team.last_of(h), h)
        return True

    def _settle_missing(self) -> None:
        """Have a head stop that the others do not hear although its process lives: its bus is."""
        now, heads = time.monotonic(), self.team.heads
        if now < self._settled_at + SETTLES_S:
            return
        count = dict.fromkeys(self.team.listening(), 0)
        missed = [(h, other) for h in count for other in heads[h].missing if other in count]
        if not missed:
            self._forget()
            return
        for h, other in missed:
            if now - heads[other].pulse_at < SILENT_S / 2.0:
                count[h], count[other] = count[h] + 1, count[other] + 1
        most = max(count.values())
        worst = self._deaf([h for h in count if count[h] == most]) if most else None
        if worst is None:
            return
        self._settled_at = now
        if self.reported_off(worst):
            self._start_another_agent(worst)
        elif heads[worst].parks:
            self.team.processes[worst].kill()  # it would go on while a person looks
            self._lose(worst, BUS)
        else:
            self.team.processes[worst].send_to_controller(Abort(BUS))

    def _deaf(self, suspected: list[int]) -> int | None:
        """Return which of these heads has lost its bus; None: that is not known yet, or none has.

        Two heads that do not hear one another are equally suspected. So a witness listens. One
        that hears none of them may be broken itself.
        """
        witness = self.team.witness
        if len(suspected) == 1 or witness is None:
            self._forget()
            return suspected[-1]
        if not witness.is_asked:
            witness.ask()
        if witness.is_listening:
            return None
        silent = [h for h in suspected if h not in witness.heard]
        self._undecided += 1
        witness.is_asked = False
        if 0 < len(silent) < len(suspected) or self._undecided > PATIENCE:
            self._undecided = 0
            return (silent or suspected)[-1]
        return None

    def _forget(self) -> None:
        """Let nothing that a witness heard so far count for heads that lose one another later."""
        self._undecided = 0
        if self.team.witness is not None:
            self.team.witness.end()

    def fail(self, h: int, why: str) -> None:
        """Note that a head prints no more; it may still move."""
        team, head = self.team, self.team.heads[h]
        if head.failure is not None:
            return
        mine = [e.time_s for p in team.plans if h in p.heads for e in p.events_of(h)]
        head.failure = Failure(head.name, why, max(mine, default=0.0), team.clock.now())
        team.failures.append(head.failure)
        self.renewal.held.pop(h, None)
        team.note(f"head {head.name} failed: {why}")

    def fence(self, h: int, at: Point, why: str) -> None:
        """Make sure that a head does nothing any more but go to its park, if it can do that."""
        head, processes = self.team.heads[h], self.team.processes[h]
        assert head.failure is not None
        if why != FENCED and self._is_off(h):
            if why == ABORTED:
                processes.kill()
            return
        head.parks = why not in (ABORTED, FENCED)
        if not head.parks:
            processes.kill()
        elif head.agent_gone or why in (BUS, SILENT):
            processes.restart()
            head.replaced, head.agent_gone = not head.agent_gone, ""
            head.pulse_at = time.monotonic()
            if head.paused:
                self.team.send(h, command="pause")
        head.fenced, head.asked, head.failure.at = True, False, at
        if math.isnan(head.failure.fenced_s):
            head.failure.fenced_s = self.team.clock.now()
        self.renewal.unplanned.add(h)
        self.renewal.hold()  # what is planned has this head in it
