"""Where closed contours may be entered, by policy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.formats.gcode import read_gcode
from decmcts.print.contours import Contours, Role
from decmcts.print.loops import exits_of
from decmcts.print.seam import MOST_ENTRIES, entry_points, exit_points, seam_entries
from decmcts.samples import sample_path
from tests.print.test_toolpath import contours_of

NUTS = sample_path("four_nuts.gcode.gz")
SQUARE = [(0, 0, 0.2), (10, 0, 0.2), (10, 10, 0.2), (0, 10, 0.2), (0, 0, 0.2)]
# an L, counter-clockwise: its concave corner is vertex 3
ELL = [(0, 0, 0.2), (9, 0, 0.2), (9, 3, 0.2), (3, 3, 0.2), (3, 9, 0.2), (0, 9, 0.2), (0, 0, 0.2)]


def perimeters(*loops) -> Contours:
    contours = contours_of(*loops, closed=True)
    return replace(contours, role=np.full(len(contours), Role.EXTERNAL_PERIMETER, np.int8))


def only(contours: Contours, policy) -> list[int]:
    entries = seam_entries(contours, policy)
    assert (np.diff(entries.offsets) == 1).all()
    return entries.vertices.tolist()


def test_nearest_offers_every_vertex_of_a_small_loop_once() -> None:
    """The last point of a closed loop is its first: no second entry."""
    entries = seam_entries(perimeters(SQUARE, ELL), "nearest")
    assert entries.offsets.tolist() == [0, 4, 10]
    assert entries.vertices.tolist() == [0, 1, 2, 3, 0, 1, 2, 3, 4, 5]
    assert entries.contour().tolist() == [0] * 4 + [1] * 6


def test_nearest_keeps_to_its_limit_and_to_sharp_corners() -> None:
    """A round loop of many vertices with one spike: few entries, the spike among them."""
    turn = np.linspace(0.0, 2.0 * np.pi, 401)
    ring = np.stack([20 * np.cos(turn), 20 * np.sin(turn), np.full(401, 0.2)], axis=1)
    ring[-1] = ring[0]
    ring[137, :2] *= 1.3
    entries = seam_entries(perimeters([tuple(p) for p in ring.tolist()]), "nearest")
    assert MOST_ENTRIES * 3 // 4 <= len(entries.vertices) <= MOST_ENTRIES
    assert {0, 137} <= set(entries.vertices.tolist())
    assert np.diff(entries.vertices).max() < 2.5 * 400 / MOST_ENTRIES


def test_rear_is_the_largest_y() -> None:
    """Ties go to the vertex the loop meets first."""
    assert only(perimeters(SQUARE, ELL), "rear") == [2, 4]


def test_corner_prefers_the_concave_one() -> None:
    """Slicers hide the seam in a concave corner; without one it goes to the rearmost corner."""
    assert only(perimeters(ELL, SQUARE), "corner") == [3, 2]


def test_corner_leaves_a_round_loop_as_sliced() -> None:
    """No corner, no reason to move."""
    turn = np.linspace(0.0, 2.0 * np.pi, 101)
    ring = [(float(20 * np.cos(t)), float(20 * np.sin(t)), 0.2) for t in turn[:-1]]
    assert only(perimeters([*ring, ring[0]]), "corner") == [0]


def test_aligned_follows_the_seam_below() -> None:
    """The seam of a loop without corners stays above that of the loop below."""
    ell = [(x, y, 0.4) for x, y, _ in ELL[2:-1] + ELL[:3]]
    contours = replace(perimeters(ELL, ell), layer=np.array([0, 1], np.int32))
    chosen = only(contours, "aligned")
    assert entry_points(contours, seam_entries(contours, "aligned"))[:, :2].tolist() == [[3, 3]] * 2
    assert chosen == [3, 1]


@pytest.mark.parametrize("change", [
    {"closed": np.array([False])},
    {"reversible": np.array([False])},
    {"role": np.array([Role.IRONING], np.int8)},
    {"role": np.array([Role.WIPE_TOWER], np.int8)},
])  # fmt: skip
def test_what_may_not_move_has_its_own_entry_alone(change) -> None:
    """Open, tied or special contours stay as sliced, whatever the policy."""
    contours = replace(perimeters(SQUARE), **change)
    for policy in ("nearest", "rear", "corner", "aligned"):
        assert only(contours, policy) == [0]


def test_a_slope_has_its_own_entry_alone() -> None:
    """A vase's turn ends above its start: another start would print into it."""
    slope = [(x, y, 0.2 + 0.04 * k) for k, (x, y, _) in enumerate(SQUARE)]
    assert only(perimeters(slope), "rear") == [0]


def test_an_unknown_policy_is_refused() -> None:
    """A wrong word must not mean the default."""
    with pytest.raises(ValueError, match="random"):
        seam_entries(perimeters(SQUARE), "random")  # type: ignore[arg-type]


def test_exits_lie_a_gap_before_their_entries() -> None:
    """On a sliced print: as far from the entry along the loop as the slicer's own end."""
    contours = read_gcode(NUTS)[0].contours
    entries = seam_entries(contours)
    owner = entries.contour()
    way_in, way_out = entry_points(contours, entries), exit_points(contours, entries)
    gap = np.linalg.norm(contours.end - contours.start, axis=1)[owner]
    moved = entries.vertices > 0
    away = np.linalg.norm(way_in - way_out, axis=1)
    assert moved.sum() > 5000
    assert np.abs(away - gap)[moved].max() < 5e-3
    assert (way_out[~moved] == contours.end[owner[~moved]]).all()
    assert (exits_of(contours, owner, entries.vertices) == way_out).all()
    assert np.diff(entries.offsets).max() <= MOST_ENTRIES
