"""The paper's metric and the traversal of contours, on cases done by hand."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.print.contours import Contours
from decmcts.print.toolpath import Toolpath, endpoints, extrusionless_travel
from tests.direct_actions import visit_points


def contours_of(*polylines: list[tuple[float, float, float]], closed: bool = False) -> Contours:
    n = len(polylines)
    points = np.array([p for line in polylines for p in line], np.float64).reshape(-1, 3)
    offsets = np.cumsum([0, *(len(line) for line in polylines)]).astype(np.int64)
    return Contours(
        points,
        offsets,
        extrusion=np.ones(len(points)),
        feed=np.full(len(points), 30.0),
        width=np.full(n, 0.45),
        height=np.full(n, 0.2),
        role=np.zeros(n, np.int8),
        closed=np.full(n, closed),
        layer=np.zeros(n, np.int32),
        tool=np.zeros(n, np.int16),
        reversible=np.ones(n, np.bool_),
        epoch=np.zeros(n, np.int32),
        line=np.zeros(n, np.int32),
    )


def test_travel_is_exit_to_entry_in_three_dimensions() -> None:
    """3-4-5 in the plane, then straight up: 5 + 2."""
    contours = contours_of([(0, 0, 0), (1, 0, 0)], [(4, 4, 0), (9, 9, 0)], [(9, 9, 2), (0, 0, 2)])
    assert extrusionless_travel(contours, Toolpath.as_sliced(3)) == pytest.approx(7.0)


def test_reversing_swaps_entry_and_exit() -> None:
    """A contour reversed starts where it ended."""
    contours = contours_of([(0, 0, 0), (1, 0, 0)], [(9, 0, 0), (2, 0, 0)])
    toolpath = Toolpath.of(np.array([0, 1], np.int32), np.array([False, True]))
    assert extrusionless_travel(contours, toolpath) == pytest.approx(1.0)
    entries, exits = endpoints(contours, toolpath)
    assert entries[1].tolist() == [2, 0, 0]
    assert exits[1].tolist() == [9, 0, 0]


def test_one_contour_has_no_travel() -> None:
    """The way to the first contour is not counted, as in the paper."""
    contours = contours_of([(5, 5, 0), (6, 5, 0)])
    assert extrusionless_travel(contours, Toolpath.as_sliced(1)) == 0.0


def test_closed_contour_entered_elsewhere_keeps_its_shape() -> None:
    """Moving the seam rotates the vertices and returns to the entry."""
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 0)]
    contours = contours_of(square, closed=True)
    rotated = visit_points(contours, 0, entry=2)
    assert rotated[0].tolist() == [1, 1, 0]
    assert rotated[-1].tolist() == [1, 1, 0]
    assert len(rotated) == 5


def test_contours_refuse_arrays_that_do_not_fit() -> None:
    """A wrong shape must fail at the door, not in a kernel."""
    good = contours_of([(0, 0, 0), (1, 0, 0)])
    fields = {name: getattr(good, name) for name in good.__slots__}
    with pytest.raises(ValueError, match="width"):
        Contours(**{**fields, "width": np.ones(2)})


def test_contours_are_read_only() -> None:
    """Planners share them; nobody may change them."""
    with pytest.raises(ValueError, match="read-only"):
        contours_of([(0, 0, 0), (1, 0, 0)]).points[0, 0] = 1.0
