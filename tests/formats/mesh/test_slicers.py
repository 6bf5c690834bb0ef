"""Commands of real slicers: what each is told, and what cannot work is refused before it starts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from decmcts.errors import InputError
from decmcts.formats.mesh.options import Bed, SliceOptions
from decmcts.formats.mesh.slicers import Request, Slicer, command_for, config_paths, slicer_of

BED = Bed((0.0, -10.0), (180.0, 170.0), 160.0)
OPTIONS = SliceOptions(layer_height=0.15, density=0.35, perimeters=4, temperature=225.0, bed=BED)


def request(folder: Path, **changes) -> Request:
    values = {"program": Path("/bin/slicer"), "mesh": folder / "part.stl", "folder": folder,
              "options": OPTIONS, "given": frozenset()}  # fmt: skip
    return Request(**{**values, **changes})


def profile(path: Path, **content) -> Path:
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    ("name", "slicer"),
    [("prusa-slicer", Slicer.PRUSA), ("PrusaSlicer-2.9.2.AppImage", Slicer.PRUSA),
     ("prusa-slicer-console.exe", Slicer.PRUSA), ("OrcaSlicer_Linux_V2.3.AppImage", Slicer.ORCA),
     ("orca-slicer", Slicer.ORCA), ("CuraEngine", Slicer.CURA), ("cat", None)],
)  # fmt: skip
def test_a_program_is_known_by_its_name(name, slicer):
    """Each takes other words; a guess would start a stranger with them."""
    assert slicer_of(Path("/opt") / name) is slicer


def test_prusaslicer_is_told_all_without_a_configuration(tmp_path):
    """Its own defaults know no printer: a part off the bed, no fan, no lift at the end."""
    command = command_for(Slicer.PRUSA, request(tmp_path))
    words = command.words
    assert words[words.index("--center") + 1] == "90,80"
    assert words[words.index("--layer-height") + 1] == "0.15"
    assert words[words.index("--fill-density") + 1] == "35%"
    assert words[words.index("--perimeters") + 1] == "4"
    assert words[words.index("--first-layer-temperature") + 1] == "225"
    ((printer, text),) = command.files
    assert words[words.index("--load") + 1] == str(printer)
    assert "bed_shape = 0x-10,180x-10,180x170,0x170\n" in text
    assert r"end_gcode = G1 Z{min(max_layer_z+10,160)} F600\nG1 X5 Y165 F6000\nM104 S0\n" in text
    assert words[-3:] == ("-o", str(command.output), str(tmp_path / "part.stl"))


def test_a_configuration_is_changed_only_where_the_user_said_so(tmp_path):
    """Defaults of ours that override somebody's tuned profile would be a nasty surprise."""
    asked = request(tmp_path, config=(Path("/my.ini"),), given=frozenset({"density"}))
    command = command_for(Slicer.PRUSA, asked)
    assert command.files == ()
    assert "--fill-density" in command.words
    assert not {"--layer-height", "--perimeters", "--temperature"} & set(command.words)
    assert command.words[command.words.index("--load") + 1] == "/my.ini"


def test_curaengine_is_told_what_its_front_end_would_derive(tmp_path):
    """The engine takes settings as they are: a density alone would change no line of infill."""
    asked = request(tmp_path, config=(Path("/fdmprinter.def.json"),))
    words = command_for(Slicer.CURA, asked).words
    assert words[:4] == ("/bin/slicer", "slice", "-j", "/fdmprinter.def.json")
    for part in (words[: words.index("-e0")], words[words.index("-e0") :]):  # printer, extruder
        said = dict(word.split("=", 1) for word in part if "=" in word)
        assert float(said["infill_line_distance"]) == pytest.approx(2 * 0.45 / 0.35, rel=1e-4)
        assert said["wall_line_count"] == "4" and said["layer_height"] == "0.15"
        assert said["material_diameter"] == "1.75"  # 2.85 in the base definition
        assert said["machine_width"] == "180" and said["mesh_position_y"] == "-90"


def test_curaengine_without_definitions_is_refused(tmp_path):
    """It stops at the first of over 500 settings nobody gave it."""
    with pytest.raises(InputError, match=r"definition file; add --slicer-config fdmprinter"):
        command_for(Slicer.CURA, request(tmp_path))


def test_orcaslicer_gets_edited_copies_of_profiles(tmp_path):
    """Its command line has no single settings: what the user asked for goes into the profiles."""
    config = (
        profile(tmp_path / "a.json", type="filament", nozzle_temperature=["200"]),
        profile(tmp_path / "b.json", type="machine", printable_height="250"),
        profile(tmp_path / "c.json", type="process", wall_loops="2", layer_height="0.2"),
    )
    folder = tmp_path / "made"
    given = frozenset({"perimeters", "temperature"})
    command = command_for(Slicer.ORCA, request(folder, config=config, given=given))
    files = {path.name: json.loads(text) for path, text in command.files}
    assert files["process.json"] == {"type": "process", "wall_loops": "4", "layer_height": "0.2"}
    assert files["machine.json"] == {"type": "machine", "printable_height": "250"}
    assert files["filament.json"]["nozzle_temperature"] == ["225"]
    words = command.words
    loaded = f"{folder / 'machine.json'};{folder / 'process.json'}"
    assert words[words.index("--load-settings") + 1] == loaded
    assert words[words.index("--load-filaments") + 1] == str(folder / "filament.json")
    assert words[words.index("--slice") + 1] == "0"
    assert command.output == folder / "plate_1.gcode"


@pytest.mark.parametrize(
    ("contents", "said"),
    [
        ([{"type": "machine"}], "a machine and a process are needed"),
        ([{"type": "process", "inherits": "0.20mm Standard"}], "inherits from '0.20mm Standard'"),
        ([{"type": "printer"}], "names no type of profile"),
        ([["a list"]], "is no profile of OrcaSlicer: expected an object"),
    ],
)
def test_profiles_orcaslicer_would_misread_are_refused(tmp_path, contents, said):
    """It takes its own defaults for what is inherited, without a word."""
    config = []
    for k, content in enumerate(contents):
        path = tmp_path / f"{k}.json"
        path.write_text(json.dumps(content))
        config.append(path)
    with pytest.raises(InputError, match=said):
        command_for(Slicer.ORCA, request(tmp_path, config=tuple(config)))


def test_a_configuration_that_is_not_there_is_refused(tmp_path):
    """A slicer that falls back to its defaults would print something else."""
    with pytest.raises(InputError, match="no such file"):
        config_paths(str(tmp_path / "absent.ini"))
    assert config_paths(None) == ()
