"""Distances of convex polygons, compared with another library's."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from sim.replay.gaps import polygon_gap


def polygon(rng: np.random.Generator, corners: int) -> np.ndarray:
    """Return a convex polygon with at most so many corners, run one way or the other."""
    spread, middle = rng.uniform(0.1, 4.0), rng.uniform(-4.0, 4.0, 2)
    points = shapely.MultiPoint(rng.normal(middle, spread, (corners, 2))).convex_hull
    return shapely.get_coordinates(points)[:-1][:: int(rng.choice([-1, 1]))].copy()


def test_gaps_are_those_of_shapely():
    """Least clearances are stated in mm, so every one has to be right, overlaps included."""
    rng, met = np.random.default_rng(0), 0
    for _ in range(400):
        a, b = polygon(rng, int(rng.integers(3, 9))), polygon(rng, int(rng.integers(3, 9)))
        due = shapely.Polygon(a).distance(shapely.Polygon(b))
        assert polygon_gap(a, len(a), b, len(b)) == pytest.approx(due, abs=1e-12)
        met += due == 0.0
    assert 50 < met < 350


@pytest.mark.parametrize(
    ("flat", "due"),
    [
        ([[3.0, 0.5]] * 4, 2.0),  # both stand still
        ([[3.0, 0.5], [9.0, 0.5], [9.0, 0.5], [3.0, 0.5]], 2.0),  # one moves
        ([[0.5, 0.5]] * 4, 0.0),
        ([[-1.0, 0.5], [2.0, 0.5], [2.0, 0.5], [-1.0, 0.5]], 0.0),  # right through
        ([[1.0, 0.5]] * 4, 0.0),  # on the edge
    ],
)
def test_polygons_without_area_have_distances_too(flat, due):
    """Seen from a nozzle that stands still, another one runs along a line, or not at all."""
    square, points = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), np.array(flat)
    assert polygon_gap(points, 4, square, 4) == due
    assert polygon_gap(square, 4, points, 4) == due
