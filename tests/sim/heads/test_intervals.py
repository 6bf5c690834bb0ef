"""Signals of one head keep apart in time: merged by the writer, found anew by the judge."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.formats.gcode.writing.sync_points import number_sync_points
from decmcts.print.plan import ACTION_END, JointPlan
from sim.faults import FaultKind
from sim.heads.file import read_head_file
from sim.heads.sync import Knowledge
from tests.sim.heads.test_together import Made

WORDS = re.compile(r"SYNC_(SIGNAL|PASSED) N=(\d+)")


def both_ways(plan: JointPlan) -> JointPlan:
    """The left head's last waits are for two places in one bead: point 1, and its end.

    The bead's second line takes 0.15 s (3 mm at 20 mm/s).
    """
    left, right = plan.heads
    points = np.array([1, ACTION_END], np.int32)
    action = np.array([5, 5], np.int32)
    return JointPlan((replace(left, after_action=action, after_point=points), right))


def signals(path: Path) -> list[str]:
    return [word for word, _ in WORDS.findall(path.read_text())]


@pytest.mark.parametrize(("interval_s", "moving"), [(0.0, 2), (0.1, 2), (0.2, 1)])
def test_signals_too_near_are_one_at_the_later_point(tmp_path, interval_s, moving):
    """Klipper drops changes nearer than 0.1 s: whoever counts would wait for ever."""
    made = Made(tmp_path, change=both_ways, release="point", interval_s=interval_s)
    assert made.judged().faults == ()
    assert signals(made.paths[1]).count("PASSED") == moving


def test_the_judge_sees_signals_too_near(tmp_path):
    """By times of its own: what moves take at the feeds of the file, wipes too."""
    made = Made(tmp_path, change=both_ways, release="point")
    made.interval_s = 0.2
    verdict = made.judged()
    assert verdict.kinds() == {FaultKind.COMMAND} and "signals 0.180 s after" in str(verdict.faults)


def test_heads_stand_between_signals_at_rest(tmp_path):
    """A head that is done right behind its last print says both, one after the other."""
    made = Made(tmp_path, release="point", interval_s=0.1)
    assert made.judged().faults == ()
    text = made.paths[0].read_text()
    made.paths[0].write_text(re.sub(r"G4 P100[^\n]*\n", "", text))
    assert made.judged().ok is ("G4 P100" not in text)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("interval_s", [0.05, 0.3, 2.0, 1e3])
def test_no_interval_makes_heads_wait_for_each_other(tmp_path, seed, interval_s):
    """Signals that come later make waits longer; a cycle would stop both heads for ever."""
    rng = np.random.default_rng(seed)

    def points(plan: JointPlan) -> JointPlan:
        heads = [
            replace(
                head,
                after_point=rng.choice([1, 2, ACTION_END], len(head.after_point)).astype(np.int32),
            )
            for head in plan.heads
        ]
        return JointPlan(tuple(heads))

    made = Made(tmp_path, change=points, release="point", interval_s=interval_s)
    known = Knowledge([read_head_file(path).syncs for path in made.paths])
    assert not known.stuck and not known.faults
    assert made.judged().faults == ()


def test_without_an_interval_all_stays(tmp_path):
    """Machines that signal at rest, and those that tell any two apart."""
    made = Made(tmp_path, change=both_ways, release="point")
    free = number_sync_points(made.plan, made.job, "point")
    assert free.at_rest == frozenset() and not free.apart
    rests = number_sync_points(made.plan, made.job, "action")
    assert rests.signals == free.signals and rests.at_rest == set(free.signals)
    late = number_sync_points(made.plan, made.job, "point", 0.2)
    assert len(late.signals) + len(late.passed) < len(free.signals) + len(free.passed)
