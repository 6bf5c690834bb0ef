"""Where contours are cut."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.print.cut_kernels import Stretches, cut_at_lines


def cut(points: list[tuple[float, float]], *lines: float) -> Stretches:
    """Cut one contour at lines along Y."""
    points = np.column_stack([np.array(points, np.float64), np.zeros(len(points))])
    whole = np.zeros(len(points), np.bool_)
    offsets, of = np.array([0, len(points)], np.int64), np.array([0, len(lines)], np.int64)
    return cut_at_lines(points, offsets, 0, np.array(lines, np.float64), of, whole, 0.4)


@pytest.mark.parametrize("at", [9.9999, 10.0, 10.0001])
def test_a_line_through_a_vertex_cuts_like_one_beside_it(at: float) -> None:
    """Neither of the two segments was taken to cross it, and the contour stayed whole."""
    for way in (1, -1):
        found = cut([(0.0, 0.0), (10.0, 0.0), (20.0, 0.0)][::way], at)
        assert found.begin.tolist() == [0.0, 1.0] and found.end.tolist() == [1.0, 2.0]


def test_a_circle_is_cut_in_its_middle() -> None:
    """Its highest and its lowest vertex lie there."""
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    circle = np.column_stack([150.0 + 20.0 * np.cos(angle), 20.0 * np.sin(angle)]).round(3)
    assert cut(circle.tolist(), 150.0).begin.tolist() == [0.0, 8.0, 24.0]


def test_a_contour_that_ends_on_a_line_or_runs_along_it_is_not_cut() -> None:
    """There is nothing on the other side."""
    for points in (
        [(10.0, 0.0), (20.0, 0.0)], [(20.0, 0.0), (10.0, 0.0)], [(10.0, 0.0), (10.0, 9.0)],
        [(0.0, 0.0), (10.0, 0.0), (0.0, 5.0)],
    ):  # fmt: skip
        assert len(cut(points, 10.0).begin) == 1
