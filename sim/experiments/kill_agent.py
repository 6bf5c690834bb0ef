"""Kill an agent while the team plans: the others must still bring a safe plan.

    python -m sim.experiments.kill_agent [PRINT.gcode] --head 1 --after 3 --time-limit 10

Starts one process per head, kills one (or stops it, `--hang`, so that it is
there but silent) and judges what the others agree on.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from agents.launch import launch
from agents.launching.status import AgentStatus, LaunchError
from decmcts.errors import InputError
from decmcts.feasibility.rules import order_rules
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.plan import PlanDocument
from decmcts.samples import sample_path
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.schedule.joint_plan import schedule
from sim.verify import verify_plan


class Assassin:
    """Sends one agent a signal once it has planned for a while."""

    def __init__(self, head: int, after_s: float, number: signal.Signals) -> None:
        self._head = head
        self._after_s = after_s
        self._signal = number
        self._pid: int | None = None
        self.struck = False

    def learn(self, pids: Mapping[int, int]) -> None:
        """Take the process ids of the agents this program started."""
        self._pid = pids[self._head]

    def watch(self, agents: Sequence[AgentStatus]) -> None:
        """Strike when the time has come."""
        victim = agents[self._head]
        if not self.struck and self._pid is not None and victim.elapsed_s >= self._after_s:
            os.kill(self._pid, self._signal)
            self.struck = True


def run(
    path: Path, machine_name: str, assassin: Assassin, *, time_limit_s: float, seed: int
) -> int:
    """Plan with a death on the way; returns 0 when the rest brought a faultless plan."""
    job, _ = read_gcode(path)
    machine = load_machine(machine_name)
    graph = order_rules(job, machine)
    result = launch(
        job,
        machine,
        graph,
        stopping=Stopping(time_limit_s),
        seed=seed,
        on_start=assassin.learn,
        on_progress=assassin.watch,
    )
    plan = schedule(job, machine, graph, list(result.toolpaths))
    document = PlanDocument(result.problem, machine, job.contours, graph.pairs(), plan, {})
    verdict = verify_plan(document, source=job, seed=seed)
    live = ", ".join(machine.heads[r].name for r in result.agreement.live)
    printed = ", ".join(f"{h.head}: {int((h.contour >= 0).sum())}" for h in plan.heads)
    print(f"struck: {assassin.struck}; live heads: {live}; contours printed by {printed}")
    print(f"makespan {plan.makespan_s:.1f} s; {len(verdict.faults)} faults")
    for fault in verdict.faults:
        print(fault)
    return 0 if assassin.struck and verdict.ok else 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument(
        "input", nargs="?", type=Path, default=sample_path("plate.gcode.gz"), metavar="PRINT.gcode"
    )
    parser.add_argument("--machine", default="dual-gantry")
    parser.add_argument("--head", type=int, default=1, help="index of the head to lose")
    parser.add_argument("--after", type=float, default=3.0, metavar="S", help="seconds of planning")
    parser.add_argument("--hang", action="store_true", help="stop it instead of killing it")
    parser.add_argument("--time-limit", type=float, default=10.0, metavar="S")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    number = signal.SIGSTOP if options.hang else signal.SIGKILL
    assassin = Assassin(options.head, options.after, number)
    try:
        return run(
            options.input,
            options.machine,
            assassin,
            time_limit_s=options.time_limit,
            seed=options.seed,
        )
    except (InputError, LaunchError) as error:
        print(f"decmcts: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    raise SystemExit(main())
