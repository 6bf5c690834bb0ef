"""Each bead is laid under the settings of the source, by the judge's own reading."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.formats.gcode.dialects.dialect import Kind, classify
from sim.faults import Fault
from sim.files import settings
from sim.files.settings import TravelSettings, settings_of, travelling
from tests.makers.settings import CASES, laid_under, made

TWO_WAYS = {"advance of each tool", "advance of all tools"}  # no firmware reads it in both ways
SOURCE = b"M204 P900 T4000\nM106 S127.5\nG1 X1 E1\nM107\nM900 K.2\nG1 X2 E1\nM106 S51\nG1 X3 E1\n"
BEADS = np.array([3, 6, 8])


def check_settings(text: bytes, source: bytes, *beads: np.ndarray) -> list[Fault]:
    """Compare what two texts set."""
    return settings.check_settings(settings_of(text), settings_of(source), *beads)


def faults_of(text: str, beads: list[int]) -> list[str]:
    """Return the faults of a file that lays the three beads in these lines."""
    return [fault.text for fault in check_settings(text.encode(), SOURCE, np.array(beads), BEADS)]


def test_the_same_settings_in_other_words_are_no_fault() -> None:
    """Beads of one state come together; words of one command may stand in several."""
    text = "M204 P900\nM204 T4000\nM106 S127.50\nG1 X1 E1\nM900 K.2\nM106 S51\nG1 X3 E1\n"
    assert not faults_of(text + "M107 (off)\nG1 X2 E1\n", [4, 9, 7])


def test_nothing_is_set_sooner_than_in_the_source() -> None:
    """What the machine begins with cannot be set again."""
    text = "M204 P900 T4000\nM900 K.2\nM106 S127.5\nG1 X1 E1\nM107\nG1 X2 E1\nM106 S51\nG1 X3 E1\n"
    said = "line 4 is printed with M900 K .2, in the source with not set (line 3 there)"
    assert said in faults_of(text, [4, 6, 8])


@pytest.mark.parametrize(
    ("begin", "end"),
    [("M486 S3", "M486 S-1"), ("EXCLUDE_OBJECT_START NAME=a", "EXCLUDE_OBJECT_END NAME=a"),
     ("M624 AQA=", "M625"), ("; printing object a.stl id:0", "; stop printing object a.stl id:0"),
     (";(start printing object, unique label id: 3", "; stop printing object, unique label id: 3")],
)  # fmt: skip
def test_each_bead_belongs_to_the_object_it_is_of_in_the_source(begin: str, end: str) -> None:
    """A bead of another object stays out when that one is cancelled."""
    lines = ["G1 X1 E1", begin, "G1 X2 E1", end, "G1 X3 E1"]
    source, at = "\n".join(lines).encode(), np.array([1, 3, 5])
    assert not check_settings(source, source, at, at)
    for k in (1, 3):
        text = "\n".join([*lines[:k], "; gone", *lines[k + 1 :]]).encode()
        assert len(check_settings(text, source, at, at)) == 1
    assert not check_settings(source, source, at[[1, 0]], at[[1, 0]])


def test_each_bead_is_laid_with_the_tool_of_the_source() -> None:
    """The first of all is 0 where none is chosen."""
    source, at = b"G1 X1 E1\nT1\nG1 X2 E1\nT0\nG1 X3 E1\n", np.array([1, 3, 5])
    assert not check_settings(source.replace(b"T0", b"T 00"), source, at, at)
    assert len(check_settings(source.replace(b"T1", b"T2"), source, at, at)) == 1
    assert len(check_settings(source.replace(b"T1\n", b";\n"), source, at, at)) == 1


@pytest.mark.parametrize(
    ("lost", "said"),
    [
        ("M204 P900 T4000", "line 3 is printed with M204 P not set, in the source with 900"),
        ("M107", "line 6 is printed with fan 127.5, in the source with 0 (line 6 there)"),
        ("M900 K.2", "line 6 is printed with M900 K not set, in the source with .2"),
        ("M106 S51", "line 8 is printed with fan 0, in the source with 51 (line 8 there)"),
        ("M106 S127.5", "line 3 is printed with fan 0, in the source with 127.5 (line 3 there)"),
    ],
)
def test_a_setting_that_vanished_is_found(lost: str, said: str) -> None:
    """The reader that made the file may have taken it for a comment."""
    text = SOURCE.decode().replace(lost, "")
    assert said in faults_of(text, BEADS.tolist())[0]


def test_settings_of_tools_and_fans_are_their_own() -> None:
    """What is said of one tool does not hold for another."""
    source = b"M900 T0 K.1\nM900 T1 K.3\nM106 P1 S9\nG1 X1 E1\n"
    text = b"M900 T0 K.1\nM900 T1 K.1\nM106 P2 S9\nG1 X1 E1\n"
    at = np.array([4])
    said = [
        fault.text.split(" is printed with ")[1] for fault in check_settings(text, source, at, at)
    ]
    assert said == [
        "M900 T1 K .1, in the source with .3 (line 4 there)",
        "fan 1 not set, in the source with 9 (line 4 there)",
        "fan 2 9, in the source with not set (line 4 there)",
    ]


TRAVELS = b"M204 S3000\nG1 X9\nM204 S900\nG1 X1 E1\nM204 S3000\nG1 X9\nM204 S500\nG1 X1 E1\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TRAVELS, []),
        (TRAVELS.replace(b"M204 S3000\nG1 X9\nM204 S500", b"M204 T3000\nG1 X9\nM204 S500"), []),
        (
            b"G1 X1 E1\nG1 X9\nM204 S900\nG1 X1 E1\nG1 X9\nM204 S500\nG1 X1 E1\n",
            ["line 5 travels with M204 T 900, and the source never does"],  # line 2: not set yet
        ),
        (
            TRAVELS + b"M204 P500 T20\nG1 X9\nG1 X1 E1\n",
            ["line 10 travels with M204 T 20, and the source never does"],
        ),
    ],
)
def test_travels_are_as_quick_as_in_the_source(text: bytes, said: list[str]) -> None:
    """A bead's acceleration is not a travel's, whatever stands above it in another order."""
    moves = [k for k, line in enumerate(text.splitlines(), 1) if line == b"G1 X9"]
    known = TravelSettings.of(settings_of(TRAVELS), np.array([2, 6]))
    assert list(known.differing(settings_of(text), np.array(moves))) == said


def test_what_travels_is_told_from_what_lays_and_what_homes() -> None:
    """Nothing above the first bead and below the last: there the source's own lines stand."""
    x = np.array([0.0, 5.0, 9.0, 20.0, 20.01, 0.0, 30.0, 40.0, 50.0])
    points = np.stack([x, 0.0 * x, 0.0 * x], axis=1)
    extrusion = np.array([0.0, 1.0, 0.0, 0.0, 0.0, -0.5, 1.0, 0.0])
    placed = np.array([False, False, False, False, True, False, False, False])
    assert travelling(points, extrusion, placed).tolist() == [2]


@pytest.mark.parametrize("speed", ["S={fan}", "S1.2.3", "S="])
def test_a_speed_that_is_no_number_is_compared_as_it_stands(speed: str) -> None:
    """Macros and templates hold anything; the judge must not stumble over it."""
    source, at = f"M106 {speed}\nG1 X1 E1\n".encode(), np.array([2])
    assert not check_settings(source, source, at, at)


@pytest.mark.parametrize("name", CASES)
def test_a_command_that_vanished_is_found_where_a_firmware_would_differ(name: str) -> None:
    """And only there: a false alarm would keep a good result from being written."""
    take, settings = CASES[name]
    source = made(settings, settings[0] + "\n")
    rows = source.split("\n")
    beads = np.array([k + 1 for k, row in enumerate(rows) if row.startswith("G1 X") and "E" in row])
    due, found = laid_under(source, take), 0
    for k in (k for k, row in enumerate(rows) if row in settings):
        text = "\n".join([*rows[:k], "; gone", *rows[k + 1 :]])
        differs = laid_under(text, take) != due
        faults = check_settings(text.encode(), source.encode(), beads, beads)
        assert bool(faults) >= differs, rows[k]
        assert not faults or differs or name in TWO_WAYS, (rows[k], faults)
        found += differs
    assert found > 1


@pytest.mark.parametrize(("second", "faults"), [("S60", 0), ("S20", 1)])
def test_beads_that_are_alike_may_be_exchanged(second: str, faults: int) -> None:
    """One over the other, in one state each: which is which nobody can tell."""
    source = b"M106 S20\nG1 X1 E1\nM106 S60\nG1 X1 E1\n"
    text = f"M106 {second}\nG1 X1 E1\nM106 S20\nG1 X1 E1\n".encode()
    at = np.array([2, 4])
    assert len(check_settings(text, source, at, at, np.array([7, 7]))) == faults
    assert len(check_settings(text, source, at, at, np.array([7, 8]))) == 2 - (faults == 1)


def test_a_name_that_begins_like_a_command_is_none() -> None:
    """`M106ON` is a macro, whatever it does; `M106S9` is a fan's speed."""
    at = np.array([2])
    assert not check_settings(b"M106ON\nG1 X1 E1\n", b"M106ON\nG1 X1 E1\n", at, at)
    assert settings_of(b"M106ON\n") == {} and settings_of(b"M106S9\n") == {"fan": [(1, "9")]}
    assert classify(b"M106ON").kind == Kind.BARRIER and classify(b"M106S9").slot == "fan"
    assert classify(b"G28X0").text == "homing"
