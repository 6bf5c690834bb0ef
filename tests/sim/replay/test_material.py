"""Head against material, compared with slow geometry of another library."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.affinity import translate
from shapely.geometry import LineString, MultiPoint, Polygon

from decmcts.print.machine import Body, Head, Slice
from sim.faults import FaultKind
from sim.replay.material import find_contacts, or_undecided
from sim.replay.near_misses import CAPACITY, NearMissCapacity, UndecidedError
from sim.replay.shapes import Beads

SKEW = np.array([[-3.0, -1.0], [12.0, -2.0], [4.0, 9.0]])


def head(*heights: float) -> Head:
    return Head("h", tuple(Slice(h, (SKEW * (1 + h),)) for h in heights))


def bead_row(start, end, since=0, width=0.4):
    return Beads(
        np.array([start], float), np.array([end], float), np.array([width]), np.array([0.2]),
        np.array([since]), np.array([0]),
    )  # fmt: skip


def contacts(moves, beads, of=None, tolerance=1e-4, clearance=0.0, capacity=CAPACITY):
    found = find_contacts(
        np.array(moves, float),
        beads,
        of or head(0.0),
        clearance_mm=clearance,
        tolerance_mm=tolerance,
        limit=10**6,
        capacity=capacity,
    )
    return [c.move for c in found]


def test_over_material_of_equal_height_is_allowed():
    """A nozzle slides over what it has just printed at its own z."""
    bead = bead_row([0, 0, 1.0], [5, 0, 1.0])
    assert contacts([[0, 0, 1.0, 5, 0, 1.0]], bead) == []


def test_through_higher_material_is_not():
    """A hundredth of a millimetre too low is a contact."""
    bead = bead_row([0, 0, 1.0], [5, 0, 1.0])
    assert contacts([[0, 0, 0.99, 5, 0, 0.99]], bead) == [0]


def test_only_what_may_be_there_counts():
    """A bead laid down at move 2 is no obstacle for moves 0 and 1, but for all after."""
    bead = bead_row([0, 0, 1.0], [5, 0, 1.0], since=2)
    assert contacts([[0, 0, 0.5, 5, 0, 0.5]] * 4, bead) == [2, 3]


def test_standing_still_inside_material_is_a_contact():
    """A rest is a move that goes nowhere."""
    bead = bead_row([0, 0, 1.0], [5, 0, 1.0])
    assert contacts([[2, 0, 0.5, 2, 0, 0.5]], bead) == [0]


def test_touching_the_side_is_allowed():
    """The head's edge against the bead's edge is touching, not overlap."""
    square = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    machine_head = Head("h", (Slice(0.0, (square,)),))
    for x, due in ((1.2, []), (1.2 - 5e-4, [0])):
        bead = bead_row([x, -3, 1.0], [x, 3, 1.0])
        assert contacts([[0, 0, 0.5, 0, 0, 0.5]], bead, machine_head) == due


SQUARE = Head("h", (Slice(0.0, (np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]),)),))


@pytest.mark.parametrize("gap", [-2e-3, 2e-3])
def test_bead_ends_are_round(gap):
    """A bead ends in a disc of half its width: beside its end and at its corner, to 2 µm."""
    along = bead_row([1.2 + gap, 0, 1.0], [9, 0, 1.0])
    d = (0.2 + gap) / np.sqrt(2.0)
    corner = bead_row([1.0 + d, 1.0 + d, 1.0], [9, 9, 1.0])
    due = [0] if gap < 0 else []
    still = [[0, 0, 0.5, 0, 0, 0.5]]
    assert contacts(still, along, SQUARE) == due
    assert contacts(still, corner, SQUARE) == due


@pytest.mark.parametrize("gap", [-2e-3, 2e-3])
def test_the_clearance_is_kept_from_beads(gap):
    """A machine's clearance counts beside a bead and round its ends, for slices alone."""
    still = [[0, 0, 0.5, 0, 0, 0.5]]
    due = [0] if gap < 0 else []
    for bead in (
        bead_row([1.5 + gap, -9, 1.0], [1.5 + gap, 9, 1.0]),
        bead_row([1.5 + gap, 0, 1.0], [9, 0, 1.0]),
    ):
        assert contacts(still, bead, SQUARE, clearance=0.3) == due
        assert contacts(still, bead, SQUARE) == []
    body = Head("h", (), (Body("duct", (-1.0, -1.0, 0.0), (1.0, 1.0, 3.0)),))
    assert contacts(still, bead_row([1.4, -9, 1.0], [1.4, 9, 1.0]), body, clearance=0.3) == []


def test_a_column_is_material():
    """What is extruded straight up stands where it was laid, a disc of the bead's width."""
    column = bead_row([5, 0, 1.0], [5, 0, 3.0])
    low, high = [[0, 0, 2.0, 9, 0, 2.0]], [[0, 0, 3.0, 9, 0, 3.0]]
    assert contacts(low, column, SQUARE) == [0]
    assert contacts(high, column, SQUARE) == []
    beside = [[0, 1.2 + 2e-3, 2.0, 9, 1.2 + 2e-3, 2.0]]
    assert contacts(beside, column, SQUARE) == []


def test_a_climbing_travel_is_judged_where_it_is():
    """A travel that rises on its way over a bead is above it by then, or it is not."""
    bead = bead_row([10, -5, 1.0], [10, 5, 1.0])
    for end_z, due in ((1.1, [0]), (1.2, [])):  # the tip comes to it at 0.88 of the way
        assert contacts([[0, 0, 0.0, 10, 0, end_z]], bead, SQUARE) == due


def test_a_bead_of_ten_metres_takes_no_memory():
    """Cells are larger over a larger area, and a slanting bead costs its length."""
    bead = bead_row([-7000, -7000, 1.0], [7000, 7000, 1.0])
    assert contacts([[0, 0, 0.5, 5, 0, 0.5], [50, 0, 0.5, 60, 0, 0.5]], bead, SQUARE) == [0]


def test_beads_that_cover_everything_are_refused():
    """Too many cells to hold is a verdict, not a killed process."""
    bead = bead_row([0, 0, 1.0], [5, 0, 1.0], width=99.0)
    with pytest.raises(UndecidedError, match="too many to hold"):
        contacts([[0, 0, 0.5, 5, 0, 0.5]], bead, SQUARE, capacity=NearMissCapacity(cells=100))


def test_a_dot_is_material():
    """Filament pushed on the spot stands as high as the nozzle did: no head goes through it."""
    dot = bead_row([0, 0, 1.0], [0, 0, 1.0])
    assert contacts([[0, 0, 0.5, 1, 0, 0.5]], dot) == [0]
    assert contacts([[0, 0, 1.0, 1, 0, 1.0]], dot) == []


def test_bodies_are_judged_between_their_two_heights():
    """A body hangs where it hangs: beads below it and above it do not meet it."""
    body = Body("duct", (10.0, -1.0, 2.0), (12.0, 1.0, 3.0))
    machine_head = Head("h", (), (body,))
    for top, due in ((1.9, []), (2.5, [0]), (3.1, [0]), (3.3, [])):
        bead = bead_row([11, -5, top], [11, 5, top])
        assert contacts([[0, 0, 0.0, 0, 0, 0.0]], bead, machine_head) == due


def test_no_beads_and_no_moves():
    """Nothing printed means nothing to touch."""
    bead = bead_row([0, 0, 1.0], [5, 0, 1.0])
    empty = Beads(
        *(a[:0] for a in (bead.start, bead.end, bead.width, bead.height, bead.since, bead.label))
    )
    assert contacts([[0, 0, 0, 1, 0, 0]], empty) == []
    assert contacts(np.empty((0, 6)), bead) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_against_slow_geometry(seed):
    """Random flat and climbing moves, an asymmetric head: the same contacts as shapely finds."""
    rng = np.random.default_rng(seed)
    n, m = 60, 120
    start = np.column_stack([rng.uniform(0, 80, (n, 2)), rng.integers(1, 40, n) * 0.2])
    end = start + np.column_stack([rng.normal(0, 5, (n, 2)), np.zeros(n)])
    since = rng.integers(0, m, n)
    width = rng.uniform(0.3, 0.8, n)
    beads = Beads(start, end, width, np.full(n, 0.2), since, np.arange(n))
    a = np.column_stack([rng.uniform(-10, 90, (m, 2)), rng.integers(0, 40, m) * 0.2 + 0.1])
    b = a + np.column_stack([rng.normal(0, 8, (m, 2)), np.zeros(m)])
    of = head(0.0, 1.0, 3.0)
    due = [k for k in range(m) if slow_contact(a[k], b[k], k, beads, of, 0.7)]
    assert contacts(np.hstack([a, b]), beads, of, clearance=0.7) == due
    assert 5 < len(due) < m - 5


def slow_contact(a, b, k, beads: Beads, of: Head, clearance: float) -> bool:
    for piece in of.slices:
        polygon = Polygon(piece.polygons[0])
        ends = [translate(polygon, *p[:2]) for p in (a, b)]
        sweep = MultiPoint([c for e in ends for c in e.exterior.coords]).convex_hull
        for i in range(len(beads.start)):
            if beads.since[i] <= k and beads.end[i, 2] > a[2] + piece.height_mm:
                line = LineString([beads.start[i, :2], beads.end[i, :2]])
                if line.buffer(beads.width[i] / 2 + clearance, quad_segs=64).intersects(sweep):
                    return True
    return False


def test_what_cannot_be_judged_does_not_pass():
    """With more near misses than fit and no contact among the first, the verdict is a fault."""
    beside = [[0, 1.2 + 2e-3, 0.5, 9, 1.2 + 2e-3, 0.5]] * 2
    bead = bead_row([0, 0, 1.0], [9, 0, 1.0])
    assert contacts(beside, bead, SQUARE) == []
    (fault,) = or_undecided(
        lambda: contacts(beside, bead, SQUARE, capacity=NearMissCapacity(first=1, most=1))
    )
    assert fault.kind == FaultKind.HEAD_MATERIAL
    assert "too many to judge" in fault.text
