"""Machines by preset name, from TOML files and from PrusaSlicer's head geometries.

What the keys mean and what is refused lives in `machine_dict`.
"""

from __future__ import annotations

import difflib
import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from decmcts.arguments import checked
from decmcts.errors import InputError
from decmcts.formats.files.reading import parse_toml, read_bytes, read_json
from decmcts.formats.machines.machine_dict import machine_from_dict
from decmcts.formats.machines.prusa_geometries import machine_from_geometries
from decmcts.formats.machines.rail_family import SIZES, rail_machine
from decmcts.formats.machines.slicer_profile import machine_from_ini, machine_from_json
from decmcts.formats.slicers.known import together
from decmcts.print.machine import Machine

_GEOMETRIES = re.compile(r"^(?P<file>.+\.json):(?P<name>[^:/\\]+)$", re.IGNORECASE)
_INI = re.compile(r"^(?P<file>.+\.ini)(:(?P<name>[^/\\]+))?$", re.IGNORECASE)
_RAILS = {f"rail-{heads}": heads for heads in SIZES}  # presets that have no file


def preset_names() -> list[str]:
    """Return the names of the machines that come with the program, sorted."""
    files = [entry.name for entry in _presets().iterdir()]
    return sorted([*_RAILS, *(name[:-5] for name in files if name.endswith(".toml"))])


@checked
def load_machine(name_or_path: str) -> Machine:
    """Return a machine.

    Parameters
    ----------
    name_or_path : str
        A preset (`preset_names`), ``FILE.toml``, a slicer's profile (``FILE.json``,
        ``FILE.ini``, ``BUNDLE.ini:PRINTER``), or ``geometries.json:NAME`` where NAME is
        a printer model of PrusaSlicer's file, in any case.

    Raises
    ------
    InputError
        For an unknown name and for anything wrong in the file.

    Examples
    --------
    >>> from decmcts import load_machine
    >>> load_machine("paper").heads[0].slices[0].polygons[0].tolist()
    [[-7.0, -7.0], [7.0, -7.0], [7.0, 7.0], [-7.0, 7.0]]
    """
    name = str(name_or_path)
    if name.lower() in _RAILS:
        return rail_machine(load_machine("dual-gantry"), _RAILS[name.lower()])
    if name.lower() in preset_names():
        file = f"{name.lower()}.toml"
        return _from_toml((_presets() / file).read_bytes(), Path(file))
    geometries = _GEOMETRIES.match(name)
    if geometries is not None:
        return _from_geometries(Path(geometries["file"]), geometries["name"])
    if name.lower().endswith(".toml"):
        return _from_toml(read_bytes(Path(name)), Path(name))
    if name.lower().endswith(".json"):
        return _from_json(Path(name))
    if ini := _INI.match(name):
        return machine_from_ini(Path(ini["file"]), ini["name"])
    raise InputError(f"unknown machine {name!r}", advice=_known(name))


def preset_for_printer(model: str) -> str | None:
    """Return the preset for a slicer's `printer_model`, e.g. MK4S or MINIIS, or None."""
    known = together("printers").items()
    return next((name for pattern, name in known if re.match(pattern, model.upper())), None)


def preset_by_clearances(model: str) -> str | None:
    """Return the preset made of the clearances in this printer's profile, or None."""
    return together("profiles").get(model.strip().lower())


def _presets() -> Traversable:
    return files("decmcts") / "machines"


def _known(name: str) -> str:
    close = difflib.get_close_matches(name.lower(), preset_names(), n=1)
    guess = f"did you mean {close[0]!r}? " if close else ""
    return (
        f"{guess}known: {', '.join(preset_names())};"
        " or give FILE.toml, a slicer's profile (.json, .ini), or PrusaSlicer's"
        " geometries.json:MODEL"
    )


def _from_toml(content: bytes, path: Path) -> Machine:
    values = parse_toml(content, path, "machine file", page="docs/machine-format.md")
    return machine_from_dict(values, path=path)


def _from_json(path: Path) -> Machine:
    """Return the machine of a slicer's profile; Prusa's geometries need a name besides."""
    values = read_json(path, "profile")
    if "printers" in values:
        raise InputError(
            "which printer of this file?", path=path, advice=f"write {path}:MODEL, e.g. {path}:MK4S"
        )
    return machine_from_json(path, values)


def _from_geometries(path: Path, name: str) -> Machine:
    """Join shapes of PrusaSlicer's file with the bed of our preset of that name, if any."""
    preset = load_machine(name.lower()) if name.lower() in preset_names() else None
    return machine_from_geometries(path, name, like=preset)
