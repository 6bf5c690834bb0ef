"""Safe travel against the exact definition."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.graph import DependencyGraph
from decmcts.feasibility.packed_head import pack_head
from decmcts.print.contours import Contours
from decmcts.print.machine import Head
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.routes_kernels import HeightField
from decmcts.team.schedule.travels import new_height_field
from tests.feasibility.travels import (
    deposit_contour,
    safe_travel_path,
    toolpath_heights,
    travel_height,
)

CLEARANCE_MM = 0.3


def random_extension(graph: DependencyGraph, seed: int) -> list[int]:
    """Return a random order that keeps the graph."""
    rng = np.random.default_rng(seed)
    waiting = np.diff(graph.pred_offsets).copy()
    ready = np.flatnonzero(waiting == 0).tolist()
    order = []
    while ready:
        a = ready.pop(int(rng.integers(len(ready))))
        order.append(a)
        for b in graph.succs[graph.succ_offsets[a] : graph.succ_offsets[a + 1]]:
            waiting[b] -= 1
            if waiting[b] == 0:
                ready.append(int(b))
    return order


def full_field(contours: Contours, cell_mm: float = 0.5) -> HeightField:
    field = new_height_field(contours, clearance_mm=CLEARANCE_MM, cell_mm=cell_mm)
    for i in range(len(contours)):
        deposit_contour(field, contours, i, clearance_mm=CLEARANCE_MM)
    return field


def exact_height(
    oracle: Any, contours: Contours, head: Head, move: NDArray[np.float64], extra: float
) -> float:
    """Return the lowest safe z by the definition, beads widened by `extra` more."""
    needed = -np.inf
    for i in range(len(contours)):
        radius = CLEARANCE_MM + contours.width[i] / 2 + extra
        for bead in oracle.segments(contours, i):
            for part in head.slices:
                z = bead[:, 2].max() - part.height_mm
                flat = oracle.head_of((-1e6, list(part.polygons)))
                if z > needed and oracle.hits(move, bead, flat, radius):
                    needed = z
    return float(needed)


@pytest.mark.slow
@pytest.mark.parametrize("head", ["box", "lopsided", "hollow"])
def test_height_is_between_exact_and_a_cell_more(oracle: Any, head: str) -> None:
    """Never lower than the definition (a crash), never much higher (lost time)."""
    contours = oracle.random_print(1, n_layers=6, per_layer=2, span=60.0)
    field = full_field(contours)
    packed = pack_head(oracle.heads[head])
    rng = np.random.default_rng(0)
    for start, end in rng.uniform(-15.0, 75.0, (60, 2, 2)):
        move = np.zeros((2, 3))
        move[:, :2] = start, end
        z = travel_height(field, packed, *start, *end)
        assert z >= exact_height(oracle, contours, oracle.heads[head], move, -1e-9)
        # a touched cell is at most 1.5 diagonals from the bead, and the slice one more
        assert z <= exact_height(oracle, contours, oracle.heads[head], move, 2.5 * 0.7072 * 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("head", ["box", "lopsided", "hollow"])
@pytest.mark.parametrize("seed", [1, 3])
def test_no_part_of_a_routed_print_is_blocked(oracle: Any, head: str, seed: int) -> None:
    """The promise itself: whatever the order, no travel ever meets printed material."""
    contours = oracle.random_print(seed, n_layers=6, per_layer=4)
    shape = oracle.heads[head]
    graph = build_graph(contours, [shape], clearance_mm=CLEARANCE_MM)
    field = new_height_field(contours, clearance_mm=CLEARANCE_MM)
    order = random_extension(graph, seed)
    printed: list[int] = []
    for a, b in pairwise(order):
        deposit_contour(field, contours, a, clearance_mm=CLEARANCE_MM)
        printed.append(a)
        path = safe_travel_path(
            field, pack_head(shape), contours.end[a], contours.start[b], lift_mm=0.2
        )
        np.testing.assert_array_equal(path[[0, -1]], [contours.end[a], contours.start[b]])
        for leg in (path[k : k + 2] for k in range(len(path) - 1)):
            for i in printed:
                radius = CLEARANCE_MM + contours.width[i] / 2 - 1e-9
                for bead in oracle.segments(contours, i):
                    assert not oracle.hits(leg, bead, shape, radius)


@pytest.mark.slow
def test_single_long_bead_is_exact_to_a_cell(oracle: Any) -> None:
    """Steep, flat and diagonal beads fill every cell they touch and few others."""
    rng = np.random.default_rng(3)
    needle = oracle.head_of((0.0, [oracle.box(-1e-3, -1e-3, 1e-3, 1e-3)]))
    packed = pack_head(needle)
    for _ in range(30):
        bead = rng.uniform(0.0, 60.0, (2, 3))
        bead[:, 2] = 5.0
        contours = oracle.make_contours([bead.tolist()])
        field = full_field(contours)
        for start, end in rng.uniform(-5.0, 65.0, (60, 2, 2)):
            move = np.zeros((2, 3))
            move[:, :2] = start, end
            blocked = travel_height(field, packed, *start, *end) == 5.0
            if oracle.hits(move, bead, needle, CLEARANCE_MM + 0.2 - 1e-9):
                assert blocked
            if blocked:
                assert oracle.hits(move, bead, needle, CLEARANCE_MM + 0.2 + 2.5 * 0.7072 * 0.5)


@pytest.mark.parametrize("cell_mm", [0.25, 0.5, 2.0])
def test_just_beside_a_bead_is_blocked(oracle: Any, cell_mm: float) -> None:
    """A cell that a widened bead only grazes must still carry its height."""
    rng = np.random.default_rng(4)
    needle = pack_head(oracle.head_of((0.0, [oracle.box(-1e-6, -1e-6, 1e-6, 1e-6)])))
    radius = CLEARANCE_MM + 0.2 - 1e-9
    for _ in range(20):
        bead = rng.uniform(0.0, 60.0, (2, 3))
        field = full_field(oracle.make_contours([bead.tolist()]), cell_mm)
        along = (bead[1, :2] - bead[0, :2]) / np.linalg.norm(bead[1, :2] - bead[0, :2])
        for share, side in zip(rng.random(40), rng.choice([-1, 1], 40), strict=True):
            beside = bead[0, :2] + share * (bead[1, :2] - bead[0, :2])
            x, y = beside + side * radius * np.array([-along[1], along[0]])
            assert travel_height(field, needle, x, y, x, y) == bead[:, 2].max()


def two_walls(oracle: Any) -> Contours:
    """A wall 10 mm high at x = 0 and a first layer on both sides of it."""
    return oracle.make_contours(
        [
            [(-40, 0, 0.2), (-40, 5, 0.2)],
            [(40, 0, 0.2), (40, 5, 0.2)],
            [(0, -9, 10.0), (0, 9, 10.0)],
        ]
    )


def test_travel_over_a_wall(oracle: Any) -> None:
    """Up, across the wall with the machine's lift, down."""
    contours = two_walls(oracle)
    path = safe_travel_path(
        full_field(contours),
        pack_head(oracle.heads["box"]),
        contours.end[0],
        contours.start[1],
        lift_mm=0.5,
    )
    np.testing.assert_allclose(path, [(-40, 5, 0.2), (-40, 5, 10.5), (40, 0, 10.5), (40, 0, 0.2)])


def test_high_slice_passes_under_nothing(oracle: Any) -> None:
    """A slice 8 mm above the tip clears a 10 mm wall at 2 mm already."""
    contours = two_walls(oracle)
    head = pack_head(oracle.head_of((8.0, [oracle.box(-3, -3, 3, 3)])))
    assert travel_height(full_field(contours), head, -40, 0, 40, 0) == pytest.approx(2.0)


def test_level_travel_is_two_points(oracle: Any) -> None:
    """Material at the nozzle's own height does not block: within a layer nothing lifts."""
    contours = oracle.make_contours([[(0, y, 0.2), (9, y, 0.2)] for y in range(9)])
    path = safe_travel_path(
        full_field(contours),
        pack_head(oracle.heads["box"]),
        contours.end[0],
        contours.start[8],
        lift_mm=0.5,
    )
    np.testing.assert_array_equal(path, [contours.end[0], contours.start[8]])


@pytest.mark.parametrize(("start_z", "end_z", "turn"), [(1.0, 3.0, 0), (3.0, 1.0, 1)])
def test_change_of_height_goes_at_the_higher_end(
    oracle: Any, start_z: float, end_z: float, turn: int
) -> None:
    """Without an obstacle the travel is still level: a ramp could meet the lower layer."""
    field = full_field(oracle.make_contours([[(0, 0, 0.2), (1, 0, 0.2)]]))
    ends = np.array([[0.0, 0.0, start_z], [20.0, 0.0, end_z]])
    path = safe_travel_path(field, pack_head(oracle.heads["box"]), *ends, lift_mm=0.5)
    assert path.tolist() == [ends[0].tolist(), [*ends[turn, :2].tolist(), 3.0], ends[1].tolist()]


def test_standing_still_never_lifts(oracle: Any) -> None:
    """A travel of no length stays, whatever stands beside; one straight up goes straight up."""
    field = full_field(two_walls(oracle))
    point = np.array([1.0, 0.0, 0.2])
    head = pack_head(oracle.heads["box"])
    assert safe_travel_path(field, head, point, point, lift_mm=1.0).shape == (2, 3)
    up = point + np.array([0.0, 0.0, 5.0])
    np.testing.assert_array_equal(
        safe_travel_path(field, head, point, up, lift_mm=1.0), [point, up]
    )


def test_empty_field_needs_nothing(oracle: Any) -> None:
    """Before the first contour every travel is free, also far outside the print."""
    for contours in (two_walls(oracle), oracle.make_contours([])):
        field = new_height_field(contours, clearance_mm=0.0)
        head = pack_head(oracle.heads["box"])
        assert travel_height(field, head, -999, 0, 999, 0) == -np.inf


def test_toolpath_heights_follow_the_order(oracle: Any) -> None:
    """What is not printed yet does not lift a travel."""
    contours = two_walls(oracle)
    nothing = np.zeros(3, np.bool_)
    early = toolpath_heights(
        contours,
        Toolpath.of(np.array([0, 1, 2]), nothing),
        oracle.heads["box"],
        clearance_mm=0.0,
    )
    np.testing.assert_allclose(early, [0.2, 10.0])
    late = toolpath_heights(
        contours,
        Toolpath.of(np.array([2, 0, 1]), nothing),
        oracle.heads["box"],
        clearance_mm=0.0,
    )
    np.testing.assert_allclose(late, [10.0, 10.0])


def test_cell_size_must_be_positive(oracle: Any) -> None:
    """A zero cell would never end."""
    with pytest.raises(ValueError, match=r"cell_mm is 0\.0"):
        new_height_field(two_walls(oracle), clearance_mm=0.0, cell_mm=0.0)


def test_concave_slice_is_refused(oracle: Any) -> None:
    """Kernels trust their polygons; the front must not."""
    notch = np.array([[0.0, 0.0], [9.0, 0.0], [1.0, 1.0], [0.0, 9.0]])
    for polygon in (notch, oracle.box(-1, -1, 1, 1)[::-1]):
        with pytest.raises(ValueError, match="convex and counter-clockwise"):
            pack_head(oracle.head_of((0.0, [polygon])))
