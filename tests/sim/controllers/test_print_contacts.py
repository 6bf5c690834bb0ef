"""Contacts of heads with what is printed by then, against a look at all times and all beads."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import shapely

from decmcts.print.machine import Body, Head, Machine, Slice
from sim.controllers.from_files import first_layer_of
from sim.controllers.print_contacts import NO_LAYER, TRAVEL, Material, MoveBeads, material_of_files
from sim.controllers.print_search import bare, lay
from sim.controllers.program import StopKind
from sim.controllers.simulate import simulate
from sim.controllers.timing import Timing
from tests.sim.controllers.programs import LIMITS, program

TIP = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
WIDE = 10.0 * TIP
HEAD = Head("left", (Slice(0.0, (TIP,)), Slice(2.0, (WIDE,))))
MACHINE = Machine(
    "one", (0.0, 0.0), (100.0, 100.0), (HEAD,), clearance_mm=0.5, limits=LIMITS, rest_s=0.0
)


def printing(points, beads, **options):
    """A program whose moves in `beads` push filament."""
    made = program(points, **options)
    return replace(made, filament=np.isin(np.arange(len(made.feed)), list(beads)) * 0.1)


def strict(*programs, half: float = 0.2) -> Material:
    """Each bead is a contour of its own, printed in the source's order; none may be touched."""
    found = []
    for made in programs:
        m = len(made.feed)
        number = np.where(made.prints, m - np.arange(m), TRAVEL)
        none = np.full(m, NO_LAYER)
        found.append(MoveBeads(number, none, np.full(m, 0.2), np.full(m, half), made.prints,
                           np.ones(m, bool)))  # fmt: skip
    return Material(tuple(found), True)


def seen(made, material=None, machine=MACHINE):
    return simulate([made], machine, material=material or strict(made)).trials[0].on_print


WALL = [[20.0, 0.0, 3.0], [20.0, 40.0, 3.0]]


@pytest.mark.parametrize(
    ("z", "y", "part"),
    [
        (2.9, 20.0, "slice at 0 mm"),  # the tip, through the wall
        (3.0, 20.0, None),  # along its top
        (0.9, 45.5, "slice at 2 mm"),  # 5.5 mm beside its end: half of the slice and the clearance
        (0.9, 45.8, None),  # further than that and half of the bead
        (1.0, 45.5, None),  # the slice just above
    ],
)
def test_what_passes_too_near_is_a_contact(z, y, part):
    """A wall 3 mm high, and a travel past it."""
    way = [[0.0, y, 9.0], [0.0, y, z], [60.0, y, z]]
    found = seen(printing([*WALL, [20.0, 40.0, 9.0], *way], {0}))
    assert [one.part for one in found] == ([part] if part else [])
    for one in found:
        x = 20.0 - (0.5 if part == "slice at 0 mm" else 5.0) - 0.7
        assert one.at == pytest.approx((x, y, z), abs=0.7)  # by one of the beads it meets
        assert one.depth_mm == pytest.approx(3.0 - z - (2.0 if "2" in part else 0.0))
        assert one.spot[2] == 3.0 and one.by == 0


def test_only_what_is_printed_by_then_can_be_touched():
    """The same travel before the wall is printed."""
    way = [[0.0, 20.0, 1.0], [60.0, 20.0, 1.0], [60.0, 20.0, 9.0], [20.0, 0.0, 9.0]]
    assert seen(printing([*way, *WALL], {4})) == ()


def test_a_contact_lasts_while_the_head_stays_in_touch():
    """Moves in a row that touch are one contact, of its deepest place."""
    way = [[15.0, 20.0, 9.0], [15.0, 20.0, 0.9], [15.0, 25.0, 0.9], [15.0, 30.0, 0.5],
           [15.0, 30.0, 9.0], [50.0, 30.0, 9.0], [15.0, 20.0, 0.9]]  # fmt: skip
    first, second = seen(printing([*WALL, [20.0, 40.0, 9.0], *way], {0}))
    assert first.depth_mm == pytest.approx(0.5) and first.time_s < second.time_s
    assert first.seconds > 0.1


def test_what_the_source_does_too_is_no_contact():
    """A lower bead beside a higher one that comes first in the source, as a scarf's ramp."""
    ramp = printing([[20, 0, 0.4], [20, 40, 0.4], [20, 40, 9], [20.3, 0, 9], [20.3, 0, 0.2],
                     [20.3, 40, 0.4]], {0, 4})  # fmt: skip
    later = strict(ramp)
    (beads,) = later.beads
    number = np.where(ramp.prints, np.arange(5), TRAVEL)
    number[3] = 4  # straight down to it
    assert seen(ramp, replace(later, beads=(replace(beads, number=number),))) == ()
    assert len(seen(ramp, later)) == 1
    low = replace(beads, number=number, height=np.full(5, 0.1))
    assert len(seen(ramp, replace(later, beads=(low,)))) == 1


def test_what_another_head_printed_counts_once_it_is_there():
    """By signals, or by the clock: a head that passes too late goes through the other's wall."""
    machine = replace(MACHINE, heads=(HEAD, replace(HEAD, name="right")))
    wall = printing([[90, 90, 9], [20, 0, 9], *WALL, [20, 40, 9], [90, 90, 9]], {2})
    passes = program([[0, 20, 1], [0, 20, 1], [60, 20, 1]], name="right",
                     stops=[(1, StopKind.DWELL, -1, 0.0)])  # fmt: skip
    late = replace(passes, stops=replace(passes.stops, value=np.array([60.0])))
    for other, times in ((passes, 0), (late, 1)):
        both = [wall, other]
        found = simulate(both, machine, material=strict(*both)).trials[0].on_print
        assert [(one.head, one.by) for one in found] == [(1, 0)] * times


def test_one_head_has_the_same_contacts_whatever_its_time():
    made = printing([*WALL, [20, 40, 9], [0, 20, 9], [0, 20, 1], [60, 20, 1]], {0})
    found = simulate([made], MACHINE, material=strict(made), timing=Timing.UNIFORM, trials=3)
    assert [len(trial.on_print) for trial in found.trials] == [1, 0, 0, 0]
    assert not found.safe and found.print_contacts == 1


MARKS = (
    b"; CHANGE_LAYER", b";LAYER:0", b"; LAYER:0", b"; --- LAYER 0 (0.2mm) ---",
    b"; BEGIN_LAYER_OBJECT z=0.2", b"; *** LAYER 1", b"; layer 1, Z = 0.2", b";LAYER_CHANGE",
)  # fmt: skip


def test_files_may_touch_a_bead_to_its_height():
    """They do not say what their slicer did; start code pushes filament into the air and wipes."""
    layer = [[0, 0, 0.2], [40, 0, 0.2], [40, 9, 0.2], [0, 9, 0.2], [0, 9, 0.4], [40, 9, 0.4]]
    down = [[40, 9, 0.4], [40, 9, 0.25], [0, 9, 0.25]]
    made = printing([*layer, *down], {0, 2, 4})
    assert seen(made, material_of_files([made])) == ()
    deep = printing([*layer, [40, 9, 0.1], [0, 9, 0.1]], {0, 2, 4})
    assert len(seen(deep, material_of_files([deep]))) == 1
    air = printing([[0, 0, 9], [9, 0, 0.2], [0, 0, 0.2]], {0, 1})
    assert seen(air, material_of_files([air])) == ()
    text = b"G1 X1\n" * len(deep.feed) + b";LAYER:0\n"
    lines = np.arange(1, len(deep.feed) + 1)
    begun = replace(deep, line=lines, first_layer=first_layer_of(text))
    assert seen(begun, material_of_files([begun])) == ()


@pytest.mark.parametrize("mark", MARKS)
def test_the_first_layer_is_found_by_the_marks_of_every_slicer(mark):
    """What start code pushes is no print; each slicer names its layers in words of its own."""
    text = b"; made\nG28\r\nG1 X9 E1\r\n" + mark + b"\r\n;LAYER:9\r\n"
    assert first_layer_of(text) == 4
    assert first_layer_of(b"; made\nG28\n;LAYER_COUNT:9\n") == 0


def test_what_stood_there_before_is_touched_too():
    """A print that is planned again goes on over what is printed."""
    from tests.sim.conftest import stacked_plan

    before = stacked_plan((0, 1, -1, 0.0)).contours
    low, high = before.points.min(axis=0), before.points.max(axis=0)
    way = program([[*low[:2], low[2] - 0.1], [*high[:2], low[2] - 0.1]])
    found = seen(way, replace(strict(way), before=before))
    assert found and {(one.by, one.bead) for one in found} == {(-1, -1)}


@pytest.mark.parametrize("seed", range(40))
def test_no_contact_is_made_up_and_none_deeper_than_a_cell_is_missed(seed):
    """Against shapely: each swept part, widened, and all beads laid before."""
    rng = np.random.default_rng(seed)
    n = 16
    points = np.round(rng.uniform(0, 30, (n, 3)) * [1, 1, 0.12], 3)
    level = rng.random(n) < 0.7
    for k in range(1, n):
        points[k, 2] = points[k - 1, 2] if level[k] else points[k, 2]
    beads = set(np.flatnonzero(level[1:] & (rng.random(n - 1) < 0.6)).tolist())
    body = Body("duct", (-6.0, 2.0, 1.0), (-3.0, 4.0, 50.0))
    machine = replace(MACHINE, heads=(replace(HEAD, bodies=(body,)),))
    made = printing(points, beads)
    found = {round(one.time_s, 6): one for one in seen(made, machine=machine)}
    sure, may = _looks(points, beads, 0.4), _looks(points, beads, 0.0)
    run = simulate([made], machine).run.heads[0]
    ours = {
        i for i in range(n - 1) for one in found.values()
        if one.time_s < run.end[i] - 1e-9 and one.time_s + one.seconds > run.begin[i] + 1e-9
    }  # fmt: skip
    assert sure <= ours <= may


def _looks(points, beads, spare: float) -> set[int]:
    """Return moves in which a part, `spare` mm less wide, goes into a bead laid before."""
    box = np.array([[-6, 2], [-3, 2], [-3, 4], [-6, 4]], float)
    parts = [(TIP, 0.0, 0.5), (WIDE, 2.0, 0.5), (box, 1.0, 0.0)]
    found = set()
    for i in range(len(points) - 1):
        a, b = points[i], points[i + 1]
        for k in (k for k in beads if k < i):
            top = points[k, 2]  # beads are level
            line = shapely.LineString([points[k, :2], points[k + 1, :2]])
            for polygon, low, reach in parts:
                z = np.array([a[2], b[2]]) + low + 0.011
                share = np.clip((top - z[0]) / (z[1] - z[0]), 0, 1) if z[0] != z[1] else 1.0
                if z.min() >= top:
                    continue
                ends = (0.0, share) if z[0] < top else (share, 1.0)
                ends = (0.0, 1.0) if z.max() < top else ends
                swept = shapely.MultiPoint(
                    np.concatenate([polygon + (a + s * (b - a))[:2] for s in ends])
                ).convex_hull
                if swept.distance(line) < reach + 0.2 - 0.01 - spare:
                    found.add(i)
    return found


def test_squares_hold_the_highest_of_their_cells():
    """All levels of the grid, after random beads."""
    rng = np.random.default_rng(0)
    heights = bare(np.zeros(2), np.array([10.0, 7.0]))
    ends = rng.uniform(0, 1, (50, 2, 3)) * [10.0, 7.0, 5.0]
    for k, (start, end) in enumerate(ends):
        lay(heights, start, end, k)
    sides = list(zip(heights.rows.tolist(), heights.columns.tolist(), strict=True))
    levels = [
        heights.top[first : first + rows * columns].reshape(rows, columns)
        for first, (rows, columns) in zip(heights.first.tolist(), sides, strict=True)
    ]
    assert levels[0].max() == pytest.approx(ends[:, :, 2].max())
    for below, above in itertools.pairwise(levels):
        for r, c in np.ndindex(*above.shape):
            assert above[r, c] == below[2 * r : 2 * r + 2, 2 * c : 2 * c + 2].max()
