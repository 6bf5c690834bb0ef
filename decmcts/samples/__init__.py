"""The prints that ship with the package: a plate for two heads, four nuts for one."""

from __future__ import annotations

from pathlib import Path

from decmcts.arguments import checked
from decmcts.errors import InputError

SAMPLES = Path(__file__).parent


@checked
def sample_path(name: str) -> Path:
    """Return the path of a print that ships with the package, e.g. ``plate.gcode.gz``.

    Raises
    ------
    InputError
        When there is no such print; the message lists those there are.
    """
    path = SAMPLES / name
    if not path.is_file():
        there = sorted(p.name for p in SAMPLES.iterdir() if p.name.endswith((".stl", ".gz")))
        raise InputError(f"no print {name!r}; there are {', '.join(there)}")
    return path
