"""Machines from the profiles of slicers, by the clearances in them.

OrcaSlicer and Bambu Studio keep a profile in a JSON file that `inherits` from
another; PrusaSlicer and SuperSlicer export one configuration (INI without
sections) or a bundle of many (sections, whose `inherits` names others of the
same file). What the values mean lives in `clearances`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from decmcts.errors import InputError
from decmcts.formats.files.reading import one_line, read_bytes, read_json
from decmcts.formats.gcode.controller.limits import stated_limits
from decmcts.formats.heads.clearances import Setting, clearance_machine, read_clearances
from decmcts.print.machine import Machine, MotionLimits

MOST_INHERITED = 500  # sections, of several parents each and theirs
LONGEST_CHAIN = 20  # profiles that inherit from each other; OrcaSlicer's have four
SHOWN = 8  # names in a message
_SECTION = re.compile(r"^\[(.*)\]\s*$")
_PRINTER = "printer:"
Settings = dict[str, Setting]


def machine_from_json(path: Path, profile: Mapping[str, Any]) -> Machine:
    """Return the machine of a profile of OrcaSlicer or Bambu Studio.

    Parameters
    ----------
    path : Path
        Its file; the profiles it inherits from are looked for beside it, and where
        OrcaSlicer and Bambu Studio keep theirs (`system/VENDOR/machine`).
    profile : Mapping
        What the file holds.

    Raises
    ------
    InputError
        When it states no clearances, or inherits from a profile that is not there.
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


def machine_from_ini(path: Path, name: str | None) -> Machine:
    """Return the machine of an exported configuration, or of a printer in a bundle.

    Parameters
    ----------
    path : Path
        The INI file.
    name : str | None
        The printer in a bundle, without `printer:`; None where there is one only.

    Raises
    ------
    InputError
        When it states no clearances, or which printer is meant is not clear.
    """
    sections = _sections(path)
    printers = [s[len(_PRINTER) :] for s in sections if s.startswith(_PRINTER)]
    if not printers:
        if name is not None:
            raise InputError(f"has no sections, so no printer {name!r}", path=path)
        return _machine(sections.get("", {}), path)
    shown = [printer for printer in printers if not printer.startswith("*")]
    if name is None and len(shown) == 1:
        name = shown[0]
    chosen = next((p for p in printers if name is not None and p.lower() == name.lower()), None)
    if chosen is None:
        raise InputError(
            "which printer of this bundle?" if name is None else f"has no printer {name!r}",
            path=path,
            advice=f"write {path}:NAME, one of: {', '.join(shown[:SHOWN])}"
            + (f" and {len(shown) - SHOWN} more" if len(shown) > SHOWN else ""),
        )
    return _machine(_resolved(chosen, sections, path), path)


def _sections(path: Path) -> dict[str, Settings]:
    """Return the settings in each section of an INI file, those above all under ''."""
    with one_line(path, "profile"):
        lines = read_bytes(path).decode("utf-8-sig").splitlines()
    found: dict[str, Settings] = {"": {}}
    here = found[""]
    for number, line in enumerate(lines, 1):
        if section := _SECTION.match(line):
            here = found.setdefault(section[1], {})
        elif line[:1] not in ("#", ";"):
            name, equals, value = line.partition("=")
            if equals:
                here[name.strip()] = Setting(value.strip(), number)
    return found


def _resolved(name: str, sections: Mapping[str, Settings], path: Path) -> Settings:
    """Return a printer's settings with those it inherits, its own last."""
    settings: Settings = {}
    for count, section in enumerate(_chain(name, sections, path, depth=0)):
        if count > MOST_INHERITED:
            raise InputError(f"printer {name!r} inherits {MOST_INHERITED} times", path=path)
        settings.update(section)
    return settings


def _chain(
    name: str, sections: Mapping[str, Settings], path: Path, *, depth: int
) -> Iterator[Settings]:
    """Yield the sections a printer is made of, the one that counts most last.

    Exported bundles state everything in a printer's own section and name a parent
    that is not among them.
    """
    if depth > LONGEST_CHAIN:
        raise InputError(f"printer {name!r} inherits in a circle", path=path)
    own = sections[_PRINTER + name]
    for parent in own.get("inherits", Setting("")).text.split(";"):
        if _PRINTER + parent.strip() in sections:
            yield from _chain(parent.strip(), sections, path, depth=depth + 1)
    yield own


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
