"""Over the bed and not below it, whatever a machine says about its reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.formats.gcode import Motions
from decmcts.print.job import PrintJob
from decmcts.print.plan import ActionKind
from sim.faults import FaultKind as K
from sim.files.extent import check_file_extent, check_file_feeds
from sim.verify import verify_plan


def kinds(document, **options) -> set[K]:
    return verify_plan(document, **options).kinds()


def through(*points):
    """The second travel goes by way of these points."""

    def change(rows):
        travel = [r for r in rows if r["kind"] == ActionKind.TRAVEL][1]
        travel["path"] = np.vstack([travel["path"][:1], points, travel["path"][1:]])

    return change


@pytest.mark.parametrize("point", [(150.0, 150.0, -5.0), (201.0, 100.0, 9.0), (9.0, -21.0, 9.0)])
def test_a_travel_leaves_the_bed(make, point):
    """A nozzle at z = −5 over the bare bed, or beside bed and park, hits what is there."""
    plan = make.edited(make.tower_plan(), 0, through(point))
    assert K.OUT_OF_REACH in kinds(plan)


@pytest.mark.parametrize("point", [(150.0, 150.0, 0.5), (199.0, 100.0, 90.0), (-19.0, -19.0, 9.0)])
def test_over_bed_and_park_it_may_go(make, point):
    """Detours over the bed, as high as one likes, and beside the park are no fault."""
    assert kinds(make.edited(make.tower_plan(), 0, through(point))) == set()


def moved(document, by):
    contours = replace(document.contours, points=document.contours.points + np.array(by))

    def move(rows):
        for row in rows:
            park = (row["path"] == np.array(document.machine.heads[0].park)).all(axis=1)
            row["path"] = np.where(park[:, None], row["path"], row["path"] + np.array(by))

    return replace(document, contours=contours), move


def test_a_print_beside_the_bed_is_its_slicers_business(make):
    """Machines have their origin in a corner or in the middle: places are not judged."""
    document, move = moved(make.tower_plan(), (-150.0, -60.0, 0.0))
    assert kinds(make.edited(document, 0, move)) == set()


def test_a_print_below_the_bed_needs_a_source_that_prints_there(make):
    """With a source its own heights count; a plan alone is not believed."""
    document, move = moved(make.tower_plan(), (0.0, 0.0, -0.3))
    document = make.edited(document, 0, move)
    assert K.OUT_OF_REACH in kinds(document)
    assert kinds(document, source=PrintJob("source", document.contours)) == set()


def test_a_print_larger_than_the_bed(make):
    """No place on the bed holds it."""
    document = make.tower_plan()
    small = replace(document.machine, bed_max=(30.0, 200.0))
    assert K.OUT_OF_REACH in kinds(replace(document, machine=small))


def test_a_wait_stands_still(make):
    """A wait that goes somewhere is a travel nobody looked at."""

    def wait(rows, by):
        at = rows[2]["path"][0]
        still = {"begin_s": rows[1]["end_s"], "end_s": rows[1]["end_s"] + 4e-4}
        path = np.array([at, at + np.array([by, 0.0, 0.0]), at])
        row = {**rows[2], "kind": ActionKind.WAIT, "path": path, **still}
        return [*rows[:2], row, *rows[2:]]

    assert kinds(make.edited(make.tower_plan(), 0, lambda rows: wait(rows, 0.0))) == set()
    assert kinds(make.edited(make.tower_plan(), 0, lambda rows: wait(rows, 0.1))) == {K.WRONG_PATH}


def test_moving_takes_time(make):
    """A move that begins and ends at the same time is a feed no machine has."""

    def hurry(rows):
        rows[2]["end_s"] = rows[2]["begin_s"]

    assert kinds(make.edited(make.tower_plan(), 0, hurry)) == {K.TIMES}


def motions(points, feed, extrusion=None) -> Motions:
    m = len(points) - 1
    none = np.zeros(m)
    pushed = none if extrusion is None else np.array(extrusion, float)
    return Motions(
        np.array(points, float), pushed, np.array(feed, float), np.arange(m) + 1,
        np.full(m, -1), none, none, placed=np.arange(m) == 0,
    )  # fmt: skip


HOME, A, B = (0.0, 0.0, 0.0), (5.0, 5.0, 1.0), (9.0, 9.0, 1.0)


def test_files_stay_over_bed_and_source(make):
    """What the source itself does below the bed is its own; nothing goes lower or farther."""
    machine = make.one_head_machine()
    source = motions([HOME, HOME, A, (-9.0, 5.0, -0.5)], [0, 50, 50])
    assert check_file_extent(source, source, machine) == []
    for point in ((5.0, 5.0, -0.6), (-9.1, 5.0, 1.0), (5.0, 200.1, 1.0)):
        ours = motions([HOME, HOME, A, point], [0, 50, 50])
        (fault,) = check_file_extent(ours, source, machine)
        assert (fault.kind, fault.text[:6]) == (K.OUT_OF_REACH, "line 3")


def test_a_move_at_feed_0_is_a_fault(make):
    """It is judged like any move, and only the source's own are let through."""
    machine = make.one_head_machine()
    source = motions([HOME, HOME, A, B, A], [0, 0, 50, 50])
    assert check_file_feeds(source, source, machine) == []
    (fault,) = check_file_feeds(motions([HOME, HOME, A, B, A], [0, 0, 0, 50]), source, machine)
    assert (fault.kind, fault.text) == (K.FEED, "line 3 moves at feed 0")


@pytest.mark.parametrize("feed", [15.0, 41.0])
def test_filament_alone_moves_at_feeds_of_the_source(make, feed):
    """A retraction a hundred times as fast would strip the filament; one as slow would ooze."""
    machine = make.one_head_machine()
    source = motions([HOME, HOME, A, A, A, B], [0, 50, 20, 40, 50], [0, 0, -1, 1, 0])
    assert check_file_feeds(source, source, machine) == []
    ours = motions([HOME, HOME, A, A, A, B], [0, 50, 20, feed, 50], [0, 0, -1, 1, 0])
    (fault,) = check_file_feeds(ours, source, machine)
    assert fault.kind == K.FEED and fault.text.startswith("line 4 moves filament alone at")
    dots = motions([HOME, HOME, A, A, A, B], [0, 50, 20, feed, 50], [0, 0, -1, 0.003, 0])
    assert check_file_feeds(dots, source, machine) == []


def test_no_travel_is_faster_than_the_source_s_or_the_machine_s(make):
    source = motions([HOME, HOME, A, B, A], [0, 50, 60, 50])
    limits = make.one_head_machine().limits
    machine = replace(make.one_head_machine(), limits=replace(limits, travel_feed=55.0))
    for feed in (50, 60):
        ours = motions([HOME, HOME, A, B, A], [0, 50, feed, 50])
        assert check_file_feeds(ours, source, machine) == []
    ours = motions([HOME, HOME, A, B, A], [0, 50, 61, 50])
    (fault,) = check_file_feeds(ours, source, machine)
    assert fault.kind == K.FEED and fault.text.startswith("line 3 travels at 61")
    swift = replace(machine, limits=replace(limits, travel_feed=70.0))
    assert check_file_feeds(ours, source, swift) == []


def test_no_travel_is_slower_than_the_source_s(make):
    """A feed in mm/s for one in mm/min has a hot nozzle creep over the print for minutes."""
    machine = make.one_head_machine()
    source = motions([HOME, HOME, A, B, A], [0, 50, 60, 50])
    ours = motions([HOME, HOME, A, B, A], [0, 50, 1, 50])
    (fault,) = check_file_feeds(ours, source, machine)
    assert fault.kind == K.FEED and fault.text.startswith("line 3 travels at 1.000 mm/s")
