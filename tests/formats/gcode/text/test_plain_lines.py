"""Line numbers and lone carriage returns, dealt with where a file is read."""

from __future__ import annotations

import time

import pytest

from decmcts.errors import InputError
from decmcts.formats.gcode import read_gcode, write_gcode
from decmcts.formats.gcode.text.source_text import (
    first_number,
    load_text,
    refuse_lone_returns,
    refuse_odd_blanks,
    without_numbers,
)
from decmcts.planning.problem.source import machine_for
from decmcts.print.contours import Role
from decmcts.print.toolpath import Toolpath
from sim.files.written import verify_written
from tests.direct_actions import direct_actions
from tests.formats.gcode.text.packed import POOR


def numbered(text: bytes, *, checksum: bool = False) -> bytes:
    """Return a text as Bambu Studio's option "add line number" writes it, or as a host sends it."""
    rows = []
    for n, row in enumerate(text.splitlines(), 1):
        line = b"N%d %s" % (n, row)
        if checksum and row and not row.startswith(b";"):
            total = 0
            for byte in line:
                total ^= byte
            line += b"*%d" % total
        rows.append(line)
    return b"\n".join(rows) + b"\n"


@pytest.mark.parametrize(
    ("line", "plain"),
    [
        (b"N12 ;TYPE:Skirt", b";TYPE:Skirt"),
        (b"N12;TYPE:Skirt", b";TYPE:Skirt"),
        (b" n 12 G1 X1*71", b"G1 X1"),
        (b"N12 G1 X1 *71 ; end", b"G1 X1; end"),
        (b"N12 G1 X1 ; 3*71", b"G1 X1 ; 3*71"),
        (b"N12 M117 2*3 cubes", b"M117 2*3 cubes"),
        (b"N7", b""),
        (b"G1 X1*71", b"G1 X1*71"),
        (b"NEXT_LAYER 5", b"NEXT_LAYER 5"),
        (b"; N5 is a layer", b"; N5 is a layer"),
        (b"M117 N5", b"M117 N5"),
        (b"N3 G1 X5\r", b"G1 X5\r"),
    ],
)
def test_a_number_and_its_checksum_are_taken_off_and_nothing_else(line, plain):
    """What a firmware reads of a line stays."""
    assert without_numbers(line) == plain
    assert without_numbers(b"G28\n" + line + b"\n") == b"G28\n" + plain + b"\n"


def test_a_byte_order_mark_is_no_command(tmp_path):
    """An editor that saves as "UTF-8 with BOM" made the judge miss a command of that name."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_bytes(b"\xef\xbb\xbf" + POOR)
    assert load_text(source) == POOR
    job, document = read_gcode(source)
    actions = direct_actions(job, Toolpath.as_sliced(len(job.contours)))
    write_gcode(document, job, actions, out)
    assert verify_written(out, job, document, machine_for(None, source)[0]).ok


@pytest.mark.parametrize("checksum", [False, True])
def test_a_numbered_file_reads_as_the_plain_one(checksum, tmp_path):
    """Printer, roles and layers stand in comments behind numbers."""
    plain, with_numbers = tmp_path / "plain.gcode", tmp_path / "numbered.gcode"
    plain.write_bytes(POOR)
    with_numbers.write_bytes(numbered(POOR, checksum=checksum))
    assert load_text(with_numbers) == POOR
    assert machine_for(None, with_numbers)[0].name == "Bambu Lab P1S by its clearances"
    job, document = read_gcode(with_numbers)
    assert set(job.contours.role.tolist()) == {Role.EXTERNAL_PERIMETER}
    assert job.contours.layer.tolist() == read_gcode(plain)[0].contours.layer.tolist()
    assert document.preamble == read_gcode(plain)[1].preamble


def test_what_is_written_has_no_number_anywhere(tmp_path):
    """Numbers out of turn stop a firmware, so start code, print and end code have none."""
    source, out = tmp_path / "in.gcode", tmp_path / "out.gcode"
    source.write_bytes(numbered(POOR))
    job, document = read_gcode(source)
    write_gcode(document, job, direct_actions(job, Toolpath.as_sliced(len(job.contours))), out)
    assert not [row for row in out.read_bytes().split(b"\n") if row.lstrip()[:1] in (b"N", b"n")]


@pytest.mark.parametrize(
    ("text", "line"),
    [(b"N1 G28\n", 1), (b"G28\n;\n n4 G1\n", 3), (b"G28\n; N4\n", None), (b"", None)],
)
def test_the_first_line_with_a_number_is_told(text, line):
    """The judge names it: no result of ours has one."""
    assert first_number(text) == line


def test_messages_name_the_line_of_the_file(tmp_path):
    """Lines are emptied, never dropped."""
    source = tmp_path / "in.gcode"
    source.write_bytes(numbered(b"G28\n; a\n\nG20\nG1 X5 E1 F100\n"))
    with pytest.raises(InputError, match=r"in\.gcode:4: inches"):
        read_gcode(source)


def test_long_lines_of_blanks_cost_linear_time():
    """A pattern that tries again at every blank took minutes for one line."""
    text = b"N1 M117 a" + b" " * 200_000 + b"b*x\n" + b" " * 200_000 + b"\nN2 " + b"*" * 200_000
    began = time.perf_counter()
    assert without_numbers(text).startswith(b"M117 a  ")
    assert time.perf_counter() - began < 2.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"G28\rG1 X5\r", "carriage return alone"),
        (b"G28\n;a\rG1 X5\n", r"in:2: a carriage return within a line"),
        (b"G28\r\rG1 X5", "carriage return alone"),
    ],
)
def test_a_lone_carriage_return_is_refused_for_what_it_is(text, said):
    """A firmware that ends a line there runs what others take for a comment."""
    with pytest.raises(InputError, match=said):
        refuse_lone_returns(text, "in")


@pytest.mark.parametrize(
    "text", [b"G28\r\nG1 X5\r\n", b"G28\r\r\nG1\r\r\n", b"G28\n", b"G28\r", b""]
)
def test_usual_line_ends_pass(text):
    """CRLF, also doubled by an editor, and a file that stops within one."""
    refuse_lone_returns(text, "in")


@pytest.mark.parametrize("blank", [b"\x0b", b"\x0c", b"\x1f"])
@pytest.mark.parametrize("line", [b"@G1 Z0.1", b"G1@X5", b"G1 X5@", b" @(c) G1 X5", b"@; a"])
def test_a_blank_of_some_firmwares_is_refused_in_a_command(blank, line):
    """Klipper strips it and moves; the scanner took the line for an unknown command."""
    text = b"G28\n; a" + blank + b"\n" + line.replace(b"@", blank) + b"\n"
    with pytest.raises(InputError, match=f"in:3: a control character .0x{blank[0]:02x}"):
        refuse_odd_blanks(text, "in")


def test_control_characters_in_comments_pass():
    """They command nothing there, and tabs are blanks to all."""
    refuse_odd_blanks(b"G28 ; a\x0cb\n;\x1f\nG1\tX5\n", "in")
