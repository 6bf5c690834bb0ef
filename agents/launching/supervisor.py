"""Watches the agents of one launch until they released one plan.

Decides who is fenced: an agent whose process ended, or one that stays silent, or that the
others cannot reach, after its process was killed and waited for. A pause is no death: who
is silent has `HUNG_S` to come back, and agents that speak but miss each other are first
sent to meet elsewhere. If that does not help, of two groups that miss each other the larger
goes on. A process that died while there is time to plan is no dead head: it is started again
once, and the others hold what they agree on until it is ready. A plan counts only when every
agent that is not fenced released the same digest. No planning here.
"""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from agents.launching import liveness
from agents.launching.processes import AgentLine, AgentProcess
from agents.launching.status import REPORTED, AgentStatus, LaunchError, OnProgress, StartAgain
from decmcts.search.sequence.stopping import Stopping

_POLL_S = 0.1
_NEVER = math.inf  # when something happened that has not happened yet


class Supervisor:
    """State of one launch; `run` until a plan is released.

    `elsewhere` returns fresh places; `start_again` is the only one to change `agents`.
    """

    def __init__(
        self,
        agents: Mapping[int, AgentProcess],
        names: tuple[str, ...],
        received: queue.Queue[AgentLine],
        *,
        stopping: Stopping,
        epoch: int,
        elsewhere: Callable[[], Sequence[str]],
        start_again: StartAgain,
        on_progress: OnProgress | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._epochs = dict.fromkeys(agents, epoch)  # which incarnation of each head counts
        self.fenced: set[int] = set()
        self.status = [AgentStatus(head, name) for head, name in enumerate(names)]
        self._agents, self._names, self._received = agents, names, received
        self._released: dict[int, dict[str, Any]] = {}
        self._released_since = _NEVER  # by the first agent
        self._ready: set[int] = set()
        self._misses: dict[tuple[int, int], float] = {}  # who misses whom -> since when
        self._liveness = liveness.Liveness()
        assert stopping.seconds is not None  # agents plan by the clock
        self._limit_s, self._on_progress = stopping.seconds, on_progress
        self._stopping, self._is_stopped = stopping, False
        self._elsewhere, self._moves = elsewhere, 0  # fresh places to meet at
        self._places: tuple[str, ...] | None = None  # where all were sent last
        self._start_again = start_again
        self._again: dict[int, float] = {}  # heads that were started again -> when
        self._clock = clock
        self._started = clock()
        self._first_ready_at = self._met_at = _NEVER
        self._over_at = _NEVER  # planning, by the first agent's word
        self._fenced_at = self._moved_at = -math.inf

    def run(self) -> dict[str, Any]:
        """Return the `released` line all unfenced agents agree on.

        Ctrl-C ends planning, and so does `stopping` once it is asked to: the agents then
        agree on the best so far. Ctrl-C after that goes on to the caller. LaunchError if no agent
        is left, one holds another problem, or all was stopped before they knew one another.
        """
        while True:
            try:
                if (released := self._result()) is not None:
                    return released
                self._listen()
                self._enforce_limits()
                if self._stopping.is_asked():
                    self.stop()
            except KeyboardInterrupt:
                if self._is_stopped or self._stopping.is_asked():
                    raise  # the second: whoever launched wants out
                self.stop()

    def stop(self) -> None:
        """Ask every agent, once, to end planning and agree on the best so far.

        LaunchError if an agent does not know all others yet: it would take them for lost.
        """
        if not self._is_stopped:
            self._is_stopped = True
            self._over_at = min(self._over_at, self._clock())
            known = [self.status[head] for head in self._unfenced()]
            heads = {status.head for status in known}
            if self._met_at == _NEVER and not all(s.rounds or heads <= set(s.live) for s in known):
                raise LaunchError("stopped before the agents had found one another")
            self._send_to_all({"command": "stop"})

    def _send_to_all(self, command: dict[str, Any]) -> None:
        for head in self._unfenced():
            self._agents[head].send(command)

    def _unfenced(self) -> list[int]:
        return [head for head in self._agents if head not in self.fenced]

    def _result(self) -> dict[str, Any] | None:
        heads = self._unfenced()
        if not heads:
            raise LaunchError(f"every agent ended: {self._notes()}")
        # One that misses a head which is not given up may have it back in a moment.
        if all(self.status[head].stuck and not self._missing(head) for head in heads):
            raise LaunchError(f"the heads that are left cannot print this: {self._notes()}")
        lines = [self._released.get(head) for head in heads]
        first = lines[0]
        if first is None or any(x is None or x["digest"] != first["digest"] for x in lines):
            return None
        return first

    def _notes(self) -> str:
        return "; ".join(dict.fromkeys(status.note for status in self.status if status.note))

    def _listen(self) -> None:
        try:
            received = self._received.get(timeout=_POLL_S)
        except queue.Empty:
            return
        if received.line is None:
            self._end(received.head)
        elif received.head not in self.fenced:
            self._take(received.head, received.line)
        if self._on_progress is not None:
            self._on_progress(tuple(self.status))

    def _take(self, head: int, line: dict[str, Any]) -> None:
        now = self._clock()
        if line.get("event") == "pulse":
            self._liveness.take_pulse(head, now)
            return
        # Loading and compiling say nothing of rounds.
        self._liveness.take_word(head, now, plans=self.status[head].rounds > 0)
        match line:
            case {"event": "ready"}:
                self._ready.add(head)
                if self._over_at < _NEVER:  # the others waited for it alone
                    self._over_at = now
                self._first_ready_at = min(self._first_ready_at, now)
                self._update(head, phase="waiting")
            case {"event": "progress"}:
                self._progress(head, line)
            case {"event": "note", "text": text}:
                self._update(head, note=text)
            case {"event": "refused", "reason": reason}:
                raise LaunchError(f"{self._names[head]} refused a peer: {reason}")
            case {"event": "unfenced", "heads": heads}:
                self._miss(head, heads)
            case {"event": "shut", "reason": reason}:
                self._update(head, note=reason)
                if now - self._moved_at > liveness.GRACE_S:
                    self._move()
            case {"event": "released"}:
                self._released[head] = line
                self._released_since = min(self._released_since, now)
                self._over_at = min(self._over_at, now)
                self._update(head, phase="released")

    def _progress(self, head: int, line: dict[str, Any]) -> None:
        best, history = line["best_makespan_s"], self.status[head].history
        if not history or best != history[-1][1]:
            history = (*history, (line["elapsed_s"], best))
        reported = {name: line[name] for name in REPORTED} | line["traffic"]
        self._update(head, live=tuple(line["live"]), history=history, **reported)
        if line["phase"] != "planning":
            self._over_at = min(self._over_at, self._clock())

    def _update(self, head: int, **changes: Any) -> None:
        self.status[head] = replace(self.status[head], **changes)

    def fence(self, head: int, why: str) -> None:
        """Make sure a head does nothing any more, then tell the others."""
        if head in self.fenced or head not in self._agents:
            return
        self._agents[head].kill()
        self.fenced.add(head)
        self._fenced_at = self._clock()
        self._released.pop(head, None)
        self._update(head, phase="lost", note=why)
        self._send_to_all(self._fence_command(head))

    def _fence_command(self, head: int) -> dict[str, Any]:
        return {"command": "fence", "head": head, "epoch": self._epochs[head]}

    # Who comes back -------------------------------------------------------------

    def _end(self, head: int) -> None:
        """Take in that a process ended: an agent that died while all plan is started again."""
        if head in self.fenced:
            return
        agent, now = self._agents[head], self._clock()
        ending = agent.ending()
        if self._is_over(now) or head in self._again or not agent.died():
            self.fence(head, ending or "its process ended")
            return
        self._epochs[head] += 1
        self._again[head] = now
        self._ready.discard(head)
        self._liveness.forget(head)
        self._update(head, phase="starting", live=(), stuck=False, note=ending, again=ending)
        left_s = max(0.0, self._limit_s - max(0.0, now - self._met_at))
        self._start_again(head, self._epochs[head], left_s, self._places)
        for other in self.fenced:
            self._agents[head].send(self._fence_command(other))

    # Who misses whom ----------------------------------------------------------

    def _miss(self, head: int, missing: Sequence[int]) -> None:
        """Note that an agent misses heads; tell it again of those that are fenced already."""
        self._update(head, live=tuple(sorted(set(self._unfenced()) - set(missing))))
        for other in self.fenced.intersection(missing):
            self._agents[head].send(self._fence_command(other))

    def _settle_misses(self, now: float) -> None:
        """Have agents meet elsewhere that miss each other; if that is no help, fence one side."""
        pairs = [(head, other) for head in self._unfenced() for other in self._missing(head)]
        self._misses = {pair: self._misses.get(pair, now) for pair in pairs}
        patience_s = liveness.MEET_S + liveness.MEET_HEAD_S * max(0, len(self._names) - 2)
        overdue = [
            (head, other)
            for (head, other), at in self._misses.items()
            if now - max(at, self._moved_at) >= patience_s
            and self._liveness.is_alive(head, now)
            and self._liveness.has_word_since(other, at)  # else it comes back, or is hung
        ]
        if not overdue:
            return
        accuser = min((head for head, _ in overdue), key=lambda h: _rank(self._group(h)))
        missed = sorted(other for head, other in overdue if head == accuser)
        if not self._move() and self._met_at < _NEVER and not self._is_over(now):
            return  # they plan apart; there is time to find each other
        if now - self._moved_at >= patience_s:
            self._fence_weaker(accuser, missed)

    def _fence_weaker(self, accuser: int, missed: Sequence[int]) -> None:
        # One that cannot hear the rest must not end them all; alike, the lowest head's side stays.
        group = self._group(accuser)
        if any(_rank(self._group(head) - group) < _rank(group) for head in missed):
            self.fence(accuser, "it hears too few of the others")
            return
        for head in missed:
            self.fence(head, f"{self._names[accuser]} does not hear it")

    def _move(self) -> bool:
        """Have all agents meet elsewhere; False if they did so too often."""
        if self._moves >= liveness.MOST_MOVES:
            return False
        self._moves += 1
        self._moved_at = self._clock()
        self._places = tuple(self._elsewhere())
        self._send_to_all({"command": "meet", "places": list(self._places)})
        return True

    def _group(self, head: int) -> set[int]:
        """Return who plans together, as one head last stated."""
        return set(self.status[head].live) - self.fenced

    def _missing(self, head: int) -> set[int]:
        """Return whom an agent is without who is not fenced."""
        return set(self._unfenced()) - self._group(head) - {head}

    # Time -----------------------------------------------------------------------

    def _enforce_limits(self) -> None:
        now, waiting = self._clock(), set(self._unfenced()) - self._ready
        if waiting:
            self._enforce_start(waiting, now)
            return
        if self._met_at == _NEVER and not any(map(self._missing, self._unfenced())):
            self._met_at = now
        if self._is_over(now) or self._met_at == _NEVER:
            for head in self._unfenced():
                if self._liveness.is_hung(head, now):
                    self.fence(head, f"it said nothing for {liveness.HUNG_S:g} s")
        self._settle_misses(now)
        if now - self._released_since > liveness.FOLLOW_LIMIT_S:
            self._fence_silent(f"silent {liveness.FOLLOW_LIMIT_S:g} s after a release")
        else:
            self._enforce_agreement(now)

    def _enforce_start(self, waiting: set[int], now: float) -> None:
        heads = len(self._names)
        for head in sorted(waiting):
            since = self._again.get(head, self._started)
            until = since + liveness.UNHEARD_S + heads
            if head not in self._again:
                until = min(until, self._first_ready_at + liveness.HUNG_S + heads / 2)
            if head in self._again and self._is_over(now, liveness.RETURN_S):
                self.fence(head, f"{self.status[head].again}, and not back in time")
            elif now - since > liveness.START_LIMIT_S:
                self.fence(head, f"not ready after {liveness.START_LIMIT_S:g} s")
            elif self._liveness.is_hung(head, now):
                self.fence(head, f"it said nothing for {liveness.HUNG_S:g} s")
            elif not self._liveness.was_alive(head) and now > until:
                self.fence(head, "it never said anything")

    def _is_over(self, now: float, since_s: float = 0.0) -> bool:
        """Whether planning has ended so long ago, by an agent's word or by the clock."""
        return now - since_s >= min(self._met_at + self._limit_s, self._over_at)

    def _enforce_agreement(self, now: float) -> None:
        """Give up agents that keep all from a release: first those that still plan."""
        late_s = liveness.LATE_LIMIT_S
        if self._over_at == _NEVER:
            if now - self._met_at > self._limit_s + late_s:
                self._fence_silent(f"not done {late_s:g} s after the time for planning")
            return
        heads_s = liveness.AGREE_HEAD_S * max(0, len(self._names) - 2)
        rounds_s = liveness.AGREE_ROUNDS * self._liveness.longest_round_s()
        limit_s = max(liveness.AGREE_LIMIT_S + heads_s, rounds_s)
        if now < max(self._over_at + limit_s, self._fenced_at + liveness.AFTER_FENCE_S):
            return
        why = f"no agreement {limit_s:.0f} s after planning"
        heads = self._unfenced()
        late = [h for h in heads if self.status[h].phase not in ("agreeing", "released")]
        for head in late if 0 < len(late) < len(heads) else ():
            self.fence(head, why)
        if not late or len(late) == len(heads):
            self._fence_silent(why)

    def _fence_silent(self, why: str) -> None:
        for head in sorted(set(self._unfenced()) - self._released.keys()):
            self.fence(head, why)


def _rank(group: set[int]) -> tuple[int, int]:
    """Order groups of heads by which should go on: the largest first, then the lowest head's."""
    return -len(group), min(group, default=0)
