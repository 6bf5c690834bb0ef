"""Which machine a print is for when nobody names one."""

from __future__ import annotations

import pytest

from decmcts.errors import InputError
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.machines.own_machine import machine_of_text
from tests.makers.corpus import CORPUS

CLEARANCES = """
; bed_shape = 0x0,200x0,200x200,0x200
; extruder_clearance_height = {height}
; extruder_clearance_radius = {radius}
; printer_model = {model}
"""


def text(model: str = "", *, radius: float = 40.0, height: float = 15.0) -> bytes:
    return CLEARANCES.format(model=model, radius=radius, height=height).encode()


def test_a_printer_with_a_measured_head_is_taken_by_its_name():
    """Prusa's own shapes leave far more freedom than a disc."""
    machine, said = machine_of_text(text("MK4S"))
    assert machine.name == "mk4s"
    assert "MK4S" in said


def test_any_other_printer_has_the_head_its_slicer_states():
    """Most printers have no preset; their files say enough to be planned."""
    machine, said = machine_of_text(text("Workshop 3"))
    assert machine.name == "Workshop 3 by its clearances"
    assert "extruder_clearance_radius" in said
    assert "40 mm" in said
    assert "defaults" not in said


def test_the_name_the_slicer_hands_over_comes_before_the_one_in_the_file():
    """SLIC3R_PRINTER_MODEL is what is printed on now."""
    assert machine_of_text(text("Workshop 3"), printer="MINI")[0].name == "mini"


def test_defaults_nobody_set_are_named_as_such():
    """20 and 20 mm stand in files of printers with heads three times as wide."""
    assert "defaults" in machine_of_text(text(radius=20.0, height=20.0))[1]


def test_no_printer_and_no_clearances_is_refused():
    """A head taken out of the air would be proven safe and crash."""
    with pytest.raises(InputError, match=r"a.gcode: .*--machine.*measure-your-head"):
        machine_of_text(b"G28\nG1 X1 E1\n", "a.gcode")


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.skipif(not CORPUS.is_dir(), reason=f"no corpus of real prints at {CORPUS}")
def test_real_files_with_clearances_have_a_machine():
    """27 prints of a dozen slicers state them; none may need a machine file."""
    heads = {}
    for path in sorted((CORPUS / "gcode").glob("*.gcode.gz")):
        text = load_text(path)
        if b"; extruder_clearance_radius" in text:
            heads[path.name] = machine_of_text(text, path)[0]
    assert len(heads) == 27
    assert {"mk4s", "mini", "xl", "ENDER3V2 by its clearances"} <= {
        machine.name for machine in heads.values()
    }
    for machine in heads.values():
        assert machine.bed_max > machine.bed_min
        assert machine.heads[0].slices[0].height_mm == 0.0
