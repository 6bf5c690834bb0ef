"""Parameters of the heads' search, from a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from decmcts.formats.files.reading import read_toml
from decmcts.team.dec_mcts.parameters import Parameters, changed


def read_parameters(path: Path) -> Mapping[str, float]:
    """Return the parameters that a TOML file sets; raises InputError for unknown or bad ones."""
    values = read_toml(path, "file of parameters", page="docs/team.md")
    changed(Parameters(), values, path=path)
    return values
