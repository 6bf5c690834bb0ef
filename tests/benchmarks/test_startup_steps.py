"""The steps of a run are told from what it says, so a changed word must not go unseen."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from startup import COLUMNS, step_seconds

LINES = [
    (1.0, "reading x.gcode"),
    (1.5, "reading x.gcode: compiling scan_lines, once on this machine; 0 of about 65 done"),
    (4.0, "dependency graph of 9 contours for mk4s"),
    (5.0, "searching (hybrid, 1 s)"),
    (6.5, "verifying"),
]


def test_each_step_lasts_until_the_next() -> None:
    """Compiling belongs to the step it was needed for."""
    found = step_seconds(LINES, 7.0)
    assert (found["start_s"], found["read_s"], found["graph_s"]) == (1.0, 3.0, 1.0)
    assert (found["search_begins_s"], found["search_s"], found["verify_s"]) == (5.0, 1.5, 0.5)


def test_a_run_that_says_nothing_has_no_steps() -> None:
    """A failed run still gets its row."""
    assert step_seconds([], 2.0) == dict.fromkeys(COLUMNS, 0.0)
