"""The makespan bound: a bound on every plan, and exact where that is easy to see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, pairwise, product
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.loops import enter_at
from decmcts.print.machine import Slice
from decmcts.print.seam import seam_entries
from decmcts.search.bounds.chains_kernels import chain_behind
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.bounds.rail_bound import RailUse, rail_bound
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.engine.space import build_space


def _listed(held: RailUse, gap: float, n: int) -> float:
    """The same programme with every set of pieces that n heads can print at once listed."""
    low, high, seconds, way, travels = held
    moves = np.zeros(len(low), np.bool_) if travels is None else travels
    prints = ~moves
    whole_low, whole_high = low.copy(), high.copy()
    for i in np.flatnonzero(prints):
        mine = prints & (way == way[i])
        whole_low[i], whole_high[i] = low[mine].min(), high[mine].max()

    def fits(i: int, j: int) -> bool:
        """One of two neighbours began later, with space for its whole contour."""
        return bool(high[i] + gap <= whole_low[j] or whole_high[i] + gap <= low[j])

    pieces = sorted(range(len(low)), key=lambda i: (low[i], high[i]))
    sets = [
        chosen
        for size in range(1, n + 1)
        for chosen in combinations(pieces, size)
        if all(fits(i, j) for i, j in pairwise(chosen))
    ]
    chosen_of = np.array([[float(i in chosen) for i in range(len(low))] for chosen in sets])
    return float(-linprog(-seconds, A_ub=chosen_of, b_ub=np.ones(len(sets))).fun)


@pytest.mark.parametrize("heads", [2, 3, 4])
@pytest.mark.parametrize("seed", range(5))
def test_the_programme_of_chains_is_that_of_all_sets(seed: int, heads: int) -> None:
    """Rounding to cells lets heads fit more easily, so it can only take a little away."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 100, 9)
    high, seconds = low + rng.uniform(0, 20, 9), rng.uniform(1, 5, 9)
    held = RailUse(low, high, seconds, 2 * np.arange(9))
    found = rail_bound(held, separation_mm=24.0, heads=heads)
    listed = _listed(held, 24.0, heads)
    assert 0.95 * listed <= found <= listed * (1 + 1e-9)


@pytest.mark.parametrize("heads", [2, 3])
@pytest.mark.parametrize("seed", range(8))
def test_pieces_stand_beside_whole_contours_only(seed: int, heads: int) -> None:
    """Four contours of up to three pieces each, which a head holds less and less of."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(4):
        low, high = rng.uniform(0, 60), rng.uniform(70, 120)
        for _ in range(int(rng.integers(1, 4))):
            rows.append((low, high, rng.uniform(1, 5), 2 * k))
            low, high = low + rng.uniform(0, 0.7) * (high - low), high
            if rng.random() < 0.5:
                low, high = rows[-1][0], rows[-1][0] + rows[-1][1] - low
    held = RailUse(*np.array(rows).T[:3], np.array([row[3] for row in rows]))
    found = rail_bound(held, separation_mm=30.0, heads=heads)
    listed = _listed(held, 30.0, heads)
    assert 0.95 * listed <= found <= listed * (1 + 1e-9)


@pytest.mark.parametrize("heads", [2, 3])
@pytest.mark.parametrize("seed", range(8))
def test_a_head_that_travels_stands_beside_what_is_left_of_a_contour(seed: int, heads: int) -> None:
    """Contours in two pieces each, and between them heads that are somewhere within some mm."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(4):
        low, high, reach = rng.uniform(0, 60), rng.uniform(70, 120), rng.uniform(0, 5, 2)
        rows.append((low, high, rng.uniform(1, 5), 2 * k, 0))
        rows.append((high - 10, high, rng.uniform(1, 5), 2 * k, 0))
        rows.append((low + reach[0], low - reach[0], rng.uniform(1, 3), 2 * k, 1))
        rows.append((high + reach[1], high - reach[1], rng.uniform(1, 3), 2 * k, 1))
    columns = np.array(rows).T
    held = RailUse(*columns[:3], columns[3].astype(np.int64), columns[4] > 0)
    found = rail_bound(held, separation_mm=30.0, heads=heads)
    listed = _listed(held, 30.0, heads)
    assert 0.94 * listed <= found <= listed * (1 + 1e-9)
    prints = RailUse(*(column[~held.travels] for column in held[:4]))
    assert rail_bound(prints, separation_mm=30.0, heads=heads) < found
    assert found <= rail_bound(held._replace(travels=None), separation_mm=30.0, heads=heads)


@pytest.mark.parametrize(("separation", "wanted"), [(0.0, 2.5), (0.05, 3.0), (70.0, 5.0)])
def test_work_in_one_place(separation: float, wanted: float) -> None:
    """As narrow as a point, or less: a loop entered anywhere may hold less than nothing."""
    held = RailUse(
        np.array([5.0, 5.1]), np.array([5.0, 5.0]), np.array([3.0, 2.0]), np.array([0, 2])
    )
    assert rail_bound(held, separation_mm=separation, heads=2) == pytest.approx(wanted)


def test_the_direction_that_is_worth_less_counts() -> None:
    """A contour that may be reversed is only worth what its cheaper direction is."""
    fixed = RailUse(
        *np.array([[0.0, 60.0, 0.0], [60.0, 60.0, 0.0], [5.0, 1.0, 9.0]]), np.array([0, 0, 2])
    )
    either = RailUse(
        np.append(fixed.low, 0.0), np.append(fixed.high, 0.0),
        np.append(fixed.seconds, 6.0), np.append(fixed.choice, 1),
    )  # fmt: skip
    bounds = [rail_bound(held, separation_mm=50.0, heads=2) for held in (fixed, either)]
    assert bounds[0] == pytest.approx(15.0 - 1.0, rel=0.02) and bounds[1] <= bounds[0] + 1e-9


def test_loops_entered_elsewhere_do_not_beat_the_bound(case_of: Callable[..., Any]) -> None:
    """Where a loop begins decides which side of it is given back first."""
    left = [(50, 10), (50, 50), (30, 50), (10, 50), (10, 10), (30, 10), (50, 10)]
    chosen = case_of([(x, y, 0.5) for x, y in left], [(110 - x, y, 0.5) for x, y in left])
    chosen = replace(chosen, machine=replace(chosen.machine, release="point"))
    entries = seam_entries(chosen.job.contours)
    rows = [range(*pair) for pair in pairwise(entries.offsets)]
    ways = [enter_at(chosen.job.contours, entries.vertices[list(row)]) for row in product(*rows)]
    jobs = [replace(chosen.job, contours=way) for way in ways]
    entered = [makespan_bound(job, chosen.machine, chosen.graph).bound_s for job in jobs]
    sliced = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert sliced.bound_s == pytest.approx(sliced.serial_s, rel=1e-5)
    assert min(entered) < 0.95 * sliced.bound_s
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph, entries=entries).bound_s
    assert bound <= min(entered) * (1 + 1e-9)


def test_a_gap_moved_to_a_spike_does_not_beat_the_bound(case_of: Callable[..., Any]) -> None:
    """Entered behind the spike the loop leaves it out, and both heads print at once."""
    loop = [
        (20, 10),
        (40, 10),
        (40, 20),
        (41.8, 20.01),
        (40, 20.02),
        (40, 40),
        (20, 40),
        (20, 13.8),
    ]
    stroke = [(64.1, 10), (64.1, 60)]
    chosen = case_of([(x, y, 0.5) for x, y in loop], [(x, y, 0.5) for x, y in stroke])
    contours = replace(
        chosen.job.contours,
        closed=np.array([True, False]),
        width=np.full(2, 4.0),
        extrusion=np.array([0, 20, 10, 1.8, 1.8, 19.98, 20, 26.2, 0, 50]) / 10,
    )
    entries = seam_entries(contours)
    assert 4 in entries.vertices
    jobs = [
        replace(chosen.job, contours=enter_at(contours, np.array([at, 0], np.int32)))
        for at in entries.vertices[:-1]
    ]
    entered = [makespan_bound(job, chosen.machine, chosen.graph).bound_s for job in jobs]
    assert min(entered) < 0.8 * entered[0]
    job = replace(chosen.job, contours=contours)
    bound = makespan_bound(job, chosen.machine, chosen.graph, entries=entries).bound_s
    assert bound <= min(entered) * (1 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_no_plan_is_faster_than_the_bound(case: Callable[..., Any], seed: int) -> None:
    """A bound that a plan beats would be a lie in every report."""
    chosen = case(seed, towers=8)
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert resolve(problem, {}, [0, 1]).makespan_s >= bound.bound_s
    assert 0.5 - 1e-5 <= bound.bound_s / bound.serial_s <= 1.0


def test_all_in_one_place_is_serial(case_of: Callable[..., Any]) -> None:
    """Contours that all conflict leave nothing to share."""
    chosen = case_of([(50, 10, 0.5), (60, 10, 0.5)], [(50, 20, 0.5), (60, 20, 0.5)])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert bound.bound_s == pytest.approx(bound.serial_s, rel=1e-5)


def test_far_apart_is_twice_as_fast(case_of: Callable[..., Any]) -> None:
    """Two equal strokes far apart take half the time."""
    chosen = case_of([(20, 10, 0.5), (30, 10, 0.5)], [(90, 20, 0.5), (100, 20, 0.5)])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert bound.bound_s == pytest.approx(bound.serial_s / 2.0, rel=1e-5)


def test_what_only_one_head_reaches_bounds_too(case_of: Callable[..., Any]) -> None:
    """Both strokes lie beyond the left head's reach: no help from it."""
    chosen = case_of([(111, 10, 0.5), (119, 10, 0.5)], [(111, 50, 0.5), (119, 50, 0.5)])
    bound = makespan_bound(chosen.job, chosen.machine, chosen.graph)
    assert bound.exclusive_s == pytest.approx(bound.serial_s)


def test_whom_only_boxes_keep_out_may_print_too(case_of: Callable[..., Any]) -> None:
    """By boxes the round head is in the way of one that rests; by exact shapes it is not."""
    chosen = case_of([(60, 10, 0.5), (64, 10, 0.5)], [(60, 12, 0.5), (64, 12, 0.5)])
    turn = 2.0 * np.pi * np.arange(16) / 16
    disc = (Slice(0.0, (20.0 * np.column_stack([np.cos(turn), np.sin(turn)]),)),)
    left, right = chosen.machine.heads
    rests = replace(
        right, name="rests", slices=disc, park=(96.0, 44.0, 5.0),
        reach_min=(96.0, 44.0, 0.0), reach_max=(96.0, 44.0, 50.0),
    )  # fmt: skip
    free = {"reach_min": (0.0, -80.0, 0.0), "park": (60.0, -60.0, 5.0)}
    heads = (replace(left, slices=disc), replace(right, **free), rests)
    machine = replace(chosen.machine, heads=heads, rails=())
    assert build_space(chosen.job, machine).eligible.tolist() == [[False, True, False]] * 2
    assert makespan_bound(chosen.job, machine, chosen.graph).exclusive_s == 0.0


def test_chain_behind() -> None:
    """A chain bounds whatever the heads do; the chain behind steers who goes first."""
    graph = DependencyGraph.from_pairs(5, np.array([[0, 1], [1, 3], [0, 2], [2, 3]]))
    seconds = np.array([1.0, 5.0, 2.0, 4.0, 7.0])
    behind = chain_behind(seconds, graph.succ_offsets, graph.succs)
    assert behind.tolist() == [10.0, 9.0, 6.0, 4.0, 7.0]
