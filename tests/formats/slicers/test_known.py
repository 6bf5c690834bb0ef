"""What is known of slicers, one value each."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from decmcts.formats.gcode.dialects.dialect import Kind, classify, role_of
from decmcts.formats.machines.machine_file import preset_names
from decmcts.formats.slicers import known, slic3r
from decmcts.formats.slicers.dialect import Dialect
from decmcts.print.contours import Role


def test_a_module_in_the_folder_is_a_dialect():
    """A new slicer is one file, and nothing has to name it."""
    files = {path.stem for path in Path(known.__file__).parent.glob("*.py")}
    assert len(known.DIALECTS) == len(files - {"__init__", "dialect", "known"}) > 5
    assert slic3r.DIALECT in known.DIALECTS


@pytest.mark.parametrize("field", ["signs", "values", "printers"])
def test_no_word_means_two_things(field):
    """All words are read together: the slicer that wrote a file is not asked for."""
    pairs = {pair for each in known.DIALECTS for pair in getattr(each, field).items()}
    assert len(pairs) == len(known.together(field))


def test_no_bead_is_two_things():
    """Of two roles for one word the last read would win, by the names of files."""
    pairs = {(w, role) for each in known.DIALECTS for role, ws in each.roles.items() for w in ws}
    assert len(pairs) == len({word for word, _ in pairs})
    for word, role in pairs:
        assert classify(f";TYPE:{word.upper()}".encode()).kind == Kind.STATE
        assert role_of(f";TYPE:{word}") == role


def test_no_value_begins_a_layer():
    """Values are asked first, so a mark that reads as one would never be seen."""
    for key in known.together("values"):
        assert not [p for p in known.every("layers") if re.match(p, f"{key}: 1", re.IGNORECASE)]


def test_printers_have_their_presets():
    """A name that leads nowhere would end the run of who has that printer."""
    assert set(known.together("printers").values()) <= set(preset_names())


def test_what_begins_another_word_comes_behind_it(monkeypatch):
    """A pattern of the shorter first would never see the longer."""
    two = Dialect(signs={"Slic3r": "a", "Slic3r Plus": "b"}, roles={Role.CUSTOM: ("custom",)})
    monkeypatch.setattr(known, "DIALECTS", (two,))
    known.every.cache_clear()
    try:
        assert known.either("signs") == rb"Slic3r\ Plus|Slic3r"
    finally:
        known.every.cache_clear()
