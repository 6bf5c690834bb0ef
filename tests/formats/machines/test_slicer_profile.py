"""Profiles of slicers as machines: chains of inheritance, configurations, and what is missing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine

BASE = {
    "type": "machine",
    "name": "base",
    "extruder_clearance_radius": "47",
    "extruder_clearance_height_to_rod": "34",
    "extruder_clearance_height_to_lid": "90",
    "printable_area": ["0x0", "220x0", "220x200", "0x200"],
    "machine_max_speed_x": ["400", "200"],
}
MINE = {"type": "machine", "inherits": "base", "nozzle_height": "3", "printer_model": "Mine"}


def write(folder: Path, name: str, content: object) -> str:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return str(path)


def heights(name: str) -> list[float]:
    return [part.height_mm for part in load_machine(name).heads[0].slices]


def test_a_profile_has_what_it_inherits_and_its_own_before_that(tmp_path):
    """OrcaSlicer's profiles state what differs only; the clearances stand two files up."""
    write(tmp_path, "base.json", BASE | {"inherits": "root", "nozzle_height": "2"})
    write(tmp_path, "root.json", {"extruder_clearance_radius": "99", "machine_max_jerk_x": ["9"]})
    machine = load_machine(write(tmp_path, "mine.json", MINE))
    assert machine.bed_max == (220.0, 200.0)
    assert [part.height_mm for part in machine.heads[0].slices] == [0.0, 3.0, 34.0]
    assert 47.0 <= abs(machine.heads[0].slices[1].polygons[0]).max() < 48.0
    assert (machine.limits.max_feed[0], machine.limits.jerk[0]) == (400.0, 9.0)
    assert "mine.json" in machine.source


def test_a_user_profile_finds_the_slicers_own(tmp_path):
    """Users' profiles and those of the slicer lie in two branches of one folder."""
    write(tmp_path, "Orca/system/Vendor/machine/base.json", BASE)
    assert heights(write(tmp_path, "Orca/user/default/machine/mine.json", MINE)) == [0, 3, 34]


def test_a_profile_that_is_not_there_is_named(tmp_path):
    """A head made of half a profile would be too small."""
    with pytest.raises(InputError, match=r"mine.json: .*inherits from 'base'.*put base.json"):
        load_machine(write(tmp_path, "mine.json", MINE))


def test_profiles_in_a_circle_are_refused(tmp_path):
    """Two files that name each other must not hang the program."""
    write(tmp_path, "base.json", BASE | {"inherits": "mine"})
    with pytest.raises(InputError, match="circle"):
        load_machine(write(tmp_path, "mine.json", MINE))


@pytest.mark.parametrize(
    ("content", "word"),
    [
        ("{", "no JSON"),
        ("[1]", "expected an object"),
        ({"type": "machine"}, "no clearances"),
        (BASE | {"extruder_clearance_radius": ["nan"]}, "extruder_clearance_radius is 'nan'"),
        (BASE | {"printable_area": [{"a": 1}]}, "printable_area"),
        ({"printers": []}, "which printer"),
    ],
)
def test_what_is_no_profile_is_one_line(tmp_path, content, word):
    """Process and filament profiles lie beside those of machines, and look alike."""
    with pytest.raises(InputError, match=r"p.json") as error:
        load_machine(write(tmp_path, "p.json", content))
    assert word in str(error.value)


def test_an_exported_configuration_is_a_machine(tmp_path):
    """PrusaSlicer's File > Export > Export Config: everything in one list."""
    flat = (
        "# exported\nextruder_clearance_height = 25\nextruder_clearance_radius = 55\n"
        "machine_max_feedrate_x = 400\nbed_shape = 0x0,100x0,100x100,0x100\n"
        "inherits = Some System Preset\n"
    )
    machine = load_machine(write(tmp_path, "config.ini", flat))
    assert [part.height_mm for part in machine.heads[0].slices] == [0.0, 25.0]
    assert machine.bed_max == (100.0, 100.0)
    assert machine.limits.max_feed[0] == 400.0


def test_a_byte_order_mark_is_no_part_of_the_first_setting(tmp_path):
    """The first setting of a profile that an editor had saved was lost."""
    plain, marked = tmp_path / "plain.ini", tmp_path / "marked.ini"
    text = b"extruder_clearance_radius = 30\nextruder_clearance_height = 25\n"
    plain.write_bytes(text)
    marked.write_bytes(b"\xef\xbb\xbf" + text)
    heads = [load_machine(str(path)).heads[0] for path in (plain, marked)]
    assert [len(head.slices) for head in heads] == [2, 2]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("layer_height = 0.2\n", "no clearances"),
        ("extruder_clearance_radius = 40\n", "no extruder_clearance_height"),
        ("\nextruder_clearance_radius = 0\nextruder_clearance_height = 20\n", "p.ini:2: "),
        ("# exported\n[printer:a]\ninherits = b\n", "p.ini:2: is a bundle"),
    ],
)
def test_an_ini_that_tells_no_head_is_one_line(tmp_path, text, word):
    """The line number is there where the value stands in the file."""
    with pytest.raises(InputError) as error:
        load_machine(write(tmp_path, "p.ini", text))
    assert word in str(error.value)
