"""The files of several heads run against each other, by a printer made for this test."""

from __future__ import annotations

import io
import random
import re
from dataclasses import replace

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.gcode import read_gcode, write_head_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.options import NO_QUALITY
from decmcts.planning.problem.print_problem import load
from decmcts.print.plan import ActionKind, JointPlan, end_edges
from decmcts.print.toolpath import Toolpath
from decmcts.samples import sample_path
from decmcts.team.engine.space import build_space
from decmcts.team.schedule.joint_plan import schedule
from tests.formats.gcode.writing.test_head_files import PARKS, TEXT, head_of
from tests.makers.parked import parked

WORD = re.compile(r"([XYZEF])(-?[\d.]+)")
END = "M104 S0\nM140 S0\nM84\n"
RELATIVE = "; by X\nG90\nM83\nG28\n;LAYER_CHANGE\n"


class Controller:
    """One head's file, line by line: position, filament and the action each move belongs to."""

    def __init__(self, text: str, head, job) -> None:
        self.lines = text.splitlines()
        self.head, self.job, self.at = head, job, 0
        self.position = np.full(3, np.nan)
        self.e, self.relative, self.laid = 0.0, False, 0.0
        self.action, self.due = -1, []
        self.begun: dict[int, int] = {}  # action -> time its first move was made
        self.ended: dict[int, int] = {}
        self.off = -1  # time the end code ran

    def next_action(self, now: int) -> None:
        """Begin actions until one makes a move."""
        while not self.due:
            if self.action >= 0:
                self.ended.setdefault(self.action, now)
            self.action += 1
            assert self.action < len(self.head), f"a move no action has: {self.lines[self.at]}"
            self.due = list(self.head.action_path(self.action)[1:])
            here = self.head.action_path(self.action)[0]
            while self.due and np.allclose(self.due[0], here, atol=1e-9):
                self.due.pop(0)

    def step(self, now: int, given: set[str]) -> bool:
        """Run one line; False if it has to wait."""
        line = self.lines[self.at].split(";")[0].strip()
        if line.startswith("SYNC_WAIT") and line.split("N=")[1] not in given:
            return False
        self.at += 1
        if line.startswith("SYNC_SIGNAL"):
            given.add(line.split("N=")[1])
        elif line in ("M82", "M83"):
            self.relative = line == "M83"
        elif line == "G90":
            self.relative = False  # as Marlin does
        elif line.startswith("G92 E"):
            self.e = float(line[5:])
        elif line == "M140 S0":
            self.off = now
        elif line.startswith("G1 "):
            self.move(dict(WORD.findall(line)), now)
        return True

    def move(self, words: dict[str, str], now: int) -> None:
        to = np.array([float(words.get(a, p)) for a, p in zip("XYZ", self.position, strict=True)])
        pushed = 0.0
        if "E" in words:
            e = float(words["E"])
            pushed = e if self.relative else e - self.e
            self.e += pushed
        moved = not np.array_equal(to, self.position, equal_nan=True)
        parked = np.isfinite(self.position).all()
        self.position = to
        if not moved or not parked:
            return
        if pushed < 0.0:  # a wipe: along the bead just printed, before anyone is told
            assert self.head.kind[self.action] == ActionKind.PRINT and not self.due
            return
        if not self.due and self.head.kind[max(self.action, 0)] == ActionKind.PRINT:
            here = self.head.action_path(self.action)[-1]
            if np.allclose(to, here, atol=2e-3) and "E" not in words:
                return
        self.next_action(now)
        assert np.allclose(to, self.due.pop(0), atol=2e-3), self.lines[self.at - 1]
        self.begun.setdefault(self.action, now)
        if pushed > 0.0:
            self.laid += pushed
        if not self.due:
            self.ended[self.action] = now


def run(files: list[str], plan: JointPlan, job, seed: int) -> list[Controller]:
    """Run all files, whichever head may go next chosen at random; fails on a deadlock."""
    heads = [Controller(t, h, job) for t, h in zip(files, plan.heads, strict=True)]
    rng, given, now = random.Random(seed), set[str](), 0
    while busy := [h for h in heads if h.at < len(h.lines)]:
        rng.shuffle(busy)
        burst = rng.choice((1, 3, 200))
        moved = next((h for h in busy if h.step(now, given)), None)
        assert moved is not None, [h.lines[h.at] for h in busy]
        for _ in range(burst):
            now += 1
            if moved.at == len(moved.lines) or not moved.step(now, given):
                break
        now += 1
    return heads


def check(files: list[str], plan: JointPlan, job, seed: int) -> None:
    heads = run(files, plan, job, seed)
    for head, actions in zip(heads, plan.heads, strict=True):
        for k in range(len(actions)):
            for other, waited in actions.after(k):
                ended = [t for a, t in heads[other].ended.items() if a <= waited]
                begun = [t for a, t in head.begun.items() if a >= k]
                assert not ended or not begun or max(ended) < min(begun)
    laid = sum(h.laid for h in heads)
    assert laid == pytest.approx(job.contours.extrusion.sum(), abs=1e-3)
    last = max((t for h in heads for t in h.ended.values()), default=0)
    assert all(h.off > last for h in heads), "the bed goes cold under a head that prints"


def written(document, job, plan: JointPlan, parks) -> list[str]:
    out = []
    for h in range(len(parks)):
        stream = io.StringIO()
        write_head_gcode(document, job, plan, h, stream, machine=parked(plan, parks))
        out.append(stream.getvalue())
    return out


@pytest.mark.parametrize("seed", range(6))
def test_no_timing_breaks_the_order_or_cools_the_bed(read, seed):
    """Controllers drift apart; the order, the filament and the end must not depend on it."""
    job, document = read(TEXT + END, start=RELATIVE)
    heads = (
        head_of(job, "left", [0, 1], PARKS[0], {3: [(1, 1)]}),
        head_of(job, "right", [3, 2], PARKS[1], {1: [(0, 1)]}),
    )
    plan = JointPlan(heads)
    check(written(document, job, plan, PARKS), plan, job, seed)


def test_modes_are_said_again_after_absolute_positions(read):
    """G90 makes E absolute in Marlin: every relative E after it would be a wrong amount."""
    job, document = read(TEXT + END, start=RELATIVE)
    plan = JointPlan((head_of(job, "left", [0, 1, 2, 3], PARKS[0], {}),))
    lines = written(document, job, plan, PARKS[:1])[0].splitlines()
    last = max(k for k, line in enumerate(lines) if line == "G90")
    assert lines[last + 1] == "M83"


def test_dropped_purge_lines_leave_e_where_they_led(read):
    """An absolute retraction behind a purge that was left out must not become a blob."""
    start = "G90\nM82\nG28\nG92 E0\nG1 X60 E9 F1000\nG1 E8 F2400\n;LAYER_CHANGE\n"
    text = "G1 X0 Y0 Z.2 F9000\nG1 E9\nG1 X9 E9.5 F900\nG1 X20 Y0\nG1 X29 E10\n"
    job, document = read(text + END, start=start)
    plan = JointPlan((head_of(job, "left", [0, 1], PARKS[0], {}),))
    lines = written(document, job, plan, PARKS[:1])[0].splitlines()
    assert lines[lines.index("G1 E8 F2400") - 1] == "G92 E9"


def test_wipe_is_over_before_the_signal(read):
    """A wipe sweeps beside the planned path; others may be there once the signal is given."""
    gap = "G1 X{0} E-.4 F6000\nG1 E-.6 F2400\nG1 X{1}\nG1 E1 F2400\n"
    text = "G1 X0 Y0 Z.2 F9000\nG1 X9 E.5 F900\n"
    for k in range(1, 4):
        text += gap.format(20 * k - 13, 20 * k) + f"G1 X{20 * k + 9} E.5 F900\n"
    job, document = read(text + END, start=RELATIVE)
    heads = (
        head_of(job, "left", [0, 1], PARKS[0], {}),
        head_of(job, "right", [3, 2], PARKS[1], {0: [(0, 1)]}),
    )
    plan = JointPlan(heads)
    left = written(document, job, plan, PARKS)[0].splitlines()
    assert job.settings.wipe_mm > 0
    pulls = [k for k, line in enumerate(left) if " E-0" in line and line.startswith("G1 X")]
    given = [k for k, line in enumerate(left) if line.startswith("SYNC_SIGNAL")]
    assert pulls and pulls[0] < given[1]
    check(written(document, job, plan, PARKS), plan, job, 1)


def test_a_start_that_moves_the_origin_is_refused(read):
    """G92 X after moves that are left out would shift the whole print into the other head."""
    start = "G90\nM83\nG28\nG1 X5 F1000\nG92 X0\n;LAYER_CHANGE\n"
    job, document = read(TEXT + END, start=start)
    plan = JointPlan((head_of(job, "left", [0, 1, 2, 3], PARKS[0], {}),))
    with pytest.raises(InputError, match="G92 X0"):
        written(document, job, plan, PARKS[:1])


def test_head_without_work_parks(read):
    """Homing leaves a head in the bed's corner, where the plan takes nobody to be."""
    job, document = read(TEXT + END, start=RELATIVE)
    busy = head_of(job, "left", [0, 1, 2, 3], PARKS[0], {})
    idle = head_of(job, "right", [3], PARKS[1], {})
    none = np.zeros(0, np.int32)
    idle = type(idle)(
        "right", none.astype(np.int8), none, none.astype(bool), none, np.zeros(1, np.int64),
        np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(1, np.int64), none, none,
        *end_edges(0),
    )  # fmt: skip
    lines = written(document, job, JointPlan((busy, idle)), PARKS)[1].splitlines()
    x, y, z = PARKS[1]
    at = lines.index(f"G1 Z{z:.3f} F600")
    assert lines[at + 1].startswith(f"G1 X{x:.3f} Y{y:.3f}")
    assert at < lines.index("SYNC_SIGNAL N=2")


@pytest.mark.long
def test_shipped_plate_runs_in_any_timing():
    """A real plate on two heads: both files follow the plan's paths and nothing else."""
    path = sample_path("plate.gcode.gz")
    machine = replace(load_machine("dual-gantry"), release="action")  # signals at rest
    loaded = load(path, machine, NO_QUALITY)
    job, document = read_gcode(path)
    space = build_space(job, machine)
    middle = np.median(job.contours.start[:, 0])
    left = (job.contours.start[:, 0] < middle) & space.eligible[:, 0] | ~space.eligible[:, 1]
    rows = np.arange(len(job.contours))
    paths = [
        Toolpath(r.astype(np.int32), np.zeros(len(r), bool), np.zeros(len(r), np.int32), r)
        for r in (rows[left], rows[~left])
    ]
    plan = schedule(job, loaded.machine, loaded.graph, paths)
    files = written(document, job, plan, [h.park for h in machine.heads])
    check(files, plan, job, 3)
