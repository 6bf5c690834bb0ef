"""Small problems for the tests of the search."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.walls import _gridded
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.planners import plan_order
from decmcts.search.sequence.entries_kernels import visits_cost
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.metric_kernels import Metric
from decmcts.search.sequence.moves_kernels import Tour
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem, Pace, Seams
from decmcts.search.sequence.stopping import Stopping


def random_problem(
    seed: int, n: int, *, density: float = 0.3, reversible: float = 0.5
) -> OrderProblem:
    """Endpoints in a small box, on a coarse grid so that ties and zero travels occur."""
    rng = np.random.default_rng(seed)
    start = rng.integers(0, 5, (n, 3)).astype(float)
    end = rng.integers(0, 5, (n, 3)).astype(float)
    pairs = np.argwhere(np.triu(rng.random((n, n)) < density, 1)).astype(np.int32)
    layer = np.sort(rng.integers(0, 1 + n // 3, n)).astype(np.int32)
    graph = DependencyGraph.from_pairs(n, pairs)
    return OrderProblem(start, end, rng.random(n) < reversible, layer, graph)


def started(problem: OrderProblem) -> Incumbent:
    """The source's own order, where no search has begun."""
    return Incumbent(problem, clock=lambda: 0.0, stopping=Stopping(seconds=1.0))


def sliced_tour(problem: OrderProblem, group: np.ndarray | None = None) -> Tour:
    """The source's own order, for moves that stay within equal `group`."""
    sequence = Sequence.best_of(started(problem), near_ports(problem))
    block = cut(sequence, 0, len(problem))
    return (block if group is None else block.within(group)).tour


def with_loops(problem: OrderProblem, seed: int) -> OrderProblem:
    """Let about half of the contours be entered at two to four entries instead."""
    rng = np.random.default_rng(seed)
    n = len(problem)
    counts = np.where(rng.random(n) < 0.5, rng.integers(2, 5, n), 1)
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    enter = rng.integers(0, 5, (offsets[-1], 3)).astype(float)
    leave = enter + rng.integers(0, 2, enter.shape)
    first, chosen = offsets[:-1], counts > 1
    enter[first[~chosen]], leave[first[~chosen]] = problem.start[~chosen], problem.end[~chosen]
    vertices = (np.arange(offsets[-1]) - np.repeat(first, counts)).astype(np.int32)
    return replace(
        problem,
        start=enter[first],
        end=leave[first],
        reversible=problem.reversible & ~chosen,
        seams=Seams(offsets, enter, leave, vertices),
    )


def with_pace(problem: OrderProblem) -> OrderProblem:
    """Price travels in seconds: short ones never reach full speed, long ones hop."""
    return replace(problem, pace=Pace(2.0, 1.5, 0.7, 1.1, hop_s=0.8, free_mm=2.5))


def with_bare(problem: OrderProblem) -> OrderProblem:
    """Price travels as `with_pace`, but for some inside walls and over them: see `is_inside`."""
    pace = Pace(
        2.0, 1.5, 0.7, 1.1, hop_s=0.8, free_mm=2.5, bare_mm=4.2, climb_mm=1.0, over=0.6,
        walls=box_walls(),
    )  # fmt: skip
    assert pace.looks_at_walls
    return replace(problem, pace=pace)


def box_walls() -> np.ndarray:
    """Rectangles around the small box of `random_problem`, but for its rim on one side."""
    segments, height = [], []
    for z in range(5):
        x, y = (2.5, 5.5) if z % 2 == 0 else (5.5, 2.5)
        ring = [(-0.5, -0.5), (x, -0.5), (x, y), (-0.5, y), (-0.5, -0.5)]
        segments += [(*p, *q) for p, q in pairwise(ring)]
        height += [float(z)] * 4
    return _gridded(np.array(segments), np.array(height))


def is_inside(point: np.ndarray, z: float) -> bool:
    """Tell whether a place is within the walls at z, from which no straight way leads out."""
    return bool(point[0 if z % 2 == 0 else 1] < 2.5 and z < 5)


def choices(problem: OrderProblem, c: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Where a contour may be entered, and where it is left then."""
    seams, ends = problem.seams, (problem.start[c], problem.end[c])
    if seams is not None and seams.offsets[c + 1] > seams.offsets[c] + 1:
        mine = range(seams.offsets[c], seams.offsets[c + 1])
        return [(seams.enter[o], seams.leave[o]) for o in mine]
    return [ends, ends[::-1]] if problem.reversible[c] else [ends]


def price(problem: OrderProblem, a: np.ndarray, b: np.ndarray) -> float:
    """What a travel costs: mm, or seconds for a trapezoid across and one upright."""
    if problem.pace is None:
        return float(np.linalg.norm(a - b))
    pace, seconds = problem.pace, 0.0
    over = any(is_inside(a, z) != is_inside(b, z) for z in (a[2], b[2]))
    level, rise = float(np.hypot(*(a - b)[:2])), abs(float(a[2] - b[2]))
    for way, speed, rate, share in (
        (level, pace.speed, pace.acceleration, 1.0 + pace.over * over),
        (rise, pace.z_speed, pace.z_acceleration, 1.0),
    ):
        ramps = min(way, speed**2 / rate)
        seconds += share * (2.0 * np.sqrt(ramps / rate) + (way - ramps) / speed)
    inside = all(is_inside(p, z) for p in (a, b) for z in (a[2], b[2]))
    bare = inside and level <= pace.bare_mm and a[2] <= b[2] <= a[2] + pace.climb_mm
    return float(seconds + (pace.hop_s if level + rise > pace.free_mm and not bare else 0.0))


def found(problem: OrderProblem, seed: int, iterations: int = 3000) -> Sequence:
    """A sequence that a short search ends with."""
    result = plan_order(
        problem, planner="local", stopping=Stopping(iterations=iterations), seed=seed
    )
    n, order = len(problem), result.toolpath.order
    is_reversed, entry_id = np.zeros(n, np.uint8), np.full(n, -1, np.int32)
    is_reversed[order] = result.toolpath.reversed
    if problem.seams is not None:
        chosen = order[np.diff(problem.seams.offsets)[order] > 1]
        entry = np.zeros(n, np.int64)
        entry[order] = result.toolpath.entry
        entry_id[chosen] = problem.seams.offsets[chosen] + entry[chosen]
    return Sequence(
        problem, problem.metric(), near_ports(problem), order.copy(), is_reversed, entry_id
    )


def varied(seed: int) -> OrderProblem:
    """Points, loops or seconds, in turn."""
    problem = random_problem(seed, 60, density=0.03)
    problem = with_loops(problem, seed) if seed % 3 == 1 else problem
    return with_pace(problem) if seed % 3 == 2 else problem


def tour_cost(metric: Metric, order: np.ndarray, is_reversed: np.ndarray) -> float:
    """What the travels of a sequence cost together, all contours entered at their ports."""
    return visits_cost(metric, order, is_reversed, np.full(len(order), -1, np.int32))
