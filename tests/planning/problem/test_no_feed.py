"""Prints whose file gives no feed: refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from decmcts.errors import InputError
from decmcts.planning.problem.print_problem import load

BEADS = "G1 X1 Y1\nG1 X9 Y1 E1\nG1 X9 Y9 E1\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "in.gcode"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("M83\nG1 Z.2\n" + BEADS, r"in\.gcode:4: no feed is ever given"),
        ("M83\nG1 Z.2 F0\n" + BEADS, r"in\.gcode:4: no feed is ever given"),
        ("M83\nG1 Z.2\n" + BEADS + "G1 X0 F600\nG1 X7 E1\n", r":4: no feed \(F\) above 0"),
        ("M83\nG1 Z.2 F600\n" + BEADS + "G1 X0 F0\nG1 X7 E1\n", r":7: no feed \(F\) above 0"),
    ],
)
def test_beads_without_a_feed_are_refused_in_one_line(text, said, tmp_path):
    """Firmwares take 25 or 50 mm/s then, or stop; 26 faults did not say so."""
    with pytest.raises(InputError, match=said):
        load(written(tmp_path, text), "voron24-300")


def test_a_start_code_without_a_feed_is_read(tmp_path):
    """It stays as it is: only beads are printed anew."""
    text = "M83\nG28\nG1 Z5\nG1 Z.2\n" + BEADS.replace("Y1 E1", "Y1 E1 F600")
    assert len(load(written(tmp_path, text), "voron24-300").job.contours) == 1
