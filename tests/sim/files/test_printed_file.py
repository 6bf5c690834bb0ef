"""One-head files: good ones pass, seeded faults are found by kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.job import PrintJob
from sim.faults import FaultKind as K
from tests.sim.files.motions import File, verify_motions


def file_of(paths, *, lift=1.0, home=False) -> File:
    """A file that prints the paths in order, lifting to `lift` between them."""
    points, extrusion, contour = [np.array([0.0, 0.0, 5.0])], [], []
    for number, path in enumerate(paths):
        up = [[*points[-1][:2], lift], [*path[0][:2], lift], path[0]]
        for point, laid, owner in [
            *((p, 0.0, -1) for p in up),
            *((p, 0.03, number) for p in path[1:]),
        ]:
            points.append(np.array(point, float))
            extrusion.append(laid)
            contour.append(owner)
    if home:
        points.append(np.zeros(3))
        extrusion.append(0.0)
        contour.append(-1)
    m = len(extrusion)
    printing = np.array(contour) >= 0
    feed = np.where(printing, 30.0, 100.0)
    if home:
        feed[-1] = 0.0
    return File(
        np.array(points), np.array(extrusion), feed, np.arange(1, m + 1),
        np.array(contour), 0.4 * printing, 0.2 * printing,
    )  # fmt: skip


@pytest.fixture
def towers(make):
    """Two towers of four layers, too near to finish one before the other."""
    return [make.square(20.0 + 8.0 * t, 20.0, 0.2 * (k + 1)) for k in range(4) for t in range(2)]


def kinds(make, ours, source):
    return verify_motions(ours, source, make.one_head_machine()).kinds()


def test_the_source_itself_and_another_good_order(make, towers):
    """Layers may be printed in any order of the towers, and contours reversed."""
    source = file_of(towers)
    assert kinds(make, source, source) == set()
    ours = file_of([towers[i][::-1] for i in (1, 0, 2, 3, 5, 4, 6, 7)])
    assert kinds(make, ours, source) == set()


def test_one_tower_first_touches_the_other(make, towers):
    """All extrusions are there; only the geometry says no."""
    ours = file_of([towers[i] for i in (0, 2, 4, 6, 1, 3, 5, 7)])
    assert kinds(make, ours, file_of(towers)) == {K.HEAD_MATERIAL}


def test_an_upper_layer_first(make, towers):
    """A bead in mid-air is found when the head comes below it."""
    ours = file_of([towers[i] for i in (0, 1, 4, 5, 2, 3, 6, 7)])
    assert kinds(make, ours, file_of(towers)) == {K.HEAD_MATERIAL}


def test_a_travel_through_the_print(make, towers):
    """Travels are judged as prints are."""
    single = [make.square(20.0, 20.0, 0.2 * (k + 1)) for k in range(4)]
    source = file_of(single)
    low = replace(source, points=source.points.copy())
    last = np.nonzero(np.diff(low.contour) > 0)[0][-1]
    low.points[last, 2] = 0.3
    assert kinds(make, source, source) == set()
    assert kinds(make, low, source) == {K.HEAD_MATERIAL}


def test_a_contour_left_out(make, towers):
    """A print with a hole in it is no result."""
    assert kinds(make, file_of(towers[:-1]), file_of(towers)) == {K.MISSING, K.E_TOTAL}


def test_a_contour_printed_twice(make, towers):
    """Twice the plastic in one place."""
    ours = file_of([*towers, towers[-1]])
    assert kinds(make, ours, file_of(towers)) == {K.DOUBLED, K.E_TOTAL}


def test_extrusion_during_a_travel(make, towers):
    """A string across the print is not in the source."""
    ours = file_of(towers)
    extrusion = ours.extrusion.copy()
    extrusion[np.nonzero(ours.contour < 0)[0][4]] = 0.2
    assert kinds(make, replace(ours, extrusion=extrusion), file_of(towers)) == {
        K.EXTRUSION,
        K.E_TOTAL,
    }


def test_other_feeds_and_other_filament(make, towers):
    """Faster or thinner is another print."""
    ours, source = file_of(towers), file_of(towers)
    assert kinds(make, replace(ours, feed=ours.feed * 1.1), source) == {K.FEED}
    thick = replace(ours, extrusion=ours.extrusion * 1.1)
    assert kinds(make, thick, source) == {K.EXTRUSION, K.E_TOTAL}


def test_homing_is_no_move_through_the_print(make, towers):
    """G28 ends anywhere by any way; its path is the machine's own business."""
    assert kinds(make, file_of(towers, home=True), file_of(towers, home=True)) == set()


def climbing(turns=3):
    """A square helix 0.2 mm a turn, as continuous-Z prints are."""
    corners = np.array([[20.0, 20], [24, 20], [24, 24], [20, 24]])
    xy = np.vstack([corners[k % 4] for k in range(4 * turns + 1)])
    return np.column_stack([xy, 0.2 + 0.05 * np.arange(len(xy))])


def test_a_climbing_contour_runs_up_but_not_down(make):
    """Continuous Z is allowed as sliced; from above down it would run into itself."""
    source = file_of([climbing()], lift=2.0)
    assert kinds(make, source, source) == set()
    assert kinds(make, file_of([climbing()[::-1]], lift=2.0), source) == {K.HEAD_MATERIAL}


def test_a_file_without_any_contour(make):
    """Nothing printed where something should be is missing, not a crash."""
    empty = file_of([])
    source = file_of([make.square(20.0, 20.0, 0.2)])
    assert kinds(make, empty, source) == {K.MISSING, K.E_TOTAL}


def test_nothing_moves_across_a_barrier(make, towers):
    """A file whose order is safe for the head may still break a temperature change."""
    source = file_of(towers)
    swapped = file_of([towers[i] for i in (1, 0, 2, 3, 4, 5, 6, 7)])
    contours = make.contours_of(towers)
    for at, due in ((1, {K.PRECEDENCE}), (2, set())):
        epoch = (np.arange(8) >= at).astype(np.int32)
        job = PrintJob("source", replace(contours, epoch=epoch))
        assert verify_motions(swapped, source, make.one_head_machine(), job=job).kinds() == due
