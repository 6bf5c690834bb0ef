"""Travels that go round outer walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.geometry.walls import over_walls
from decmcts.print.contours import Contours
from decmcts.print.detours import Detours
from decmcts.print.walls import outer_walls
from tests.print.test_walls import loops

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
