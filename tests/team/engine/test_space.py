"""The space heads need, against boxes moved by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.feasibility.digest import problem_digest
from decmcts.formats.machines.machine_file import load_machine, rail_machine
from decmcts.print.lags_kernels import no_lags
from decmcts.print.machine import Body, Head, Machine, Rail
from decmcts.print.machine_fit import require_printable
from decmcts.print.plan import PlanDocument
from decmcts.team.dec_mcts.warm_up import smallest_job
from decmcts.team.engine.aside_kernels import path_from_parks
from decmcts.team.engine.carry_out_kernels import eligible_heads
from decmcts.team.engine.joint_kernels import Visits
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.engine.space import body_boxes, build_space, fleet_of, whole_pieces
from decmcts.team.engine.spaces_kernels import cut_pieces, too_near
from decmcts.team.schedule.joint_plan import schedule
from sim.verify import verify_plan


@pytest.fixture
def loose(case: Callable[..., Any]) -> Machine:
    """The pair without its rail, with uneven bodies."""
    machine = case(0).machine
    heads = (
        replace(machine.heads[0], bodies=(Body("duct", (-12, -3, 5), (5, 4, 20)),)),
        replace(machine.heads[1], bodies=(Body("fan", (-6, -9, 5), (7, 15, 20)),)),
    )
    return replace(machine, heads=heads, rails=(), head_clearance_mm=2.0)


def near(machine: Machine, a: np.ndarray, b: np.ndarray, r: int = 0, s: int = 1) -> bool:
    """Whether head r in space a and head s in space b could meet."""
    return bool(too_near(a, b, r, s, fleet_of(smallest_job(), machine)))


@pytest.mark.parametrize("seed", range(5))
def test_clear_spaces_keep_bodies_apart(loose: Machine, seed: int) -> None:
    """Two spaces are clear just if no body or slice moved through one meets one in the other."""
    rng = np.random.default_rng(seed)
    boxes = [body_boxes(head) for head in loose.heads]
    for _ in range(200):
        spaces = np.sort(rng.uniform(0, 60, (2, 3, 2)), axis=2).reshape(2, 6)
        swept = [box + space for box, space in zip(boxes, spaces, strict=True)]
        low = np.maximum(swept[0][:, None, 0::2], swept[1][None, :, 0::2])
        high = np.minimum(swept[0][:, None, 1::2], swept[1][None, :, 1::2])
        meets = bool((low - high < 2.0).all(axis=2).any())
        assert near(loose, spaces[0], spaces[1]) == meets
        assert near(loose, spaces[1], spaces[0], 1, 0) == meets


def test_a_rail_keeps_the_order(case: Callable[..., Any]) -> None:
    """On a rail being apart the wrong way round is a conflict too."""
    machine = case(0).machine
    left, right = np.array([10.0, 20, 0, 5, 1, 1]), np.array([44.0, 50, 0, 5, 1, 1])
    assert not near(machine, left, right)
    assert near(machine, right, left)
    assert near(machine, left + np.array([0.1, 0.1, 0, 0, 0, 0]), right)


def test_wide_bodies_need_more_than_the_rail_says(case: Callable[..., Any]) -> None:
    """The larger of separation and bodies counts."""
    machine = case(0).machine
    wide = tuple(replace(h, bodies=(Body("beam", (-30, 0, 5), (30, 1, 9)),)) for h in machine.heads)
    machine = replace(machine, heads=wide, rails=(Rail(0, ("left", "right"), 24.0),))
    here = np.array([0.0, 0, 0, 0, 1, 1])
    assert near(machine, here, here + np.array([60.9, 60.9, 0, 0, 0, 0]))
    assert not near(machine, here, here + np.array([61.0, 61.0, 0, 0, 0, 0]))


def test_one_body_may_pass_below_another(case: Callable[..., Any]) -> None:
    """Heads are not taken to fill their outline at every height."""
    machine = case(0).machine
    low = Body("low", (-20, -20, 5), (20, 20, 8))
    high = Body("high", (-20, -20, 30), (20, 20, 40))
    heads = tuple(
        replace(h, slices=(), bodies=(body,))
        for h, body in zip(machine.heads, (low, high), strict=True)
    )
    machine = replace(machine, heads=heads, rails=())
    here = np.array([0.0, 0, 0, 0, 1, 1])
    assert not near(machine, here, here + np.array([10.0, 10, 0, 0, 0, 0]))
    assert near(machine, here, here + np.array([10.0, 10, 0, 0, -25, -25]))


def test_tools_and_space_limit_who_may_print(case_of: Callable[..., Any]) -> None:
    """A head without the tool may not, nor one that the others cannot make way for."""
    chosen = case_of([(50, 10, 0.5), (60, 10, 0.5)], [(100, 10, 0.5), (105, 10, 0.5)])
    heads = list(chosen.machine.heads)
    heads[1] = replace(heads[1], tools=(1,), park=(125.0, 30.0, 5.0))
    machine = replace(chosen.machine, heads=tuple(heads))
    eligible = build_space(chosen.job, machine).eligible
    assert eligible.tolist() == [[True, False], [False, False]]


def test_a_dead_head_stays_where_it_is(case_of: Callable[..., Any]) -> None:
    """A head parked in the way steps aside while it lives; dead it bars what is beyond."""
    chosen = case_of([(30, 10, 0.5), (35, 10, 0.5)], [(90, 10, 0.5), (94, 10, 0.5)])
    heads = list(chosen.machine.heads)
    heads[1] = replace(heads[1], park=(110.0, 30.0, 5.0))
    machine = replace(chosen.machine, heads=tuple(heads))
    assert build_space(chosen.job, machine).eligible[:, 0].all()
    assert build_space(chosen.job, machine, [0]).eligible[:, 0].tolist() == [True, False]


def test_one_head_has_no_one_in_its_way(case: Callable[..., Any]) -> None:
    """A machine of one head is the plain case of the same code."""
    chosen = case(0)
    alone = replace(chosen.machine, heads=chosen.machine.heads[:1], rails=())
    assert build_space(chosen.job, alone).eligible.all()


BOX = ((-20.0, -20.0, 8.0), (20.0, 20.0, 60.0))


def parked_left(case_of: Callable[..., Any], **reach: tuple[float, float, float]) -> Any:
    """Two heads without a rail, both parked left of a bed of 300 mm, and two far strokes."""
    shape = case_of([(50, 10, 0.5), (60, 10, 0.5)]).machine.heads[0].slices
    heads = tuple(
        Head(name, shape, bodies=(Body("body", *BOX),), park=(-60.0, y, 20.0), **reach)
        for name, y in (("a", 50.0), ("b", 110.0))
    )
    machine = Machine("beside", (0.0, 0.0), (300.0, 300.0), heads)
    return case_of(
        [(30, 110, 0.5), (40, 110, 0.5)], [(250, 50, 0.5), (260, 50, 0.5)], machine=machine
    )


@pytest.mark.parametrize("reach", [{}, {"reach_min": (-300.0,) * 3, "reach_max": (600.0,) * 3}])
def test_heads_step_aside_where_the_judge_lets_them(
    case_of: Callable[..., Any], reach: dict[str, Any]
) -> None:
    """Without a reach, or with a wide one, a head was sent beyond bed, print and its park."""
    chosen = parked_left(case_of, **reach)
    fleet = fleet_of(chosen.job, chosen.machine)
    assert fleet.low.tolist() == [[-60.0, 0.0], [-60.0, 0.0]]
    assert fleet.high.tolist() == [[300.0, 300.0], [300.0, 300.0]]
    problem = build_team_problem(chosen.job, chosen.machine, chosen.graph)
    paths = resolve(problem, {}, [0, 1]).toolpaths
    plan = schedule(chosen.job, chosen.machine, chosen.graph, paths)
    document = PlanDocument(
        problem_digest(chosen.job.contours, chosen.graph, chosen.machine),
        chosen.machine, chosen.job.contours, chosen.graph.pairs(), plan, {},
    )  # fmt: skip
    assert not verify_plan(document, source=chosen.job).faults


def test_the_print_and_the_park_are_within_the_limit(case_of: Callable[..., Any]) -> None:
    """A print beside the bed may be passed over; a reach that is narrower than that counts."""
    chosen = case_of([(-30, 10, 0.5), (40, 70, 0.5)])  # the bed is 120 x 60 mm
    fleet = fleet_of(chosen.job, chosen.machine)
    assert fleet.low.tolist() == [[-20.0, 0.0], [10.0, 0.0]]
    assert fleet.high.tolist() == [[110.0, 60.0], [140.0, 60.0]]
    free = replace(chosen.machine, heads=tuple(
        replace(head, reach_min=(-1e6,) * 3, reach_max=(1e6,) * 3) for head in chosen.machine.heads
    ))  # fmt: skip
    fleet = fleet_of(chosen.job, free)
    assert fleet.low.tolist() == [[-30.0, 0.0], [-30.0, 0.0]]
    assert fleet.high.tolist() == [[120.0, 70.0], [140.0, 70.0]]
    edge = replace(free, heads=tuple(
        replace(head, reach_min=(130.0, 0.0, 0.0)) for head in free.heads
    ))  # fmt: skip
    assert fleet_of(chosen.job, edge).low[1].tolist() == [130.0, 0.0]


def test_who_cannot_get_out_of_the_way_bars_it(case_of: Callable[..., Any]) -> None:
    """Eligible is who the others can make way for within the limit, not beyond it."""
    chosen = case_of([(105, 10, 0.5), (115, 10, 0.5)])
    wide = Body("beam", (-8.0, -400.0, 5.0), (8.0, 400.0, 9.0))
    heads = [replace(head, bodies=(wide,), reach_min=(-1e6,) * 3, reach_max=(1e6,) * 3)
             for head in chosen.machine.heads]  # fmt: skip
    heads[1] = replace(heads[1], park=(2.0, 30.0, 5.0))  # space is only beyond the bed
    machine = replace(chosen.machine, heads=tuple(heads), rails=())
    assert build_space(chosen.job, machine).eligible.tolist() == [[False, True]]


def test_why_no_head_can_print_is_said(case_of: Callable[..., Any]) -> None:
    """Heads whose shapes shut each other out have reach and tool; moving the print is no help."""
    chosen = case_of([(50, 10, 0.5), (60, 10, 0.5)], [(50, 70, 0.5), (60, 70, 0.5)])
    near = replace(chosen.machine, head_clearance_mm=1000.0)
    for machine, contour, why in (
        (chosen.machine, 1, "no head reaches it; move the print"),
        (near, 0, "the others cannot make way for left and right, which reach it; .*`slices`"),
    ):
        eligible = build_space(chosen.job, machine).eligible
        with pytest.raises(InputError, match=f"no head of '?pair'? .*contour {contour} .*: {why}"):
            require_printable(chosen.job.contours, machine, eligible, live=[0, 1])


def test_who_is_lost_is_no_reason_of_the_machine(case_of: Callable[..., Any]) -> None:
    """A head that was lost reaches and has the tool: that it is lost is the reason."""
    chosen = case_of([(2, 10, 0.5), (8, 10, 0.5)])
    eligible = build_space(chosen.job, chosen.machine, [1]).eligible
    with pytest.raises(InputError, match="only left could print it, which is lost"):
        require_printable(chosen.job.contours, chosen.machine, eligible, live=[1])
    with pytest.raises(InputError, match="or what could print it is lost"):  # it is not known
        require_printable(chosen.job.contours, chosen.machine, eligible)


def test_a_contour_as_one_piece_is_what_cutting_makes_of_it(case_of: Callable[..., Any]) -> None:
    """Asking who is let in needs no lengths; the kernel that cuts finds them all."""
    job = case_of([(50, 10, 0.5), (60, 10, 0.5), (40, 12, 0.5)], [(90, 10, 0.5), (95, 10, 1.5)]).job
    contours = replace(job.contours, reversible=np.array([True, False]))
    cut = cut_pieces(contours.points, contours.offsets, contours.reversible, 1.0, 1)
    for mine, wanted in zip(whole_pieces(contours), cut, strict=True):
        assert mine.dtype == wanted.dtype
        assert np.array_equal(mine, wanted)


@pytest.mark.parametrize("seed", range(8))
def test_on_a_rail_earlier_answers_tell_who_is_let_in(seed: int) -> None:
    """Where heads can hardly get out of the way: as if each contour were asked about alone."""
    rng = np.random.default_rng(seed)
    heads, n = int(rng.integers(2, 7)), 300
    machine = rail_machine(load_machine("dual-gantry"), heads, 150.0 * heads)
    start = rng.uniform([0, 0, 0.2], [150.0 * heads, 200, 40], (n, 3))
    end = start + rng.uniform(-60, 60, (n, 3)) * [1, 1, 0]
    points = np.stack([start, end], axis=1).reshape(-1, 3)
    offsets = np.arange(0, 2 * n + 1, 2, dtype=np.int64)
    reversible = np.ones(n, np.bool_)
    visits = Visits(
        points.reshape(n, 2, 3), np.zeros((heads, n)), reversible,
        cut_pieces(points, offsets, reversible, 1.0, 1), np.zeros(n + 1, np.int64),
        np.empty(0, np.int32), no_lags(n),
    )  # fmt: skip
    fleet = fleet_of(smallest_job(), machine)
    width = rng.uniform(0.1, 0.9) * 150.0
    fleet = fleet._replace(low=fleet.parks[:, :2] - width, high=fleet.parks[:, :2] + width)
    assert fleet.lined
    found = eligible_heads(np.ones((n, heads), np.bool_), visits, fleet)
    asked = [[path_from_parks(r, c, visits, fleet) for r in range(heads)] for c in range(n)]
    assert np.array_equal(found, asked)
    assert 0.0 < found.mean() < 1.0
