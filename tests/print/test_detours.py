"""Travels that go round outer walls."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.detours import Detours, over_walls_mm
from decmcts.print.detours_kernels import BESIDE_MM
from decmcts.print.walls import outer_walls
from decmcts.print.walls_kernels import over_walls
from tests.print.test_walls import concatenated, loops

LEVEL_MM = 0.2


def plate_with_hole() -> Contours:
    """Return the outer walls of a plate of 40 mm with a square hole of 10 mm."""
    outer = [(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)]
    hole = [(15.0, 15.0), (15.0, 25.0), (25.0, 25.0), (25.0, 15.0)]
    return loops(outer, hole, z=LEVEL_MM)


def way(start: tuple[float, float], goal: tuple[float, float]) -> NDArray[np.float64]:
    contours = plate_with_hole()
    a, b = (np.array([[x, y, LEVEL_MM]]) for x, y in (start, goal))
    bends, offsets = Detours.of(contours, 4.0).bends(a, b)
    corners = np.concatenate([a[:, :2], bends[offsets[0] : offsets[1]], b[:, :2]])
    return np.column_stack([corners, np.full(len(corners), LEVEL_MM)])


def test_a_travel_over_a_hole_goes_round_it_and_is_no_longer_than_it_must() -> None:
    """No leg crosses a wall, and the way is within a millimetre of the shortest."""
    found = way((10.0, 19.0), (30.0, 19.0))
    assert not over_walls(outer_walls(plate_with_hole()), found[:-1].copy(), found[1:].copy()).any()
    shortest = 2.0 * np.hypot(5.0, 4.0) + 10.0
    assert shortest < np.linalg.norm(np.diff(found, axis=0), axis=1).sum() < shortest + 1.0


def test_a_travel_inside_stays_straight() -> None:
    """What crosses no wall has no bends."""
    assert len(way((2.0, 2.0), (38.0, 2.0))) == 2


def test_walls_crossed_but_once_are_crossed_upright() -> None:
    """From island to island no way keeps off walls: each is crossed by a leg of 0.6 mm."""
    one = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    two = [(20.0, 0.0), (30.0, 0.0), (30.0, 10.0), (20.0, 10.0)]
    ways = Detours.of(loops(one, two, z=LEVEL_MM), 4.0)
    a, b = np.array([[5.0, 2.0, LEVEL_MM]]), np.array([[25.0, 8.0, LEVEL_MM]])
    bends, _ = ways.bends(a, b)
    assert ways.over_walls_mm(a, b) == pytest.approx(2.0 * 2.0 * BESIDE_MM)
    corners = np.concatenate([a[:, :2], bends, b[:, :2]])
    length = np.hypot(*np.diff(corners, axis=0).T).sum()
    assert length == pytest.approx(np.hypot(20.0, 6.0), abs=0.3)


def hole_in_two(whole: Contours) -> Contours:
    """Return the plate with the wall of its hole as two contours, one where the other ends."""
    cut = int(whole.offsets[1]) + 2
    values = {}
    for field in fields(Contours):
        given = getattr(whole, field.name)
        if given is None:
            continue  # no piece of a cut print
        at = cut if len(given) == len(whole.points) else 1
        values[field.name] = np.insert(given, at + 1, given[at], axis=0)
    values["points"][cut + 1, 1] += 0.05
    values["offsets"] = np.array([0, whole.offsets[1], cut + 1, whole.offsets[2] + 1])
    values["closed"] = np.array([True, False, False])
    return Contours(**values)


def test_walls_printed_in_pieces_are_gone_round_too() -> None:
    """A hole whose wall has gaps of a tenth of a millimetre is one loop."""
    pieces = hole_in_two(plate_with_hole())
    ways = Detours.of(pieces, 4.0)
    assert len(ways.loops.length) == 2
    a, b = np.array([[10.0, 19.0, LEVEL_MM]]), np.array([[30.0, 19.0, LEVEL_MM]])
    assert ways.over_walls_mm(a, b) == 0.0


def test_no_price_no_bends() -> None:
    """Where walls cost nothing travels go straight over them."""
    ways = Detours.of(plate_with_hole(), 0.0)
    a, b = np.array([[10.0, 19.0, LEVEL_MM]]), np.array([[30.0, 19.0, LEVEL_MM]])
    bends, _ = ways.bends(a, b)
    assert len(bends) == 0 and ways.over_walls_mm(a, b) == pytest.approx(20.0)


def test_a_way_that_would_leave_the_reach_is_not_taken() -> None:
    """Round a bar as high as the bed there is no way; the travel goes straight over it."""
    bar = [(10.0, 0.0), (12.0, 0.0), (12.0, 30.0), (10.0, 30.0)]
    ways = Detours.of(loops(bar, z=LEVEL_MM), 4.0)
    a, b = np.array([[5.0, 15.0, LEVEL_MM]]), np.array([[17.0, 15.0, LEVEL_MM]])
    assert ways.over_walls_mm(a, b) == 0.0
    edge = replace(ways, reach=(0.0, 0.0, 100.0, 30.0))
    assert len(edge.bends(a, b)[0]) == 0
    assert edge.over_walls_mm(a, b) == pytest.approx(12.0)


def test_ways_written_with_two_decimals_cross_no_more_walls() -> None:
    """They keep a little off walls, so rounding leads none over them."""
    turn = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    hole = [(20.0 + 7.0 * np.cos(t), 20.0 + 7.0 * np.sin(t)) for t in turn]
    ways = Detours.of(loops([(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)], hole), 4.0)
    rng = np.random.default_rng(0)
    angle = rng.uniform(0.0, 2.0 * np.pi, 200)
    across = angle + rng.uniform(0.7, 1.3, 200) * np.pi
    level = np.full(200, 0.2)
    a, b = (
        np.column_stack([20.0 + 9.0 * np.cos(t), 20.0 + 9.0 * np.sin(t), level]).round(2)
        for t in (angle, across)
    )
    bends, offsets = ways.bends(a, b)
    assert len(bends) > 100
    assert over_walls_mm(ways.walls, a, b, bends, offsets) == 0.0
    assert over_walls_mm(ways.walls, a, b, bends.round(2), offsets) == 0.0


def test_walls_of_two_layers_are_not_one_loop() -> None:
    """Half rings of which each begins above where the last ended: no loops at all."""
    low = loops([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)], z=0.2)
    high = loops([(10.0, 10.0), (10.0, 0.0), (0.0, 0.0)], z=0.4)
    both = []
    for each in (low, high):  # without the point that ends a loop
        values = {"points": each.points[:3], "extrusion": each.extrusion[:3], "feed": each.feed[:3]}
        both.append(replace(each, **values, offsets=np.array([0, 3]), closed=np.array([False])))
    assert len(Detours.of(concatenated(*both), 4.0).loops.length) == 0
