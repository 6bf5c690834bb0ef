"""PrusaSlicer's own file of head geometries."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from tests.makers.corpus import CORPUS

MODELS = ["mk3s", "mk4", "mk4s", "mini", "xl", "coreone", "coreonel", "ht90"]
NOZZLE = {"height": "0", "type": "convex", "polygons": ["-5,-5;5,-5; 5,5;-5,5"]}


def written(folder: Path, *printers: tuple[str, list[dict[str, object]]]) -> Path:
    file = folder / "geometries.json"
    entries = [{"printer_notes_regex": regex, "slices": slices} for regex, slices in printers]
    file.write_text(json.dumps({"printers": entries}))
    return file


def test_clockwise_boxes_are_turned(tmp_path):
    """The real file holds boxes whose corners run clockwise."""
    beam = {"height": "11", "type": "box", "polygons": ["-300,-23;300,-23;300,-35;-300,-35"]}
    file = written(tmp_path, (".*PRINTER_MODEL_A.*", [beam, NOZZLE]))
    low, high = load_machine(f"{file}:a").heads[0].slices
    assert (low.height_mm, high.height_mm) == (0.0, 11.0)
    x, y = high.polygons[0].T
    assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2 == 600 * 12


def test_slices_of_one_height_are_joined(tmp_path):
    """CORE One has two slices at 23 mm; both are part of the head."""
    more = {"height": "0", "type": "convex", "polygons": ["7,7;9,7;9,9"]}
    file = written(tmp_path, (".*PRINTER_MODEL_A.*", [NOZZLE, more]))
    (only,) = load_machine(f"{file}:A").heads[0].slices
    assert len(only.polygons) == 2


def test_first_matching_model_is_taken(tmp_path):
    """MK4 and MK4S differ by a look-ahead in the file; mixing them up is a crash."""
    small = {**NOZZLE, "polygons": ["-1,-1;1,-1;1,1"]}
    file = written(
        tmp_path,
        (".*PRINTER_MODEL_MK4(?!S).*", [NOZZLE]),
        (".*PRINTER_MODEL_MK4S.*", [small]),
    )
    assert len(load_machine(f"{file}:mk4").heads[0].slices[0].polygons[0]) == 4
    assert len(load_machine(f"{file}:mk4s").heads[0].slices[0].polygons[0]) == 3


def test_known_models_get_the_presets_bed(tmp_path):
    """The file names no bed; ours does."""
    file = written(tmp_path, (".*PRINTER_MODEL_MINI.*", [NOZZLE]))
    assert load_machine(f"{file}:MINI").bed_max == (180.0, 180.0)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({**NOZZLE, "polygons": ["0,0;9,0;1,1;0,9"]}, "polygon 1: it is concave at corner 3"),
        ({**NOZZLE, "polygons": ["0,0;9,0;nan,9"]}, "expected 'x,y;x,y;...'"),
        ({**NOZZLE, "polygons": ["0,0;9;9,9"]}, "expected 'x,y;x,y;...'"),
        ({**NOZZLE, "polygons": ["0,0;9,0;18,0"]}, "touches itself"),
        ({**NOZZLE, "type": "ball"}, "unknown kind 'ball'"),
        ({**NOZZLE, "height": "low"}, "expected a number"),
    ],
)
def test_shapes_that_are_none_are_refused(tmp_path, entry, message):
    """A head of the wrong shape is worse than no head."""
    file = written(tmp_path, (".*PRINTER_MODEL_A.*", [entry]))
    with pytest.raises(InputError) as error:
        load_machine(f"{file}:A")
    assert message in str(error.value)


def test_unknown_model_lists_those_of_the_file(tmp_path):
    """The line must be enough to choose the right one."""
    file = written(tmp_path, (".*PRINTER_MODEL_MK4(?!S).*", [NOZZLE]), (".*MODEL_XL.*", [NOZZLE]))
    with pytest.raises(InputError, match="no printer matches 'zx'; found: MK4, XL"):
        load_machine(f"{file}:zx")


def test_file_without_model_asks_for_it(tmp_path):
    """Which printer is meant cannot be guessed."""
    file = tmp_path / "geometries.json"
    file.write_text('{"printers": []}')
    with pytest.raises(InputError, match="which printer"):
        load_machine(str(file))


@pytest.mark.parametrize("content", [b"", b"[]", b"{", b'{"printers": 1}', b"\xff\xfe"])
def test_files_that_are_no_geometries_are_refused(tmp_path, content):
    """Foreign files get a line, not a traceback."""
    file = tmp_path / "geometries.json"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"geometries\.json"):
        load_machine(f"{file}:MK4")


@pytest.mark.shared
@pytest.mark.parametrize(
    "name", ["mk3s", "mk4", "mk4s", "mini", "xl", "coreone", "coreonel", "ht90"]
)
def test_presets_equal_prusas_file(name):
    """The presets were re-entered; a slip of the pen would be a wrong clearance."""
    file = CORPUS / "machines" / "geometries.json"
    if not file.exists():
        pytest.skip(f"no corpus at {CORPUS}")
    preset = load_machine(name).heads[0].slices
    theirs = load_machine(f"{file}:{name.upper()}").heads[0].slices
    assert [s.height_mm for s in preset] == [s.height_mm for s in theirs]
    for ours, other in zip(preset, theirs, strict=True):
        assert [p.tolist() for p in ours.polygons] == [p.tolist() for p in other.polygons]


@pytest.mark.parametrize("pattern", ["(a+)+$", ".*.*.*.*A", "[", "(?=(a|a)*)b", "A{9}"])
def test_a_pattern_that_may_take_for_ever_is_refused(tmp_path, pattern):
    """It comes from a file, and a repetition within a repetition takes all day."""
    file = written(tmp_path, (pattern, [NOZZLE]))
    with pytest.raises(InputError, match="no plain pattern"):
        load_machine(f"{file}:{'a' * 40}")


def test_a_preset_of_several_heads_lends_no_bed(tmp_path):
    """The file describes one head: two of a preset's were an internal error."""
    file = written(tmp_path, (".*", [NOZZLE]))
    machine = load_machine(f"{file}:dual-gantry")
    assert [head.name for head in machine.heads] == ["head"]
