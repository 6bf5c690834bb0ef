"""Judging files of several heads is linear in the print, waits, dwells and barriers included."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decmcts.formats.gcode import read_gcode, write_head_gcode
from decmcts.print.plan import JointPlan
from sim.heads.file import read_head_file
from sim.heads.together import verify_heads
from tests.makers.parked import parked
from tests.sim.heads.test_together import END, PARKS, START, actions_of
from tests.work import bytecodes, grows_linearly

Judged = tuple[list[Path], JointPlan, object, object]


def layers(count: int) -> str:
    """Return layers of four beads, with a barrier above each but the first."""
    return "".join(
        ("M104 S205\nM400\n" if k > 1 else "")
        + f";LAYER_CHANGE\n;Z:{0.2 * k:.1f}\n;HEIGHT:0.2\nM106 S{20 * (k % 9)}\nG1 Z{0.2 * k:.1f}\n"
        + "".join(
            f"G1 X{x} Y{10 * k} F9000\nG1 E1 F2400\nG1 X{x + 9} E.5 F900\nG1 E-1 F2400\n"
            for x in (0, 30, 60, 90)
        )
        for k in range(1, count + 1)
    )


def files_of(count: int, folder: Path) -> Judged:
    """Return files of two heads that wait for each other, and dwell, in every layer."""
    source = folder / f"in_{count}.gcode"
    source.write_text(START + layers(count) + END)
    job, document = read_gcode(source)
    ours = [c for k in range(count) for c in (4 * k, 4 * k + 1)]
    theirs = [c for k in range(count) for c in (4 * k + 3, 4 * k + 2)]
    waits = range(4, 4 * count, 4)
    left = actions_of(job, "left", ours, PARKS[0], {k: [(1, k - 3)] for k in waits})
    right = actions_of(job, "right", theirs, PARKS[1], {k: [(0, k - 1)] for k in waits})
    plan = JointPlan(
        tuple(
            replace(actions, after_lag_s=np.full(len(actions.after_lag_s), 0.25))
            for actions in (left, right)
        )
    )
    paths = [folder / f"out_{count}_{actions.head}.gcode" for actions in plan.heads]
    for k, path in enumerate(paths):
        write_head_gcode(document, job, plan, k, path, machine=parked(plan, PARKS))
    return paths, plan, job, document


def test_each_edge_wait_and_move_is_looked_at_once(tmp_path: Path) -> None:
    """One part of 15 490 contours took minutes: all dwells were found anew for each edge."""

    def work(count: int) -> int:
        paths, plan, job, document = files_of(count, tmp_path)

        def judge() -> None:
            assert verify_heads(parked(plan, PARKS), paths, plan, job, document).ok

        return bytecodes(judge, within=("sim.", "decmcts."))

    assert grows_linearly(work, 8)


@pytest.mark.parametrize("spoil", ["G4 P250", "SYNC_WAIT"])
def test_the_last_of_many_dwells_and_waits_still_counts(tmp_path: Path, spoil: str) -> None:
    """What is found once for a file must still be found for its last edge."""
    paths, plan, job, document = files_of(6, tmp_path)
    text = paths[1].read_text()
    at = text.rindex(spoil)
    paths[1].write_text(text[:at] + text[text.index("\n", at + 5) + 1 :])
    assert not verify_heads(parked(plan, PARKS), paths, plan, job, document).ok


def test_dwells_between_lines_are_those_strictly_between(tmp_path: Path) -> None:
    """A dwell at the line of a wait or of a move is not between them."""
    paths, *_ = files_of(4, tmp_path)
    rests = read_head_file(paths[0]).rests
    first, second = rests.dwells[:2]
    assert len(rests.dwells) == 3
    assert rests.between_s(first - 1, second + 1) == 0.5
    assert rests.between_s(first, second + 1) == rests.between_s(first - 1, second) == 0.25
    assert rests.between_s(first, second) == rests.between_s(second, first) == 0.0
