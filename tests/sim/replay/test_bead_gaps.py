"""How near a head comes beside what stands higher, compared with slow geometry."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from shapely.affinity import translate
from shapely.geometry import LineString, MultiPoint, Polygon

from decmcts.print.machine import Body, Head, Slice
from sim.replay.material import find_contacts
from sim.replay.near_misses import NEAR_MM, NearPrint
from sim.replay.shapes import Beads

SKEW = np.array([[-3.0, -1.0], [5.0, -2.0], [4.0, 6.0]])
HEAD = Head("h", tuple(Slice(h, (SKEW * (1 + h / 2),)) for h in (0.0, 1.0, 3.0)))
SQUARE = Head("h", (Slice(0.0, (np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]),)),))
TOLERANCE_MM = 1e-4


def beads_of(*rows, width=0.4) -> Beads:
    """Return beads from rows (x, y, z, x, y, z, since)."""
    table, n = np.array(rows, float), len(rows)
    return Beads(
        table[:, :3], table[:, 3:6], np.full(n, width), np.full(n, 0.2),
        table[:, 6].astype(np.int64), np.arange(n),
    )  # fmt: skip


def nearest(moves, beads, of=SQUARE, clearance=0.0, **asked) -> NearPrint:
    near = NearPrint(**asked)
    find_contacts(
        np.array(moves, float), beads, of,
        clearance_mm=clearance, tolerance_mm=TOLERANCE_MM, limit=10**6, near=near,
    )  # fmt: skip
    return near


@pytest.mark.parametrize("clearance", [0.0, 0.7])
def test_against_slow_geometry(clearance):
    """Random moves past random beads: the least gap of those that are no contact, to the µm."""
    found = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        n, m = 6, 8
        start = np.column_stack([rng.uniform(0, 60, (n, 2)), rng.integers(1, 20, n) * 0.2])
        end = start + np.column_stack([rng.normal(0, 5, (n, 2)), np.zeros(n)])
        beads = beads_of(*np.column_stack([start, end, rng.integers(0, m, n)]), width=0.6)
        a = np.column_stack([rng.uniform(-10, 70, (m, 2)), rng.integers(0, 20, m) * 0.2 + 0.1])
        b = a + np.column_stack([rng.normal(0, 8, (m, 2)), np.zeros(m)])
        near = nearest(np.hstack([a, b]), beads, HEAD, clearance)
        due = min((gap for gap in slow_gaps(a, b, beads) if gap >= clearance), default=np.inf)
        due = due if due < clearance + NEAR_MM else np.inf
        assert near.gap_mm == pytest.approx(due, abs=1e-6), seed
        found.append(due)
    assert 4 < sum(np.isfinite(found)) < 12


def slow_gaps(a, b, beads: Beads):
    """Yield the gap of each level move to each bead there, for each part that is beside it."""
    for k in range(len(a)):
        for piece in HEAD.slices:
            polygon = Polygon(piece.polygons[0])
            ends = [translate(polygon, *p[:2]) for p in (a[k], b[k])]
            sweep = MultiPoint([c for e in ends for c in e.exterior.coords]).convex_hull
            for i in range(len(beads.start)):
                if beads.since[i] <= k and beads.end[i, 2] > a[k, 2] + piece.height_mm:
                    line = LineString([beads.start[i, :2], beads.end[i, :2]])
                    yield line.distance(sweep) - beads.width[i] / 2


def test_a_climbing_move_is_near_where_it_is_low_enough():
    """Once the tip is above a bead it is not beside it; tried at many points of the way."""
    rng, found = np.random.default_rng(1), []
    square = Polygon(SQUARE.slices[0].polygons[0])
    for _ in range(20):
        bead = np.array([*rng.uniform(-4, 4, 2), 1.0, *rng.uniform(-4, 4, 2), rng.uniform(1, 2)])
        move = np.array([*rng.uniform(2, 9, 2), rng.uniform(0, 2), *rng.uniform(2, 9, 2), 1.5])
        near = nearest([move], beads_of([*bead, 0]))
        share = np.linspace(0.0, 1.0, 80)[:, None]
        q, p = (each[:3] + share * (each[3:] - each[:3]) for each in (bead, move))
        apart = (q[:, None] - p[None]).reshape(-1, 3)
        beside = shapely.points(apart[apart[:, 2] > TOLERANCE_MM, :2])
        least = shapely.distance(square, beside).min(initial=np.inf) - 0.2
        if least < 0.2:  # perhaps a contact
            continue
        assert least - 0.1 < near.gap_mm <= least + 1e-9 or least > NEAR_MM - 0.1
        found.append(near.gap_mm)
    assert len(found) > 5


def test_material_no_higher_than_the_tip_is_not_beside_it():
    """Layer by layer nothing ever stands higher; the next bead of a layer is at the same height."""
    bead = beads_of([2.0, -3, 1.0, 2.0, 3, 1.0, 0])
    assert nearest([[0, 0, 1.0, 0, 1, 1.0]], bead).gap_mm == np.inf
    assert nearest([[0, 0, 0.9, 0, 1, 0.9]], bead).gap_mm == pytest.approx(0.8)


def test_a_body_is_beside_what_is_between_its_two_heights():
    """A beam is above a low print, and a duct beside a high one."""
    duct = Head("h", (), (Body("duct", (-1.0, -1.0, 2.0), (1.0, 1.0, 3.0)),))
    still = [[0, 0, 0.0, 0, 0, 0.0]]
    for top, due in ((1.9, np.inf), (2.5, 0.8), (3.1, 0.8), (3.3, np.inf)):
        found = nearest(still, beads_of([2.0, -3, top, 2.0, 3, top, 0]), duct)
        assert found.gap_mm == pytest.approx(due)
        assert found.part == ("duct" if due < 1 else "")


def test_what_comes_later_or_outside_the_moves_that_count_is_not_near():
    """A bead laid at move 1, and moves of the start and end code, have no say."""
    bead = beads_of([2.0, -3, 1.0, 2.0, 3, 1.0, 1])
    moves = [[x, 0, 0.5, x, 0, 0.5] for x in (0.7, 0.2, 0.1, 0.4)]
    found = nearest(moves, bead)
    assert (found.move, found.gap_mm) == (3, pytest.approx(0.4))
    found = nearest(moves, bead, end=3)
    assert (found.move, found.gap_mm) == (1, pytest.approx(0.6))


def test_contours_that_touch_in_the_source_do_not_count():
    """Beside where a scarf touches its wall it is as near as can be, in the source too."""
    beads = beads_of([2.0, -3, 1.0, 2.0, 3, 1.0, 0], [3.0, -3, 1.0, 3.0, 3, 1.0, 0])
    whose, still = np.array([[7, -1, -1]]), [[0, 0, 0.5, 0, 0, 0.5]]
    assert nearest(still, beads).bead == 0
    asked = {"touching": np.array([7 * 10 + 0]), "whose": whose, "n": 10}
    found = nearest(still, beads, **asked)
    assert (found.bead, found.gap_mm) == (1, pytest.approx(1.8))


def test_a_contact_is_no_gap():
    """What is met is a fault or the source's; the least gap is of the rest."""
    beads = beads_of([1.1, -3, 1.0, 1.1, 3, 1.0, 0], [3.0, -3, 1.0, 3.0, 3, 1.0, 0])
    found = nearest([[0, 0, 0.5, 0, 0, 0.5]], beads)
    assert (found.bead, found.gap_mm) == (1, pytest.approx(1.8))
