"""A team of agents with the small planner of the tests, on a memory network."""

from __future__ import annotations

from agents.networks.memory import Weather
from decmcts.experiments.in_memory import MemoryTeam
from tests.agents.faulty_network import FaultyNetwork
from tests.agents.toy import ToyPlanner


class Team(MemoryTeam):
    """Agents 0..n-1 over one network; each has the same small problem."""

    kind = FaultyNetwork

    def __init__(
        self,
        n: int,
        weather: Weather,
        *,
        seed: int = 0,
        limit_s: float = 1.0,
        needed: int | None = None,
        quirks: dict[int, str] | None = None,
        silence_s: float = 15.0,
    ) -> None:
        self.names = tuple(f"head{h}" for h in range(n))
        self.jobs = 40

        def planner_of(head: int) -> ToyPlanner:
            return ToyPlanner(
                head,
                names=self.names,
                jobs=self.jobs,
                seed=seed,
                needed=needed,
                quirk=(quirks or {}).get(head, ""),
            )

        super().__init__(n, weather, planner_of, seed=seed, limit_s=limit_s, silence_s=silence_s)

    def add(
        self, head: int, *, epoch: int = 1, jobs: int = 40, fenced: tuple[int, ...] = ()
    ) -> None:
        self.jobs = jobs
        super().add(head, epoch=epoch, fenced=fenced)
