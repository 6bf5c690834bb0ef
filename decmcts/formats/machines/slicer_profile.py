"""Machines from the profiles of slicers, by the clearances in them.

OrcaSlicer and Bambu Studio keep a profile in a JSON file that `inherits` from
another; PrusaSlicer and SuperSlicer export a configuration (INI without
sections). What the values mean lives in `clearances`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from decmcts.errors import InputError
from decmcts.formats.files.fields import shown
from decmcts.formats.files.reading import one_line, read_bytes, read_json
from decmcts.formats.gcode.controller.limits import stated_limits
from decmcts.formats.heads.clearances import Setting, clearance_machine, read_clearances
from decmcts.print.machine import Machine, MotionLimits

LONGEST_CHAIN = 20  # profiles that inherit from each other; OrcaSlicer's have four
SHOWN = 8  # names in a message
Settings = dict[str, Setting]


def machine_from_json(path: Path, profile: Mapping[str, Any]) -> Machine:
    """Return the machine of a profile of OrcaSlicer or Bambu Studio.

    The profiles it inherits from are looked for beside it, and where OrcaSlicer and Bambu Studio
    keep theirs (`system/VENDOR/machine`).

    Raises InputError when it states no clearances, or inherits from a profile that is not there.
    """
    settings: Settings = {}
    file, names = path, [path.name]
    while True:
        settings = {**_texts(profile), **settings}
        parent = str(profile.get("inherits") or "").strip()
        if not parent:
            return _machine(settings, path)
        if len(names) > LONGEST_CHAIN:
            raise InputError(f"inherits in a circle: {' < '.join(names[:SHOWN])}", path=path)
        names.append(parent)
        file = _inherited(parent, file, path)
        profile = read_json(file, "profile")


def _inherited(name: str, file: Path, path: Path) -> Path:
    """Return the file of the profile another inherits from."""
    if "/" in name or "\\" in name:
        raise InputError(f"inherits from {name!r}, which is a path and no name", path=path)
    places = [file.parent / f"{name}.json", file.parent / "base" / f"{name}.json"]
    for folder in list(file.resolve().parents)[:5]:
        places += sorted((folder / "system").glob("*/machine"))
    found = [place if place.suffix == ".json" else place / f"{name}.json" for place in places]
    there = next((place for place in found if place.is_file()), None)
    if there is None:
        raise InputError(
            f"{file.name} inherits from {name!r}, which is not there",
            path=path,
            advice=f"put {name}.json beside it (from the slicer's system/VENDOR/machine or "
            "resources/profiles/VENDOR/machine)",
        )
    return there


def _texts(profile: Mapping[str, Any]) -> Settings:
    """Return settings as text; lists, one value an extruder, with commas between."""
    found = {}
    for name, value in profile.items():
        items = value if isinstance(value, list) else [value]
        found[name] = Setting(",".join(map(str, items)))
    return found


def machine_from_ini(path: Path) -> Machine:
    """Return the machine of a configuration that PrusaSlicer or SuperSlicer exported.

    Raises InputError when it states no clearances, or is a bundle of many configurations.
    """
    with one_line(path, "profile"):
        lines = read_bytes(path).decode("utf-8-sig").splitlines()
    settings: Settings = {}
    for number, line in enumerate(lines, 1):
        if line.startswith("["):
            raise InputError(
                f"is a bundle of many profiles: {shown(line)}",
                path=path,
                line=number,
                advice="choose the printer in the slicer and export it with File > Export > "
                "Export Config",
            )
        name, equals, value = line.partition("=")
        if equals and line[0] not in "#;":
            settings[name.strip()] = Setting(value.strip(), number)
    return _machine(settings, path)


def _machine(settings: Settings, path: Path) -> Machine:
    found = read_clearances(settings, path)
    if found is None:
        missing = settings.get("inherits", Setting("")).text
        raise InputError(
            "this profile states no clearances of the head (extruder_clearance_radius and …_height)"
            + (f"; it inherits from {missing!r}" if missing else ""),
            path=path,
            advice="export the whole configuration of the printer, see docs/machine-format.md",
        )
    text = "".join(f"; {name} = {value.text}\n" for name, value in settings.items())
    limits = MotionLimits().under(stated_limits(text.encode()))
    return replace(clearance_machine(found, source=path.name), limits=limits)
