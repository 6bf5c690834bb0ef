"""What two heads without a rail can print at once: the matching, its proof, and no faster plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from decmcts.formats.machines.machine_file import load_machine
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.bounds.pair_bound import cover_prices, pair_bound
from decmcts.team.bounds.rail_bound import RailUse
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.joint_plan import schedule
from tests.makers.random_teams import KINDS, problem_on, random_plans

ZERO = load_machine("dueling-zero")


@pytest.mark.parametrize("seed", range(8))
def test_prices_prove_the_largest_fractional_matching(seed: int) -> None:
    """As a linear programme finds it, pairs listed one by one."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 12))
    clear = rng.random((n, n)) < rng.uniform(0.05, 0.6)
    clear |= clear.T
    work = rng.uniform(0.1, 5.0, n)
    edges = np.argwhere(np.triu(clear))
    shared = 0.0
    if len(edges):
        taken = np.zeros((n, len(edges)))
        for k, (i, j) in enumerate(edges):
            taken[i, k] += 1.0
            taken[j, k] += 1.0
        shared = -float(linprog(-np.ones(len(edges)), A_ub=taken, b_ub=work).fun)
    prices = cover_prices(clear, work)
    assert float(work @ prices) == pytest.approx(shared, rel=1e-6)
    assert (prices[:, None] + prices[None, :] >= 1.0)[clear].all()


def stroke(x: float, seconds: float, way: int) -> tuple[list[float], list[float], float, int]:
    """A stroke of 2 mm along x at y = 80."""
    return [x, 80.0], [x + 2.0, 80.0], seconds, way


def area(
    low: np.ndarray, high: np.ndarray, seconds: np.ndarray, way: np.ndarray
) -> tuple[RailUse, RailUse]:
    """The same pieces along x and along y, corners (k, 2)."""
    x, y = (RailUse(low[:, axis], high[:, axis], seconds, way) for axis in (0, 1))
    return x, y


def held(*strokes: tuple[list[float], list[float], float, int]) -> tuple[RailUse, RailUse]:
    """What heads hold, stroke by stroke."""
    low, high, seconds, way = zip(*strokes, strict=True)
    return area(np.array(low), np.array(high), np.array(seconds), np.array(way))


@pytest.mark.parametrize(("other", "wanted"), [(40.0, 7.0), (120.0, 4.0)])
def test_work_in_one_place_is_serial(other: float, wanted: float) -> None:
    """Tool heads of 40 mm: side by side or one after the other."""
    found = pair_bound(*held(stroke(20.0, 3.0, 0), stroke(other, 4.0, 2)), ZERO, height_mm=1.0)
    assert found == pytest.approx(wanted)


def test_the_way_that_is_worth_less_counts() -> None:
    """A contour that may end near the other or far from it is run so that it ends far from it."""
    there = [([20.0, 80.0], [70.0, 80.0], 1.0, 0), ([68.0, 80.0], [70.0, 80.0], 3.0, 0)]
    back = [([20.0, 80.0], [70.0, 80.0], 1.0, 1), ([20.0, 80.0], [22.0, 80.0], 3.0, 1)]
    other = stroke(90.0, 4.0, 2)
    one_way = pair_bound(*held(*there, other), ZERO, height_mm=1.0)
    both = pair_bound(*held(*there, *back, other), ZERO, height_mm=1.0)
    assert one_way == pytest.approx(8.0)
    assert 5.0 - 1e-9 <= both < 8.0


def test_spaces_are_rounded_so_that_heads_fit_more_easily() -> None:
    """Few different spaces are quicker to match and never raise the bound."""
    rng = np.random.default_rng(1)
    low = rng.uniform(10.0, 120.0, (300, 2))
    high, seconds = low + rng.uniform(1.0, 30.0, (300, 2)), rng.uniform(1, 9, 300)
    pieces = area(low, high, seconds, 2 * np.arange(300))
    fine = pair_bound(*pieces, ZERO, height_mm=1.0)
    coarse = pair_bound(*pieces, ZERO, height_mm=1.0, most_spaces=40)
    assert float(seconds.sum()) / 2 - 1e-6 <= coarse <= fine


def test_two_heads_without_a_rail_are_bound_by_it(case_of: Callable[..., Any]) -> None:
    """Strokes too near to print at once take the sum, whole or in pieces."""
    chosen = case_of([(60, 80, 0.2), (90, 80, 0.2)], [(60, 90, 0.2), (90, 90, 0.2)], machine=ZERO)
    for release in ("point", "action"):
        machine = replace(ZERO, release=release)
        bound = makespan_bound(chosen.job, machine, chosen.graph)
        assert bound.shared_s >= bound.serial_s * (1 - 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_no_plan_of_two_gantries_is_faster(seed: int) -> None:
    """Sensible and hostile plans, spaces whole and in pieces."""
    for release in ("point", "action"):
        problem = problem_on(replace(ZERO, release=release), seed)
        bound = makespan_bound(problem.job, problem.machine, problem.graph)
        rng = np.random.default_rng(seed)
        for kind in KINDS:
            found = resolve(problem, random_plans(problem, rng, kind), range(2))
            plan = schedule(problem.job, problem.machine, problem.graph, found.toolpaths)
            assert bound.bound_s <= min(plan.makespan_s, found.makespan_s)
