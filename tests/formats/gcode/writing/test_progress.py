"""Progress and times: what the source states of its own order is not left standing."""

from __future__ import annotations

import io
import re

import numpy as np

from decmcts.formats.gcode import read_gcode, write_gcode
from decmcts.print.toolpath import Toolpath
from tests.direct_actions import direct_actions
from tests.formats.gcode.writing.endings import same_ending

TOLD = "G28\nM83\nM73 P0 R84\nM73 Q0 S168\nM73 C20\n;LAYER_CHANGE\n;Z:0.2\n"
LINES = "".join(
    f"G1 X{20 * k} Y0 Z.2 F9000\nM73 P{9 * k} R{84 - k}\nM73 Q{9 * k} S{168 - k}\n"
    f"G1 X{20 * k + 9} E.5 F900\n"
    for k in range(1, 9)
)
END = ";TIME_ELAPSED:5040\nM73 P100 R0\nM104 S0\nM84\n"


def written(read, text: str = LINES + END, start: str = TOLD) -> str:
    job, document = read(text, start=start)
    actions = direct_actions(job, Toolpath.as_sliced(len(job.contours)))
    k = np.arange(len(actions.kind))
    object.__setattr__(actions, "begin_s", 600.0 * k)
    object.__setattr__(actions, "end_s", 600.0 * (k + 1.0))
    out = io.StringIO()
    write_gcode(document, job, actions, out)
    return out.getvalue()


def test_silent_mode_is_counted_with_normal_mode(read):
    """A printer in silent mode showed the source's 84 minutes for the whole print."""
    found = re.findall(r"M73 Q(\d+) S(\d+)", written(read))
    assert found[0] == ("0", "300") and len(found) > 8
    left = [int(s) for _, s in found]
    assert left == sorted(left, reverse=True) and left[-1] < 30


def test_the_start_codes_progress_is_the_plans(read):
    """The first figure a display shows is that of this file: 15 actions of 10 minutes."""
    text = written(read)
    assert text.index("M73 P0 R150") < text.index("M73 Q0 S300") < text.index(";LAYER_CHANGE")
    assert "R84" not in text and "S168" not in text


def test_time_to_the_next_stop_is_left_out(read):
    """Other work comes before a colour change now."""
    assert "\nM73 C" not in written(read)


def test_a_dialect_without_minutes_gets_none(read):
    """MakerBot's M73 knows a percentage only."""
    text = re.sub(r"(M73 P\d+) R\d+\nM73 Q.*", r"\1", LINES)
    told = re.findall(r"^M73.*", written(read, text + "M84\n", start="G28\nM83\n;LAYER:0\n"), re.M)
    assert len(told) > 5 and all(re.fullmatch(r"M73 P\d+", line) for line in told)


def test_an_ending_with_other_times_and_line_ends_is_the_same(read, tmp_path):
    """Comments command nothing, and an editor may have turned CRLF to LF."""
    read((TOLD + LINES + END).replace("\n", "\r\n").encode())
    _, document = read_gcode(tmp_path / "in.gcode")
    out = tmp_path / "out.gcode"
    out.write_bytes((TOLD + LINES + END.replace("5040", "4000")).encode())
    assert same_ending(document, out) == []
