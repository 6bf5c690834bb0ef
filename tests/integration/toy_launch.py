"""A launcher process over the toy problem: says its agents' pids, then the agreed digest."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from agents.launching.spawn import run_agents
from agents.launching.status import AgentStatus
from decmcts.search.sequence.stopping import Stopping

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # CI may start us ignoring it
    names = os.environ["TOY_HEADS"].split(",")
    toy = (sys.executable, str(Path(__file__).with_name("toy_agent.py")))
    told = False

    def on_progress(status: tuple[AgentStatus, ...]) -> None:
        """Say once that all agents plan together."""
        global told
        if not told and all(len(s.live) == len(names) and s.rounds for s in status):
            told = True
            print("planning", flush=True)

    agreement = run_agents(
        names,
        [],
        seed=1,
        stopping=Stopping(float(sys.argv[1])),
        command=toy,
        on_progress=on_progress,
        on_start=lambda pids: print(*pids.values(), flush=True),
    )
    print(agreement.digest, *agreement.live, flush=True)
