"""FCL behind its wrapper: sweeps are exact and contacts are not missed."""

from __future__ import annotations

import numpy as np
import pytest

from sim.replay.shapes import Part, Solid, swept_vertices


def box_vertices(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the eight corners of an axis-aligned box."""
    x, y, z = zip(low, high, strict=True)
    return np.array([[a, b, c] for a in x for b in y for c in z], np.float64)


CUBE = box_vertices(np.full(3, -20.0), np.full(3, 20.0))


def test_boxes_driven_head_on_are_found():
    """FCL's continuousCollide says "no contact" here; our sweep must not."""
    left = Solid(swept_vertices(CUBE, np.array([-100.0, 0, 0]), np.array([0.0, 0, 0])))
    right = Solid(swept_vertices(CUBE, np.array([100.0, 0, 0]), np.array([0.0, 0, 0])))
    assert left.touches(right)
    assert left.distance(right) == 0.0


def test_boxes_that_pass_through_each_other_are_found():
    """Start and end are clear of each other; only the sweep between them meets."""
    mover = Solid(swept_vertices(CUBE, np.array([-100.0, 0, 0]), np.array([100.0, 0, 0])))
    assert mover.touches(Solid(CUBE * 0.01))


@pytest.mark.parametrize("gap", [1e-6, 1e-3, 1.0, 250.0])
def test_distance_is_exact_between_long_bodies(gap):
    """A clearance of 1 mm is judged to a millionth on bodies half a metre long."""
    beam = box_vertices(np.array([-10.0, -300, 0]), np.array([10.0, 300, 500]))
    other = Solid(beam + np.array([20.0 + gap, 7.0, 3.0]))
    assert Solid(beam).distance(other) == pytest.approx(gap, abs=1e-9)


def test_standing_still_sweeps_the_shape_itself():
    """A head at rest still fills its own space."""
    here = np.array([5.0, 6.0, 7.0])
    np.testing.assert_array_equal(swept_vertices(CUBE, here, here), CUBE + here)


def test_a_sweep_covers_every_position_on_the_way():
    """The swept hull of a skew prism contains the prism anywhere along the move."""
    rng = np.random.default_rng(1)
    prism = Part("", np.array([[0.0, 0], [9, 1], [4, 8]]), 2.0, 30.0).vertices()
    start, end = rng.normal(size=3) * 20, rng.normal(size=3) * 20
    sweep = Solid(swept_vertices(prism, start, end))
    for t in np.linspace(0, 1, 7):
        assert sweep.touches(
            Solid(0.99 * prism + 0.01 * prism.mean(axis=0) + start + t * (end - start))
        )
