"""Hostile plans on machines made at random: each must resolve, and the judge must agree.

    python -m sim.experiments.random_teams [--machines 100] [--plans 100] [--seed 0]

Machines of two to eight heads, on a rail, in a row or around the bed, with bodies, reaches and
parks drawn at random; small towers over their beds; plans that are sensible, shuffled or
nonsense. Prints how many resolved, how many the judge refused and why.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.feasibility.build import build_graph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.machine import Body, Head, Machine, Rail, Slice
from decmcts.print.plan import OrderRules, PlanDocument
from decmcts.team.plans import POLICIES, encode
from decmcts.team.problem import TeamProblem, build_team_problem
from decmcts.team.resolve import resolve
from decmcts.team.schedule import schedule
from sim.faults import Verdict
from sim.verify import verify_plan

BED_MM = 90.0  # a head's share of the bed along the heads' axis
RULES = OrderRules(quality=False, freedom="reversible")


def random_machine(seed: int) -> Machine:
    """Return a machine whose heads stand in a row (on a rail or not) or around a bed."""
    rng = np.random.default_rng([seed, 1])
    n = int(rng.integers(2, 9))
    kind = int(rng.integers(3))  # 0: on a rail, 1: in a row without one, 2: around the bed
    half = rng.uniform(4.0, 9.0, (n, 2))
    carriages = [Body("carriage", (-x, -y, 6.0), (x, y, 30.0)) for x, y in half.tolist()]
    gap = float(rng.uniform(0.5, 3.0))
    pitch = 2.0 * float(half.max()) + gap + float(rng.uniform(0.0, 8.0))
    size = np.array([BED_MM * n if kind < 2 else 140.0, 80.0])
    heads = tuple(
        Head(
            f"head {r}",
            _slices(half[r], rng),
            bodies=(carriages[r],),
            park=_park(r, n, kind, size, pitch, rng),
            reach_min=(0.0, 0.0, 0.0),
            reach_max=(float(size[0]), float(size[1]), 60.0),
        )
        for r in range(n)
    )  # fmt: skip
    rails = (Rail(0, tuple(h.name for h in heads), pitch),) if kind == 0 else ()
    return Machine(
        f"random {seed}", (0.0, 0.0), (float(size[0]), float(size[1])), heads,
        head_clearance_mm=gap, rails=rails, release="point",
    )  # fmt: skip


def _slices(half: NDArray[np.float64], rng: np.random.Generator) -> tuple[Slice, ...]:
    tip, (x, y) = float(rng.uniform(1.0, 2.5)), half
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return Slice(0.0, (corners * tip,)), Slice(float(rng.uniform(1, 4)), (corners * [x, y],))


def _park(
    r: int, n: int, kind: int, size: NDArray[np.float64], pitch: float, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Return where a head parks: beside the bed in a row's order, or anywhere around it."""
    z = float(rng.uniform(2.0, 12.0))
    if kind < 2:
        left = n // 2
        x = -pitch * (left - r) if r < left else float(size[0]) + pitch * (r - left + 1)
        return x, float(rng.uniform(0.0, size[1])), z
    side, place = r % 4, (r // 4 + 0.5) / 2.0
    off = pitch + 2.0
    places = [
        (-off, place * size[1]), (size[0] + off, place * size[1]),
        (place * size[0], -off), (place * size[0], size[1] + off),
    ]  # fmt: skip
    return float(places[side][0]), float(places[side][1]), z


def random_print(machine: Machine, seed: int, towers: int = 8, layers: int = 3) -> PrintJob:
    """Return towers over the bed of a machine: a loop and a stroke on each layer, some wide."""
    rng = np.random.default_rng([seed, 2])
    low, high = np.array(machine.bed_min) + 12.0, np.array(machine.bed_max) - 12.0
    centres, sizes = rng.uniform(low, high, (towers, 2)), rng.uniform(1.5, 11.0, (towers, 2))
    lines, layer = [], []
    for level in range(layers):
        for centre, size in zip(centres, sizes, strict=True):
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * size + centre
            strokes = np.array([[-0.6, -0.6], [0.0, 0.5], [0.6, -0.6], [0.7, 0.7]]) * size + centre
            for shape in (corners, strokes):
                lines.append(np.column_stack([shape, np.full(len(shape), 0.4 * (level + 1))]))
                layer.append(level)
    return PrintJob(f"towers {seed}", _contours(lines, layer), ProcessSettings(travel_feed=120.0))


def _contours(lines: list[NDArray[np.float64]], layer: list[int]) -> Contours:
    n, offsets = len(lines), np.cumsum([0, *(len(line) for line in lines)]).astype(np.int64)
    feed = np.full(int(offsets[-1]), 40.0)
    feed[offsets[:-1]] = 0.0
    return Contours(
        points=np.concatenate(lines),
        offsets=offsets,
        extrusion=np.where(feed > 0, 0.1, 0.0),
        feed=feed,
        width=np.full(n, 0.5),
        height=np.full(n, 0.4),
        role=np.ones(n, np.int8),
        closed=np.array([bool((line[0] == line[-1]).all()) for line in lines]),
        layer=np.array(layer, np.int32),
        tool=np.zeros(n, np.int16),
        reversible=np.ones(n, np.bool_),
        epoch=np.zeros(n, np.int32),
        line=np.zeros(n, np.int32),
    )


def random_plans(problem: TeamProblem, rng: np.random.Generator) -> dict[int, NDArray[np.int32]]:
    """Return plans of all heads: sensible, shuffled, everything for each, or nonsense."""
    kind, plans = int(rng.integers(4)), {}
    for r in range(len(problem.machine.heads)):
        macros = problem.sides_of(r)
        if kind == 1:
            macros = rng.permutation(macros).astype(np.int32)
        elif kind == 2:
            macros = rng.permutation(problem.n_macros).astype(np.int32)
        plan = encode(macros, int(rng.integers(len(POLICIES))), problem.n_macros)
        if kind == 3:
            plan = rng.integers(-5, 3 * problem.n_macros, 40).astype(np.int32)
        plans[r] = plan
    return plans


def judged(problem: TeamProblem, plans: dict[int, NDArray[np.int32]], trials: int = 1) -> Verdict:
    """Return what the judge makes of the joint plan that plans resolve to."""
    heads = list(range(len(problem.machine.heads)))
    found = resolve(problem, plans, heads)
    job, machine, graph = problem.job, problem.machine, problem.graph
    plan = schedule(job, machine, graph, found.toolpaths)
    document = PlanDocument(
        problem.digest, machine, job.contours, graph.pairs(), plan, {}, rules=RULES
    )
    return verify_plan(document, source=job, trials=trials)


def problem_of(seed: int) -> TeamProblem:
    """Return the problem of a random print on a random machine; InputError where it has none."""
    machine = random_machine(seed)
    job = random_print(machine, seed)
    graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
    return build_team_problem(job, machine, graph)


def main() -> None:
    """Run the experiment and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--plans", type=int, default=100, help="of each machine")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    for seed in range(options.seed, options.seed + options.machines):
        try:
            problem = problem_of(seed)
        except InputError as error:
            counts[f"no problem: {error.what[:60]}"] += 1
            continue
        rng = np.random.default_rng([seed, 3])
        for _ in range(options.plans):
            verdict = judged(problem, random_plans(problem, rng))
            counts["accepted" if verdict.ok else f"refused: {verdict.faults[0].kind}"] += 1
            if not verdict.ok:
                print(problem.machine.name, len(problem.machine.heads), str(verdict.faults[0]))
    for what, count in counts.most_common():
        print(f"{count:6d}  {what}")


if __name__ == "__main__":
    main()
