"""Windows only one head fits into: sizes, sums, and no plan that is faster."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
import shapely.affinity

from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.machine import Head, Machine, Slice
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.bounds.window_bound import CELL_MM, window_bound, window_of
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.joint_plan import schedule
from tests.makers.random_teams import KINDS, problem_of, random_plans


def strokes(*places: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """A stroke of 10 mm along x from each place, 5 s each."""
    points = [(x + d, y, 0.2) for x, y in places for d in (0.0, 10.0)]
    return np.array(points), np.tile([0.0, 5.0], len(places))


@pytest.mark.parametrize(
    ("size", "most"),
    [((15.0, 15.0), 5.0), ((65.0, 5.0), 10.0), ((65.0, 45.0), 15.0), ((np.inf, np.inf), 15.0)],
)
def test_the_window_with_most_work_counts(size: tuple[float, float], most: float) -> None:
    """Cells may take a little off, never add."""
    points, seconds = strokes((0.0, 0.0), (50.0, 0.0), (50.0, 40.0))
    found = window_bound(points, seconds, np.array(size))
    assert 0.98 * most <= found <= most + 1e-9


def test_a_window_smaller_than_a_stroke_takes_its_share() -> None:
    """Time in the window, not whole contours."""
    points, seconds = strokes((0.0, 0.0))
    found = window_bound(points, seconds, np.array([6.0, 6.0]))
    assert 5.0 * (6.0 - 2 * CELL_MM) / 10.0 <= found <= 3.0


def test_a_presets_window_is_what_its_heads_keep_apart() -> None:
    """One rail: its separation, however long; gantries: the box of both heads and round corners."""
    assert window_of(load_machine("dual-gantry"), 30.0) == pytest.approx([70.0, np.inf], abs=0.01)
    zero = load_machine("dueling-zero")
    corner = window_of(zero, 30.0) - np.array([40.0, 53.0])
    assert np.hypot(*corner) == pytest.approx(zero.head_clearance_mm, abs=0.01)
    assert (corner > 0.0).all()


def _heads(outline: np.ndarray, gap: float) -> Machine:
    """Two heads of one slice each, free of each other."""
    head = Head("a", (Slice(0.0, (outline,)),))
    return Machine("two", (0.0, 0.0), (200.0, 200.0), (head, replace(head, name="b")),
                   head_clearance_mm=gap)  # fmt: skip


@pytest.mark.parametrize("corners", [3, 4, 5, 6, 16])
def test_no_two_places_of_a_window_are_clear_of_each_other(corners: int) -> None:
    """Round heads stand diagonally where their boxes would meet."""
    turn = 2.0 * np.pi * (np.arange(corners) + 0.2) / corners
    outline = 20.0 * np.column_stack([np.cos(turn), np.sin(turn)])
    size = window_of(_heads(outline, 1.0), 30.0)
    shape = shapely.Polygon(outline)
    apart = [
        shape.distance(shapely.affinity.translate(shape, *(size * way)))
        for way in [(1, 1), (1, -1), (-1, 1), (-1, -1), (1, 0), (0, 1)]
    ]
    assert max(apart) < 1.0
    assert size.prod() > 0.3 * np.ptp(outline, axis=0).prod()


def test_squares_without_a_gap_hold_their_whole_box() -> None:
    """What is rectangular is no smaller than before."""
    outline = np.array([[-8.0, -4.0], [8.0, -4.0], [8.0, 4.0], [-8.0, 4.0]])
    assert window_of(_heads(outline, 0.0), 30.0) == pytest.approx([16.0, 8.0], abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_no_plan_on_a_random_machine_is_faster_than_the_bound(seed: int) -> None:
    """Rails or none, two to eight heads, sensible and hostile plans."""
    try:
        problem = problem_of(seed)
    except InputError:
        pytest.skip("this machine prints nothing of its print")
    bound = makespan_bound(problem.job, problem.machine, problem.graph)
    rng = np.random.default_rng(seed)
    for kind in KINDS:
        found = resolve(
            problem, random_plans(problem, rng, kind), range(len(problem.machine.heads))
        )
        plan = schedule(problem.job, problem.machine, problem.graph, found.toolpaths)
        assert bound.bound_s <= plan.makespan_s
