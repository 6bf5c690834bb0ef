"""Compiles the kernels of team and judge ahead of need, in a process of its own.

On a fresh machine the demo would otherwise compile everything one after the
other on one core; run as `python -m decmcts.cli.warm` beside it, this takes the
second half. It plans and judges a print of four contours; nothing is written but
the compiled code that every process shares.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.digest import problem_digest
from decmcts.formats.machine_file import load_machine
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.plan import PlanDocument
from decmcts.team.dec_mcts import DecMcts
from decmcts.team.problem import build_team_problem
from decmcts.team.resolve import resolve
from decmcts.team.schedule import schedule
from sim.verify import verify_plan


@contextmanager
def compiling_ahead() -> Iterator[None]:
    """Run this module beside the body of a `with`; costs nothing once all is compiled."""
    command = [sys.executable, "-m", "decmcts.cli.warm"]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet) as child:
        try:
            yield
        finally:
            child.kill()


def smallest_job() -> PrintJob:
    """Return two lines far apart on each of two layers."""
    lines = [[(x, 150.0, z), (x + 5.0, 150.0, z)] for z in (0.2, 0.4) for x in (60.0, 220.0)]
    n, points = len(lines), np.array(lines).reshape(-1, 3)
    contours = Contours(
        points=points,
        offsets=2 * np.arange(n + 1, dtype=np.int64),
        extrusion=np.tile([0.0, 0.2], n),
        feed=np.tile([0.0, 40.0], n),
        width=np.full(n, 0.45),
        height=np.full(n, 0.2),
        role=np.ones(n, np.int8),
        closed=np.zeros(n, np.bool_),
        layer=np.array([0, 0, 1, 1], np.int32),
        tool=np.zeros(n, np.int16),
        reversible=np.ones(n, np.bool_),
        epoch=np.zeros(n, np.int32),
        line=np.zeros(n, np.int32),
    )
    return PrintJob("smallest", contours)


def main() -> None:
    """Plan and judge the smallest job with two heads."""
    job, machine = smallest_job(), load_machine("dual-gantry")
    graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
    problem = build_team_problem(job, machine, graph)
    agents = [DecMcts(problem, head, seed=0) for head in (0, 1)]
    for head, agent in enumerate(agents):
        agent.iterate([0, 1])
        agents[1 - head].take(head, agent.distribution)
    found = resolve(problem, agents[0].best([0, 1]).plans, [0, 1])
    plan = schedule(job, machine, graph, found.toolpaths)
    digest = problem_digest(job.contours, graph, machine)
    document = PlanDocument(digest, machine, job.contours, graph.pairs(), plan, {})
    faults = verify_plan(document, source=job, digest=digest, trials=1).faults
    if faults:
        raise SystemExit(f"the smallest job has faults: {faults[0]}")


if __name__ == "__main__":
    main()
