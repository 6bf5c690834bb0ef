"""Head against material, compared with slow geometry of another library."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.affinity import translate
from shapely.geometry import LineString, MultiPoint, Polygon

from decmcts.print.machine import Body, Head, Slice
from sim import material
from sim.faults import FaultKind
from sim.material import Beads, find_contacts
from sim.verify import verify_plan

SKEW = np.array([[-3.0, -1.0], [12.0, -2.0], [4.0, 9.0]])


def head(*heights: float) -> Head:
    return Head("h", tuple(Slice(h, (SKEW * (1 + h),)) for h in heights))


def bead_row(start, end, since=0, width=0.4):
    return Beads(
        np.array([start], float), np.array([end], float), np.array([width]), np.array([0.2]),
        np.array([since]), np.array([0]),
    )  # fmt: skip


def contacts(moves, beads, of=None, tolerance=1e-4):
    found = find_contacts(
        np.array(moves, float), beads, of or head(0.0), tolerance_mm=tolerance, limit=10**6
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


def test_a_bead_without_length_is_no_material():
    """Priming in place lays nothing down beside the nozzle."""
    assert contacts([[0, 0, 0.5, 1, 0, 0.5]], bead_row([0, 0, 1.0], [0, 0, 1.0])) == []


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
    due = [k for k in range(m) if slow_contact(a[k], b[k], k, beads, of)]
    assert contacts(np.hstack([a, b]), beads, of) == due
    assert 5 < len(due) < m - 5


def slow_contact(a, b, k, beads: Beads, of: Head) -> bool:
    for piece in of.slices:
        polygon = Polygon(piece.polygons[0])
        ends = [translate(polygon, *p[:2]) for p in (a, b)]
        sweep = MultiPoint([c for e in ends for c in e.exterior.coords]).convex_hull
        for i in range(len(beads.start)):
            if beads.since[i] <= k and beads.end[i, 2] > a[2] + piece.height_mm:
                line = LineString([beads.start[i, :2], beads.end[i, :2]])
                if line.buffer(beads.width[i] / 2, cap_style="flat").intersects(sweep):
                    return True
    return False


def test_what_cannot_be_judged_does_not_pass(make, monkeypatch):
    """With more near misses than room and no contact among the first, the verdict is a fault."""
    monkeypatch.setattr(material, "MOST", 1)
    monkeypatch.setattr(material, "FIRST", 1)
    monkeypatch.setattr(material, "_judge", lambda *_: None)
    plan = make.tower_plan(towers=((20.0, 20.0), (26.0, 20.0)))
    assert verify_plan(plan).kinds() == {FaultKind.HEAD_MATERIAL}
    assert "too many to judge" in str(verify_plan(plan).faults[0])
