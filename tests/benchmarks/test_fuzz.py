"""300 damaged files of each format, with a fixed seed: read, or refused in one line."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
fuzz = importlib.import_module("fuzz")
FILES, SEED = 300, 7


@pytest.mark.slow
@pytest.mark.parametrize("kind", fuzz.FORMATS, ids=lambda kind: kind.name)
def test_a_damaged_file_is_read_or_refused_in_a_line(tmp_path: Path, kind) -> None:
    """Exit code 0 or 2: no other error leaves a reader."""
    honest, rng, read = kind.make(), np.random.default_rng(SEED), 0
    path = tmp_path / kind.name
    path.write_bytes(honest)
    assert fuzz.refused_or_read(kind, path)
    for number in range(FILES):
        path.write_bytes(fuzz.kind_damaged(kind, honest, rng))
        try:
            read += fuzz.refused_or_read(kind, path)
        except Exception as error:
            pytest.fail(f"file {number}: {type(error).__name__}: {error}")
    assert read < FILES


def test_a_lost_command_is_seen() -> None:
    """Else the tool would pass what loses them."""
    text = b"(note) M600\nG4 P9 ; x\nT1\nG1 X1\nM117 hi\n"
    assert fuzz.lost_commands(text, text) == []
    assert fuzz.lost_commands(text, text.replace(b"M600", b"")) == [b"M600"]
    assert fuzz.lost_commands(text + b"M600\n", text) == [b"M600"]


def test_each_kind_of_message_is_said_again_as_it_was(tmp_path: Path) -> None:
    """Else damaged ones are no test of the reader."""
    kind = fuzz.FORMATS[-1]
    for number in range(len(fuzz.MESSAGES)):
        (tmp_path / kind.name).write_bytes(fuzz.message(number))
        assert fuzz.refused_or_read(kind, tmp_path / kind.name)
