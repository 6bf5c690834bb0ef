"""Times of whole files: by hand, and against a slicer's own estimate."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from decmcts.formats.gcode.controller import limits
from decmcts.formats.gcode.controller.duration import text_time
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.print.machine import MotionLimits
from decmcts.samples import sample_path
from tests.limits import LIMITS

ROOT = Path(__file__).parents[4]
START = "G90\nM83\nG92 X0 Y0 Z0 E0\n"


def seconds(text: str, machine: MotionLimits = LIMITS, **options: bool) -> float:
    return text_time((START + text).encode(), machine, **options).total_s


def test_a_print_a_travel_and_a_retraction():
    """Each by its own acceleration, from rest to rest: no jerk, so every change is a stop."""
    text = "G1 X100 E5 F6000\nG1 E-2 F2400\nG1 Y50 F9000\nG1 E2 F1200\n"
    printing = 100 / 100 + 100 / 1000
    pulling, pushing = 2 / 40 + 40 / 800, 2 / 20 + 20 / 800
    travel = 50 / 150 + 150 / 2000
    assert seconds(text) == pytest.approx(printing + pulling + travel + pushing)


def test_dwells_count_and_stop_the_head():
    """G4 P is in milliseconds, S in seconds."""
    whole = seconds("G1 X100 F6000\n")
    assert seconds("G1 X50 F6000\nG4 P500\nG1 X100\nG4 S2\n") > whole + 2.5
    assert seconds("G1 X50 F6000\nG1 X100\n") == pytest.approx(whole)


def test_firmware_retraction_takes_its_time():
    """G10 and G11 move M207's length at its feed, though no E is written."""
    text = "M207 S2 F2400\nG1 X10 E1 F600\n{}G1 X60 F9000\n{}"
    bare = seconds(text.format("", ""))
    assert seconds(text.format("G10\n", "G11\n")) == pytest.approx(bare + 2 * (2 / 40 + 40 / 800))


def test_firmware_retraction_as_the_settings_state_it():
    """Without M207 the slicer's comments say what G10 and G11 move."""
    said = "; retract_length = 2\n; retract_speed = 40\n; deretract_speed = 20\n"
    text = "G1 X10 E1 F600\n{}G1 X60 F9000\n{}"
    bare = seconds(text.format("", ""))
    due = 2 / 40 + 40 / 800 + 2 / 20 + 20 / 800
    assert seconds(said + text.format("G10\n", "G11\n")) == pytest.approx(bare + due)


@pytest.mark.parametrize("count", [1, 200])
def test_settings_are_looked_for_once_however_often_it_retracts(count, monkeypatch):
    """Each look goes through the whole text: one a G10 took minutes for a common file."""
    looked = []
    found = limits.setting
    monkeypatch.setattr(
        limits, "setting", lambda text, name: looked.append(name) or found(text, name)
    )
    seconds("G10\nG1 X10 F6000\nG11\nG1 X0 E1\n" * count)
    assert len(looked) == len(set(looked)) == 3


def test_settings_that_change_on_the_way_count_from_there():
    """M204 between two moves changes only the second; M220 halves the feed."""
    one, two = 100 / 100 + 100 / 1000, 100 / 100 + 100 / 500
    assert seconds("G1 X100 E5 F6000\nG4\nM204 P500\nG1 X0 E5\n") == pytest.approx(one + two)
    assert seconds("M220 S50\nG1 X100 E5 F6000\n") == pytest.approx(100 / 50 + 50 / 1000)


def test_whose_limits_count():
    """A file's M203 wins unless the machine's are asked for."""
    text = "M203 X50\nG1 X100 E5 F6000\n"
    assert seconds(text) == pytest.approx(100 / 50 + 50 / 1000)
    assert seconds(text, own_limits=False) == pytest.approx(100 / 100 + 100 / 1000)


def test_homing_and_setting_the_origin_take_no_time():
    """Slicers leave them out too; a jump of the origin must not look like a travel."""
    plain = seconds("G1 X10 F600\n")
    assert seconds("G28\nG1 X10 F600\nG92 X500\n") == pytest.approx(plain)


def test_nothing_and_one_move():
    """The smallest files."""
    assert seconds("") == 0.0
    assert seconds("G1 X0 F600\n") == 0.0


def test_jerk_makes_a_print_faster():
    """The more an axis may jump, the less is lost in corners."""
    text = "".join(f"G1 X{k % 2} Y{k} E.1 F6000\n" for k in range(40))
    jerky = replace(LIMITS, jerk=(10.0, 10.0, 1.0, 5.0))
    assert seconds(text, jerky) < seconds(text)


def estimate(text: bytes) -> float:
    """Return the seconds PrusaSlicer wrote into its file."""
    match = re.search(rb"estimated printing time \(normal mode\) = ([^\r\n]*)", text)
    assert match is not None
    unit = {b"d": 86400, b"h": 3600, b"m": 60, b"s": 1}
    return float(sum(int(n) * unit[u] for n, u in re.findall(rb"(\d+)([dhms])", match[1])))


@pytest.mark.slow
@pytest.mark.slicers
@pytest.mark.parametrize("flavor", ["marlin", "marlin2", "reprapfirmware"])
def test_prusaslicers_own_estimate(tmp_path, flavor):
    """The examples' plate as PrusaSlicer slices it now: within 2 % of what it says itself."""
    if shutil.which("prusa-slicer") is None:
        pytest.skip("prusa-slicer is not installed (apt-get install prusa-slicer)")
    out = tmp_path / "plate.gcode"
    words = ["--load", str(ROOT / "examples/prusa_slicer.ini"), "--gcode-flavor", flavor]
    words += ["--default-acceleration", "1000", "--perimeter-acceleration", "600"]
    words += ["--first-layer-acceleration", "400", "--machine-limits-usage", "emit_to_gcode"]
    words += ["--retract-lift", "0.3", "-g", "-o", str(out), str(sample_path("four_nuts.stl"))]
    subprocess.run(["prusa-slicer", *words], check=True, capture_output=True, timeout=120)
    text = load_text(out)
    assert text_time(text, MotionLimits()).total_s == pytest.approx(estimate(text), rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_nuts", "plate"])
def test_the_examples_take_as_long_as_their_slicer_says(name):
    """Two plates sliced by PrusaSlicer 2.5.0, whose estimate stands in the file: within 1 %."""
    text = load_text(sample_path(f"{name}.gcode.gz"))
    assert text_time(text, MotionLimits()).total_s == pytest.approx(estimate(text), rel=0.01)


def test_dots_and_vertical_beads_are_of_the_print():
    """Braille ends with dots, which were left out; a file of dots alone had no print time."""
    dots = "".join(f"G1 X{10 * k} F6000\nG1 E1.5 F60\nG1 E-1 F2400\n" for k in (1, 2, 3))
    pillar = "G1 X60 F6000\nG1 E1 F2400\nG1 Z4 E.6 F240\n"
    for body in (dots, "G1 X5 E1 F600\nG1 E-1 F2400\n" + dots, dots + pillar):
        said = text_time((START + body).encode(), LIMITS)
        assert said.print_s > 0.9 * said.total_s - 0.5
    purged = text_time((START + "G1 E30 F60\nG1 X10 F6000\nG1 X20 E1 F600\n").encode(), LIMITS)
    assert purged.print_s < 2.0 < 30.0 < purged.total_s
