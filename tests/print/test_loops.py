"""Loops entered at another vertex: the gap moves along, nothing else changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.formats.gcode import read_gcode
from decmcts.print.contours import Contours, Role
from decmcts.print.loops import allowed_entries, close_gaps, enter_at, exits_of, movable, traversal
from decmcts.print.toolpath import Toolpath, endpoints
from decmcts.samples import sample_path
from tests.direct_actions import visit_points
from tests.print.test_toolpath import contours_of

NUTS = sample_path("four_nuts.gcode.gz")
FLOW = 0.05  # filament per mm
SQUARE = [(0, 0, 0.2), (10, 0, 0.2), (10, 10, 0.2), (0, 10, 0.2), (0, 0, 0.2)]
CLIPPED = [*SQUARE[:4], (0, 0.4, 0.2)]  # ends 0.4 mm before its start


def loop(points, *, flow=FLOW, feed=30.0) -> Contours:
    """One perimeter with this filament per mm, and a feed of its own for each segment."""
    contours = contours_of(points, closed=True)
    length = np.linalg.norm(np.diff(contours.points, axis=0), axis=1)
    extrusion = np.concatenate([[0.0], length * flow])
    speed = np.concatenate([[0.0], feed + np.arange(len(length))])
    role = np.array([Role.EXTERNAL_PERIMETER], np.int8)
    return replace(contours, extrusion=extrusion, feed=speed, role=role)


def length_of(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


@pytest.fixture(scope="module")
def nuts() -> Contours:
    return read_gcode(NUTS)[0].contours


def random_entries(contours: Contours, seed: int = 0) -> np.ndarray:
    """Any allowed vertex of each contour, drawn evenly."""
    rng, allowed = np.random.default_rng(seed), allowed_entries(contours)
    return np.array(
        [
            rng.choice(np.flatnonzero(allowed[a:b]))
            for a, b in zip(contours.offsets[:-1], contours.offsets[1:], strict=True)
        ],
        np.int32,
    )


def test_a_closed_loop_is_only_rotated() -> None:
    """No segment changes: place, filament and feed are the same set."""
    contours = loop(SQUARE)
    way = traversal(contours, 0, 3)
    assert way.points[:, :2].tolist() == [[0, 10], [0, 0], [10, 0], [10, 10], [0, 10]]
    assert way.rows[1:].tolist() == [4, 1, 2, 3]
    assert (way.extrusion[1:] == contours.extrusion[way.rows[1:]]).all()
    assert (way.feed[1:] == contours.feed[way.rows[1:]]).all()


def test_the_gap_moves_with_the_seam() -> None:
    """The old gap is closed at its neighbour's feed, as much is left out at the new one."""
    contours = loop(CLIPPED)
    way = traversal(contours, 0, 2)
    assert way.points[:, :2].tolist() == [[10, 10], [0, 10], [0, 0.4], [0, 0], [10, 0], [10, 9.6]]
    assert way.rows[1:].tolist() == [3, 4, 4, 1, 2]
    assert way.extrusion[1:] == pytest.approx(FLOW * np.array([10, 9.6, 0.4, 10, 9.6]))
    assert way.feed[1:].tolist() == [32.0, 33.0, 33.0, 30.0, 31.0]
    assert exits_of(contours, np.array([0], np.int32), np.array([2], np.int32))[0] == (
        pytest.approx(way.points[-1])
    )


def test_a_gap_longer_than_the_last_segments_takes_them_whole() -> None:
    """Round loops have segments shorter than the gap; none of them may stay behind as a stub."""
    corner = [(10, y, 0.2) for y in (9.7, 9.8, 9.9, 10)]
    contours = loop([(0, 0, 0.2), (10, 0, 0.2), *corner, (0, 10, 0.2), (0, 0.25, 0.2)])
    way = traversal(contours, 0, 5)
    assert way.points[-3:, 1].tolist() == pytest.approx([0, 9.7, 9.75])
    assert way.extrusion.sum() == pytest.approx(contours.extrusion.sum(), abs=1e-12)


def test_as_sliced_is_untouched(nuts: Contours) -> None:
    """Entry 0 is the source to the bit."""
    assert enter_at(nuts, np.zeros(len(nuts), np.int32)) is nuts
    way = traversal(nuts, 5, 0)
    rows = slice(int(nuts.offsets[5]), int(nuts.offsets[6]))
    assert (way.points == nuts.points[rows]).all()
    assert (way.extrusion == nuts.extrusion[rows]).all()


def test_sliced_loops_keep_their_filament_and_length(nuts: Contours) -> None:
    """On a real print, entered anywhere: each contour lays down what it did, on the same way."""
    entry = random_entries(nuts)
    moved = enter_at(nuts, entry)
    assert (entry > 0).sum() > 500
    for c in np.flatnonzero(entry).tolist():
        old, new = (slice(int(x.offsets[c]), int(x.offsets[c + 1])) for x in (nuts, moved))
        assert moved.extrusion[new].sum() == pytest.approx(nuts.extrusion[old].sum(), abs=1e-12)
        assert length_of(moved.points[new]) == pytest.approx(length_of(nuts.points[old]), abs=5e-3)
        assert (moved.extrusion[new][1:] > 0).all()
        assert (np.linalg.norm(np.diff(moved.points[new], axis=0), axis=1) > 1e-3).all()
        assert (traversal(nuts, c, int(entry[c])).points == moved.points[new]).all()
        assert np.unique(moved.points[new], axis=0).shape[0] == new.stop - new.start
    still = np.flatnonzero(entry == 0).tolist()
    assert all((nuts.polyline(c) == moved.polyline(c)).all() for c in still)


def test_endpoints_are_the_ends_of_the_traversal(nuts: Contours) -> None:
    """Planners count travel by them, in either direction."""
    entry = random_entries(nuts, 1)
    order = np.arange(len(nuts), dtype=np.int32)
    is_reversed = order % 3 == 0
    first, last = endpoints(nuts, Toolpath(order, is_reversed, entry))
    for c in order.tolist():
        path = visit_points(nuts, c, reversed_=bool(is_reversed[c]), entry=int(entry[c]))
        assert path[0].tolist() == first[c].tolist()
        assert path[-1].tolist() == last[c].tolist()


def test_a_seam_does_not_move_to_where_the_bead_has_another_flow() -> None:
    """What the new gap saves must fill the old one: a wide bead's share would be a blob there."""
    flow = np.array([FLOW, FLOW, 2 * FLOW, FLOW])
    allowed = allowed_entries(loop(CLIPPED, flow=flow))
    assert allowed.tolist() == [True, True, True, False, False]
    assert allowed_entries(loop(SQUARE, flow=flow)).tolist() == [True] * 4 + [False]


def test_a_seam_moves_by_more_than_its_gap() -> None:
    """Otherwise the clip would reach into the gap it came from."""
    points = [(0, 0, 0.2), (0.5, 0, 0.2), *CLIPPED[1:]]
    assert allowed_entries(loop(points)).tolist() == [True, False, True, True, True, False]


@pytest.mark.parametrize(("role", "gap", "moves"), [
    (Role.EXTERNAL_PERIMETER, 0.4, True),
    (Role.EXTERNAL_PERIMETER, 0.004, False),  # too little filament to tell
    (Role.EXTERNAL_PERIMETER, 0.5, False),  # more than its width of 0.45
    (Role.SOLID_INFILL, 0.1, True),  # clipped by a slicer
    (Role.SOLID_INFILL, 0.4, False),  # lines that happen to end near where they began
    (Role.WIPE_TOWER, 0.0, False),
])  # fmt: skip
def test_what_is_a_loop_depends_on_its_role_and_gap(role, gap, moves) -> None:
    """Closing the gap of what is no loop would lay down material nobody asked for."""
    contours = replace(loop([*SQUARE[:4], (0, gap, 0.2)]), role=np.array([role], np.int8))
    assert movable(contours).tolist() == [moves]


def test_closed_gaps_are_all_the_material_there_can_be(nuts: Contours) -> None:
    """Whatever the seam, the way lies on the closed loop."""
    closed = close_gaps(nuts)
    assert len(closed.points) == len(nuts.points) + 640
    assert (closed.start[nuts.closed] == closed.end[nuts.closed]).all()
    still = np.flatnonzero(~nuts.closed).tolist()
    assert all((nuts.polyline(c) == closed.polyline(c)).all() for c in still)


def test_no_contours() -> None:
    """An empty print has no seams."""
    empty = contours_of()
    assert len(close_gaps(empty)) == 0
    assert not movable(empty).size
