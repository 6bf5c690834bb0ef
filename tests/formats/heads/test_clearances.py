"""Heads made of the clearances a slicer states: never smaller than what it says."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.heads.clearances import (
    SETTINGS,
    Setting,
    clearance_head,
    clearance_machine,
    read_clearances,
)
from decmcts.formats.machines.own_machine import comment_settings
from decmcts.print.machine import Slice


def settings(**values: str) -> dict[str, Setting]:
    return {name: Setting(text, 7) for name, text in values.items()}


PRUSA = settings(
    extruder_clearance_radius="45", extruder_clearance_height="13", bed_shape="0x0,250x0,250x210"
)
ORCA = settings(
    extruder_clearance_radius="57",
    extruder_clearance_height_to_rod="25",
    extruder_clearance_height_to_lid="256",
    nozzle_height="4.76",
    printable_area="-110x-100,110x-100,110x100,-110x100",
    printer_model="Some Printer",
)


def fills(slices: tuple[Slice, ...], x: float, y: float, z: float) -> bool:
    """Whether the head fills a point, by half planes."""
    for part in slices:
        for polygon in part.polygons:
            edge = np.roll(polygon, -1, axis=0) - polygon
            left = edge[:, 0] * (y - polygon[:, 1]) - edge[:, 1] * (x - polygon[:, 0])
            if z >= part.height_mm and (left >= -1e-9).all():
                return True
    return False


def test_without_a_nozzle_height_the_disc_begins_at_the_tip():
    """PrusaSlicer states none, and Prusa's own heads have ducts at the tip's height."""
    head = clearance_machine(read_clearances(PRUSA), source="test").heads[0]
    for angle in np.linspace(0.0, 2.0 * np.pi, 97):
        x, y = 45.0 * np.cos(angle), 45.0 * np.sin(angle)
        assert fills(head.slices, x, y, 0.0)
        assert not fills(head.slices, 1.02 * x, 1.02 * y, 12.9)
    assert fills(head.slices, 250.0, -210.0, 13.0)


def test_below_the_nozzle_height_there_is_the_nozzle():
    """OrcaSlicer says how far the nozzle stands out: what is lower may be passed."""
    machine = clearance_machine(read_clearances(ORCA), source="test")
    slices = machine.heads[0].slices
    assert fills(slices, 5.0, 5.0, 0.0)
    assert not fills(slices, 8.0, 0.0, 4.7)
    assert fills(slices, 57.0, 0.0, 4.76)
    assert not fills(slices, 60.0, 0.0, 24.9)
    assert fills(slices, -220.0, 200.0, 25.0)
    assert (machine.bed_min, machine.bed_max) == ((-110.0, -100.0), (110.0, 100.0))
    assert machine.name == "Some Printer by its clearances"
    assert "nozzle_height" in machine.source


def test_what_takes_most_room_counts():
    """Lists have a value an extruder, and Bambu Studio a second radius for one side."""
    found = read_clearances(
        settings(
            extruder_clearance_radius="40,57",
            extruder_clearance_max_radius="68",
            extruder_clearance_height_to_rod="36,34",
            extruder_clearance_height_to_lid="90",
        )
    )
    assert (found.radius, found.rod, found.nozzle) == (68.0, 34.0, None)
    low_lid = settings(
        extruder_clearance_radius="40",
        extruder_clearance_height_to_rod="36",
        extruder_clearance_height_to_lid="30",
    )
    assert read_clearances(low_lid).rod == 30.0


@pytest.mark.parametrize(("shared", "height"), [("0", None), ("1", 2.5)])
def test_a_second_nozzle_may_be_as_low_as_the_first(shared, height):
    """Two nozzles on one carriage: the idle one is no higher than the nozzle's height says."""
    two = ORCA | settings(
        nozzle_height="4,2.5", nozzle_diameter="0.4,0.4", single_extruder_multi_material=shared
    )
    assert read_clearances(two).nozzle == height


def test_a_rod_below_the_nozzle_height_still_bars_everything():
    """Whoever swaps the two numbers must not get a head of nothing."""
    slices = clearance_head(30.0, 4.0, 3.0, 200.0)
    assert fills(slices, 150.0, 150.0, 3.0)
    assert [part.height_mm for part in slices] == [0.0, 3.0, 4.0]


def test_nothing_stated_is_no_head():
    """The caller says so in its own words."""
    assert read_clearances({}) is None
    assert read_clearances(settings(extruder_clearance_radius="", nozzle_height="2")) is None


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        ({"extruder_clearance_radius": "0"}, "extruder_clearance_radius is '0'"),
        ({"extruder_clearance_radius": "-45"}, "'-45'"),
        ({"extruder_clearance_radius": "1e9"}, "up to 1000 mm"),
        ({"extruder_clearance_radius": "nan"}, "'nan'"),
        ({"extruder_clearance_radius": "45,inf"}, "'inf'"),
        ({"extruder_clearance_height": "50%"}, "'50%'"),
        ({"extruder_clearance_height": "1e9"}, "'1e9'"),
        ({"nozzle_height": "-1"}, "nozzle_height is '-1'"),
        ({"nozzle_height": "25"}, "up to 20 mm"),
        ({"bed_shape": "0x0,0x10"}, "bed_shape"),
        ({"bed_shape": "0,0,10,10"}, "bed_shape"),
        ({"bed_shape": "0x0,nanx1,2x2"}, "bed_shape"),
        ({"bed_shape": "0x0,1e9x0,1e9x1e9"}, "bed_shape"),
    ],
)
def test_a_value_that_cannot_be_is_one_line(wrong, word):
    """A head of a silly size would be believed by planner and judge alike."""
    with pytest.raises(InputError) as error:
        read_clearances(PRUSA | settings(**wrong), "part.gcode")
    assert str(error.value).startswith("part.gcode:7: ")
    assert word in str(error.value)


@pytest.mark.parametrize("missing", ["extruder_clearance_radius", "extruder_clearance_height"])
def test_half_a_head_is_refused(missing):
    """One number without the other says nothing of the rest of the head."""
    half = {name: value for name, value in PRUSA.items() if name != missing}
    with pytest.raises(InputError, match=f"no {missing}"):
        read_clearances(half, "part.gcode")


def test_settings_are_read_from_either_end_of_a_file():
    """OrcaSlicer writes them at the top, PrusaSlicer at the bottom, some with CRLF."""
    text = b"; nozzle_height = 2.5\r\nG28\r\n;extruder_clearance_radius=45\r\n; other = 1\r\n"
    found = comment_settings(text, SETTINGS)
    assert found == {
        "nozzle_height": Setting("2.5", 1),
        "extruder_clearance_radius": Setting("45", 3),
    }


def test_two_values_for_one_setting_are_refused():
    """Nobody can tell which of two heads is on the machine."""
    text = b"; nozzle_height = 2.5\nG28\n; nozzle_height = 4\n"
    with pytest.raises(InputError, match=r"a.gcode:3: nozzle_height is '4' here and '2.5'"):
        comment_settings(text, SETTINGS, "a.gcode")
