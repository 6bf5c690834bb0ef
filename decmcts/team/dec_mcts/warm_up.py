"""Compiles, or loads, every kernel of the heads' search with the smallest print there is.

Kernels are compiled for types and not for prints, so a large search can use what a tiny
one has compiled. Without this, compiling would be part of a search's first round and
take its time.
"""

from __future__ import annotations

import numpy as np

from decmcts.feasibility.build import build_graph
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.team.dec_mcts.parameters import Parameters
from decmcts.team.dec_mcts.planner import DecMcts
from decmcts.team.dec_mcts.polish import Polish
from decmcts.team.engine.plans import StatedOrder, encode_stated
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.engine.start import changed_order, start_of

HEADS = (0, 1)
ROUNDS = 4  # policies first, then tree, distribution and windows


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


def smallest_problem() -> TeamProblem:
    """Return the smallest job for two heads on a rail."""
    job, machine = smallest_job(), load_machine("dual-gantry")
    graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
    return build_team_problem(job, machine, graph)


def compile_rounds(problem: TeamProblem | None = None) -> list[DecMcts]:
    """Let two heads plan a few rounds of the smallest job and tell each other; return them."""
    made = smallest_problem() if problem is None else problem
    few = Parameters(plans=2, samples=1, renew=1, tries=2, windows=1)
    team = [DecMcts(made, head, seed=0, parameters=few) for head in HEADS]
    for _ in range(ROUNDS):
        for head, agent in enumerate(team):
            agent.iterate(HEADS)
            other = team[1 - head]
            other.take(head, agent.distribution)
            other.take_joint(agent.best(HEADS).plans, HEADS)
    stated = StatedOrder.of(resolve(made, {}, HEADS).toolpaths)
    larger = Polish(made, stated, seed=0)
    larger.recreate(1)  # as orders of more contours are
    larger.take(stated)
    resolve(made, {0: encode_stated(stated, len(HEADS), made.n_macros)}, HEADS)
    n = len(made.macro)
    begun = start_of(stated, np.zeros(n, np.int64), np.zeros(n), np.ones(n))
    changed_order(begun, {}, made.space.eligible, made.graph)
    return team
