"""Watches the agents of one launch until they released one plan.

Decides who is fenced: an agent whose process ended, or one the others could
not reach, after its process was killed and waited for. Of two groups that miss
each other the larger goes on. A plan counts only when every agent that is not
fenced released the same digest. No planning here.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from agents.launching.processes import Said
from decmcts.search.sequence.stopping import Stopping

START_LIMIT_S = 180.0
"""To load the problem and compile; a head that takes longer is fenced."""

AGREE_LIMIT_S = 120.0
"""From the end of planning to the release: a last resort, far above the lease,
because an agent in a long round on a busy machine is silent too."""

FOLLOW_LIMIT_S = 5.0
"""From the first release to the last: by then every live head has agreed, so one
that says nothing any more is dead or stopped."""

GRACE_S = 2.0
"""From the first word that heads are missing to a fence: twice the lease. An agent
that stood still loses all its peers at once, and has them back within this time.
Also how long any agent may say nothing to the launcher without being silent."""

_POLL_S = 0.1


class LaunchError(Exception):
    """The agents came to no plan; one line says why."""


class Child(Protocol):
    """What is done to an agent's process here."""

    def tell(self, command: dict[str, Any]) -> None:
        """Send it a command."""

    def kill(self) -> None:
        """End it and wait for its end."""

    def last_words(self) -> str:
        """Return the last line of its errors."""


@dataclass(frozen=True, slots=True)
class AgentStatus:
    """What the launcher last heard of one agent."""

    head: int
    name: str
    phase: str = "starting"
    live: tuple[int, ...] = ()
    rounds: int = 0
    best_makespan_s: float = float("inf")
    elapsed_s: float = 0.0
    sent: Mapping[str, int] = field(default_factory=dict)  # messages by kind
    sent_bytes: Mapping[str, int] = field(default_factory=dict)
    received: Mapping[str, int] = field(default_factory=dict)
    received_bytes: Mapping[str, int] = field(default_factory=dict)
    dropped: Mapping[str, int] = field(default_factory=dict)  # by reason
    history: tuple[tuple[float, float], ...] = ()  # (elapsed s, best makespan s), improvements
    entropy: float = 1.0  # of the plans it last told: 0 decided, 1 all alike
    note: str = ""
    stuck: bool = False  # the heads it hears cannot print everything
    agreeing_s: float | None = None  # from the end of planning, to the release in the end


OnProgress = Callable[[tuple[AgentStatus, ...]], None]


class Supervisor:
    """State of one launch; `run` until a plan is released."""

    def __init__(
        self,
        agents: Mapping[int, Child],
        names: tuple[str, ...],
        heard: queue.Queue[Said],
        *,
        stopping: Stopping,
        epoch: int,
        on_progress: OnProgress | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._epoch = epoch  # incarnation of all the agents of this launch
        self.fenced: set[int] = set()
        self.status = [AgentStatus(head, name) for head, name in enumerate(names)]
        self._agents, self._names, self._heard = agents, names, heard
        self._released: dict[int, dict[str, Any]] = {}
        self._released_since: float | None = None  # by the first agent
        self._ready: set[int] = set()
        self._misses: dict[int, float] = {}  # head that misses others -> since when
        self._heard_at: dict[int, float] = {}  # head -> when it last said something
        self._gap_s: dict[int, float] = {}  # head -> its longest silence yet
        assert stopping.seconds is not None  # agents plan by the clock
        self._limit_s, self._on_progress = stopping.seconds, on_progress
        self._stopping, self._told_to_stop = stopping, False
        self._clock = clock
        self._started = clock()
        self._since = self._started  # of the latest change of the team

    def run(self) -> dict[str, Any]:
        """Return the `released` line all unfenced agents agree on.

        Ctrl-C ends planning, and so does `stopping` once it is asked to: the agents then
        agree on the best so far. Ctrl-C after that goes on to the caller.

        Raises
        ------
        LaunchError
            If no agent is left, an agent holds another problem, or all was stopped
            before they knew one another.
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
                if self._told_to_stop or self._stopping.is_asked():
                    raise  # the second: whoever launched wants out
                self.stop()

    def stop(self) -> None:
        """Ask every agent, once, to end planning and agree on the best so far.

        Raises
        ------
        LaunchError
            If an agent does not know all others yet: it would take them for lost.
        """
        if not self._told_to_stop:
            self._told_to_stop = True
            if not self._have_met():
                raise LaunchError("stopped before the agents had found one another")
            self._tell_all({"command": "stop"})

    def _have_met(self) -> bool:
        """Tell whether every agent planned, or knows all it will plan with."""
        heads = self._unfenced()
        return all(
            self.status[h].rounds > 0 or set(heads) <= set(self.status[h].live) for h in heads
        )

    def _tell_all(self, command: dict[str, Any]) -> None:
        for head in self._unfenced():
            self._agents[head].tell(command)

    def _unfenced(self) -> list[int]:
        return [head for head in self._agents if head not in self.fenced]

    def _result(self) -> dict[str, Any] | None:
        heads = self._unfenced()
        if not heads:
            raise LaunchError(f"every agent ended: {self._notes()}")
        if all(self.status[head].stuck for head in heads):
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
            said = self._heard.get(timeout=_POLL_S)
        except queue.Empty:
            return
        if said.line is None:
            self.fence(said.head, "its process ended")
        elif said.head not in self.fenced:
            self._note_time(said.head)
            self._hear(said.head, said.line)
        if self._on_progress is not None:
            self._on_progress(tuple(self.status))

    def _note_time(self, head: int) -> None:
        now = self._clock()
        if self.status[head].rounds:  # loading and compiling say nothing of rounds
            gap_s = now - self._heard_at[head]
            self._gap_s[head] = max(gap_s, self._gap_s.get(head, 0.0))
        self._heard_at[head] = now

    def _hear(self, head: int, line: dict[str, Any]) -> None:
        match line:
            case {"event": "ready"}:
                self._ready.add(head)
                self._since = self._clock()
                self._update(head, phase="waiting")
            case {"event": "progress"}:
                self._progress(head, line)
            case {"event": "note", "text": text}:
                self._update(head, note=text)
            case {"event": "refused", "reason": reason}:
                raise LaunchError(f"{self._names[head]} refused a peer: {reason}")
            case {"event": "unfenced", "heads": heads}:
                self._miss(head, heads)
            case {"event": "released"}:
                self._released[head] = line
                self._released_since = self._released_since or self._clock()
                self._update(head, phase="released")

    def _progress(self, head: int, line: dict[str, Any]) -> None:
        best, history = line["best_makespan_s"], self.status[head].history
        if not history or best != history[-1][1]:
            history = (*history, (line["elapsed_s"], best))
        named = (
            "phase",
            "rounds",
            "best_makespan_s",
            "elapsed_s",
            "agreeing_s",
            "stuck",
            "entropy",
        )
        told = {name: line[name] for name in named} | line["traffic"]
        self._update(head, live=tuple(line["live"]), history=history, **told)

    def _update(self, head: int, **changes: Any) -> None:
        self.status[head] = replace(self.status[head], **changes)

    def fence(self, head: int, why: str) -> None:
        """Make sure a head does nothing any more, then tell the others."""
        if head in self.fenced or head not in self._agents:
            return
        self._agents[head].kill()
        self.fenced.add(head)
        self._since = self._clock()
        self._released.pop(head, None)
        note = self._agents[head].last_words() or self.status[head].note or why
        self._update(head, phase="lost", note=note)
        self._tell_all(self._fence_command(head))

    def _miss(self, head: int, missing: Sequence[int]) -> None:
        """Note that an agent misses heads; tell it again of those that are fenced already."""
        self._update(head, live=tuple(sorted(set(self._unfenced()) - set(missing))))
        for other in self.fenced.intersection(missing):
            self._agents[head].tell(self._fence_command(other))
        if not self.fenced.issuperset(missing):
            self._misses.setdefault(head, self._clock())

    def _settle_misses(self, now: float) -> None:
        """Fence one side once an agent has missed others for a while."""
        self._misses = {h: at for h, at in self._misses.items() if self._missing(h)}
        overdue = [
            head
            for head, at in self._misses.items()
            if now - at >= GRACE_S and not self._is_silent(head, now)
        ]
        if not overdue:
            return
        accuser = min(overdue, key=lambda head: _rank(self._group(head)))
        group, missing = self._group(accuser), sorted(self._missing(accuser))
        # One that cannot hear the rest must not end them all; alike, the lowest head's side stays.
        stronger = [
            head
            for head in missing
            if not self._is_silent(head, now) and _rank(self._group(head) - group) < _rank(group)
        ]
        if any(self._heard_at[head] > self._misses[accuser] for head in stronger):
            self.fence(accuser, "it hears too few of the others")
        elif not stronger:  # else one may be in a long round: its word comes, or it is silent
            for head in missing:
                self.fence(head, f"{self._names[accuser]} does not hear it")

    def _group(self, head: int) -> set[int]:
        """Return who plans together, as one head last said."""
        return set(self.status[head].live) - self.fenced

    def _missing(self, head: int) -> set[int]:
        """Return whom an agent is without who is not fenced; nobody if it is fenced itself."""
        return set() if head in self.fenced else set(self._unfenced()) - self._group(head)

    def _is_silent(self, head: int, now: float) -> bool:
        """Whether an agent says nothing for much longer than it ever did."""
        longest_s = max(GRACE_S, 2.0 * self._gap_s.get(head, 0.0))
        return now - self._heard_at.get(head, -float("inf")) > longest_s

    def _fence_command(self, head: int) -> dict[str, Any]:
        return {"command": "fence", "head": head, "epoch": self._epoch}

    def _enforce_limits(self) -> None:
        now, waiting = self._clock(), set(self._unfenced()) - self._ready
        self._settle_misses(now)
        if waiting and now - self._started > START_LIMIT_S:
            for head in waiting:
                self.fence(head, f"not ready after {START_LIMIT_S:g} s")
        elif not waiting and now - self._since > self._limit_s + AGREE_LIMIT_S:
            self._fence_silent(f"no agreement {AGREE_LIMIT_S:g} s after planning")
        elif self._released and now - (self._released_since or now) > FOLLOW_LIMIT_S:
            self._fence_silent(f"silent {FOLLOW_LIMIT_S:g} s after a release")

    def _fence_silent(self, why: str) -> None:
        for head in sorted(set(self._unfenced()) - self._released.keys()):
            self.fence(head, why)


def _rank(group: set[int]) -> tuple[int, int]:
    """Order groups of heads by which should go on: the largest first, then the lowest head's."""
    return -len(group), min(group, default=0)
