"""What became of the agents: who was lost and why, and whether somebody disturbed them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from agents.launch import LaunchResult
from agents.launching.supervisor import AgentStatus
from agents.networks.transport import DISTURBS
from decmcts.print.metrics import Metrics, TeamMetrics


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a launch of agents came to."""

    result: LaunchResult | None  # None: they came to no plan
    agents: tuple[AgentStatus, ...]  # as they were seen last
    failed: str = ""  # why they came to none

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

    def metrics(self) -> Metrics:
        """Return what a plan states of its agents."""
        return {
            "agents": [_traffic(agent) for agent in self.agents],
            "team": {
                "agreed": not self.failed,
                "failed": self.failed or None,
                "lost": self.lost,
                "disturbed": self.disturbed,
            },
        }


def lines_of(team: TeamMetrics) -> list[str]:
    """Return a line for whatever a user should know of the agents, from a plan's metrics."""
    said = [f"{team['failed']}; one head prints alone"] if team["failed"] else []
    if not team["failed"]:
        lost = team["lost"].items()
        said += [f"head {name} was lost ({why}); the plan does without it" for name, why in lost]
    if counts := team["disturbed"]:
        what = ", ".join(f"{n} × {reason}" for reason, n in counts.items())
        said.append(f"somebody disturbed the agents; dropped and not heard: {what}")
    return said


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
