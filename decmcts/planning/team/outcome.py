"""What became of the agents: who was lost and why, and whether somebody disturbed them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from agents.launch import LaunchResult
from agents.launching.status import AgentStatus
from agents.networks.transport import DISTURBS
from decmcts.print.metrics import Metrics, TeamMetrics


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a launch of agents came to."""

    result: LaunchResult | None  # None: they came to no plan
    agents: tuple[AgentStatus, ...]  # as they were seen last
    failed: str = ""  # why they came to none
    decided: tuple[tuple[float, ...], ...] = ()  # see `Deciding`

    @property
    def lost(self) -> dict[str, str]:
        """The heads that the plan does without, each with the reason."""
        live = () if self.result is None else self.result.agreement.live
        gone = (a for a in self.agents if a.phase == "lost" and a.head not in live)
        return {agent.name: agent.note for agent in gone}

    @property
    def disturbed(self) -> dict[str, int]:
        """What was dropped that no agent says: how many messages by reason."""
        dropped: Counter[str] = Counter()
        for agent in self.agents:
            dropped.update({k: n for k, n in agent.dropped.items() if k.startswith(DISTURBS)})
        return dict(sorted(dropped.items()))

    @property
    def found_by(self) -> str | None:
        """The head whose agent was the first to know a plan as good as the best of all."""
        known = [(cost, s, a.name) for a in self.agents for s, cost in a.history]
        return min(known)[2] if known and not self.failed else None

    def metrics(self) -> Metrics:
        """Return what a plan states of its agents."""
        return {
            "agents": [_traffic(agent) for agent in self.agents],
            "decided": self.decided,
            "found_by": self.found_by,
            "team": {
                "agreed": not self.failed,
                "failed": self.failed or None,
                "lost": self.lost,
                "again": {a.name: a.again for a in self.agents if a.again},
                "disturbed": self.disturbed,
            },
        }


class Deciding:
    """How heads' distributions over plans sharpen: rows of seconds and each head's entropy.

    An entropy is 1 where all plans are alike, and 0 where one is chosen. At most `MOST` rows are
    kept, evenly spread.
    """

    MOST = 128

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []
        self._least_s = 0.0  # between two rows

    def take(self, agents: tuple[AgentStatus, ...]) -> None:
        """Keep what the agents state, if enough time has passed."""
        seconds = max((agent.elapsed_s for agent in agents), default=0.0)
        if not seconds or (self._rows and seconds < self._rows[-1][0] + self._least_s):
            return
        self._rows.append((round(seconds, 3), *(round(a.entropy, 4) for a in agents)))
        if len(self._rows) > self.MOST:
            self._rows = self._rows[::2]
            self._least_s = 2.0 * max(self._least_s, seconds / self.MOST)

    @property
    def rows(self) -> tuple[tuple[float, ...], ...]:
        """What was kept."""
        return tuple(self._rows)


def lines_of(team: TeamMetrics) -> list[str]:
    """Return a line for whatever a user should know of the agents, from a plan's metrics."""
    lines = [f"{team['failed']}; one head prints alone"] if team["failed"] else []
    if not team["failed"]:
        lost = team["lost"].items()
        lines += [f"head {name} was lost ({why}); the plan does without it" for name, why in lost]
    for name, why in team["again"].items():
        if team["failed"] or name not in team["lost"]:
            lines.append(f"the agent of head {name} was started again ({why})")
    if counts := team["disturbed"]:
        what = ", ".join(f"{n} × {reason}" for reason, n in counts.items())
        lines.append(f"somebody disturbed the agents; dropped and not heard: {what}")
    return lines


def _traffic(agent: AgentStatus) -> dict[str, object]:
    """Return how many rounds an agent made and how many messages it exchanged."""
    return {
        "head": agent.name,
        "rounds": agent.rounds,
        "sent": sum(agent.sent.values()),
        "sent_bytes": sum(agent.sent_bytes.values()),
        "received": sum(agent.received.values()),
        "received_bytes": sum(agent.received_bytes.values()),
        "dropped": sum(agent.dropped.values()),
        "agreeing_s": agent.agreeing_s,
    }
