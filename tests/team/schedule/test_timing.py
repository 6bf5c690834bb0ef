"""Times of actions: by hand, against the written file, and beside the judge's model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.feasibility.build import build_graph
from decmcts.formats.gcode import read_gcode, write_gcode
from decmcts.formats.gcode.controller.duration import print_time
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.plan import PlanDocument
from decmcts.print.toolpath import Toolpath
from decmcts.samples import sample_path
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.timing import action_times
from sim.replay.least import least_arrivals
from tests.limits import LIMITS

SETTINGS = ProcessSettings(
    travel_feed=150.0, retract_mm=2.0, retract_feed=40.0, unretract_feed=20.0, z_feed=5.0
)
LINE = [(0.0, 0.0, 0.2), (40.0, 0.0, 0.2)]  # at 40 mm/s
NEXT = [(40.0, 50.0, 0.2), (0.0, 50.0, 0.2)]


def seconds(job: PrintJob, travel: list[tuple[float, float, float]], **options) -> list[float]:
    """Time the print of LINE, a travel, and the print of NEXT."""
    paths = [np.array(p, float) for p in (LINE, travel, NEXT)]
    offsets = np.cumsum([0, *map(len, paths)])
    contour, zero = np.array([0, -1, 1], np.int32), np.zeros(3, np.int32)
    rests, limits = options.pop("rests", False), options.pop("limits", LIMITS)
    return action_times(
        job, limits, np.concatenate(paths), offsets, contour, zero > 0, zero, rests=rests
    ).seconds.tolist()


@pytest.fixture
def job(case_of) -> PrintJob:
    return replace(case_of(LINE, NEXT).job, settings=SETTINGS)


def test_a_long_travel_is_retracted(job):
    """Print 40 mm, pull 2 mm, travel 50 mm, push 2 mm, print 40 mm; every change is a stop."""
    printing = 40 / 40 + 40 / 1000
    travel = 2 / 40 + 40 / 800 + 50 / 150 + 150 / 2000 + 2 / 20 + 20 / 800
    found = seconds(job, [LINE[1], NEXT[0]])
    assert found == pytest.approx([printing, travel, printing])
    assert seconds(job, [LINE[1], NEXT[0]], rests=True) == pytest.approx(found)


def test_a_lift_has_its_own_feed(job):
    """Up and down 1 mm at the source's 5 mm/s and the axis' 100 mm/s²."""
    over = [LINE[1], (40.0, 0.0, 1.2), (40.0, 50.0, 1.2), NEXT[0]]
    more = seconds(job, over)[1] - seconds(job, [LINE[1], NEXT[0]])[1]
    assert more == pytest.approx(2 * (1 / 5 + 5 / 100))


def test_a_short_travel_is_not_retracted(job):
    """The source's own threshold counts."""
    near = replace(job, settings=replace(SETTINGS, retract_min_travel_mm=60.0))
    assert seconds(near, [LINE[1], NEXT[0]])[1] == pytest.approx(50 / 150 + 150 / 2000)


def test_a_wipe_goes_back_along_the_bead(job):
    """A wipe that went on ahead let a bead end at speed, too soon for the judge."""
    wiping = replace(job, settings=replace(SETTINGS, wipe_mm=3.0, wipe_filament_mm=2.0))
    limits = replace(LIMITS, jerk=(10.0, 10.0, 0.2, 30.0))
    plain, wiped = (
        seconds(one, [LINE[1], NEXT[0]], limits=limits)[0] for one in (job, wiping)
    )  # fmt: skip
    assert wiped == pytest.approx(plain)


def test_each_segment_keeps_the_acceleration_set_for_it(job):
    """M204 in the source; the second contour prints at 250 mm/s²."""
    slow = replace(job, acceleration=np.array([np.nan, np.nan, 250.0, 250.0]))
    one, _, two = seconds(slow, [LINE[1], NEXT[0]])
    assert one == pytest.approx(40 / 40 + 40 / 1000)
    assert two == pytest.approx(40 / 40 + 40 / 250)


@pytest.mark.slow
def test_a_plan_takes_as_long_as_its_file(tmp_path):
    """The planner's time of the print is that of the text it becomes, to 1 %."""
    source = sample_path("four_nuts.gcode.gz")
    job, document = read_gcode(source)
    machine = load_machine("mk3s")
    machine = replace(machine, limits=machine.limits.under(job.limits))
    graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
    plan = schedule(job, machine, graph, [Toolpath.as_sliced(len(job.contours))])
    write_gcode(document, job, plan.heads[0], tmp_path / "out.gcode")
    file = print_time(tmp_path / "out.gcode", machine.limits)
    assert plan.makespan_s == pytest.approx(file.total_s, rel=0.01)
    document_of = PlanDocument("", machine, job.contours, graph.pairs(), plan, {})
    actions = plan.heads[0]
    judged = least_arrivals(document_of, actions, job, rests=False)[
        actions.path_offsets[1:] - 1
    ].sum()
    assert judged == pytest.approx(plan.makespan_s, rel=0.15)  # the judge knows no filament
