"""Machines by preset name, from TOML files and from PrusaSlicer's head geometries.

What the keys mean and what is refused lives in `machine_dict`.

Presets `rail-3` to `rail-8`: as many heads like those of `dual-gantry` along one rail.

    parked            over the bed           parked
    [1] [2] [3] |   0 ........... W   |  [4] [5]        (rail-5)

The bed is 150 mm long a head, 300 at least. The heads park beyond its two ends, one
behind the other as near as the rail lets them.

Head shapes from PrusaSlicer's own file of printer geometries.

The file (resources/data/printer_gantries/geometries.json of PrusaSlicer 2.9)
lists for each printer model slices of what moves above the print: 'convex'
outlines and 'box' outlines, in mm relative to the nozzle, heights above the
tip. It holds neither bed nor motion limits.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import replace
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from decmcts.arguments import checked
from decmcts.errors import InputError
from decmcts.formats.files.fields import Fields, fail, shown
from decmcts.formats.files.reading import read_json, read_toml
from decmcts.formats.heads.clearances import UNKNOWN_BED_MM
from decmcts.formats.machines.machine_dict import machine_from_dict
from decmcts.formats.machines.slicer_profile import machine_from_ini, machine_from_json
from decmcts.formats.slicers.known import together
from decmcts.print.machine import Head, Machine, Rail

SIZES = range(3, 9)
_BED_A_HEAD_MM, _SHORTEST_BED_MM = 150.0, 300.0
_SLACK_MM = 5.0  # of reach: a head at its end of the bed does not touch the limit of the rail


def rail_machine(pair: Machine, heads: int, length_mm: float | None = None) -> Machine:
    """Return a machine of `heads` heads shaped like those of `pair`, two heads on a rail.

    The first of the pair parks left of its bed, the second as far right of it. The bed is
    `length_mm` long, by default as the presets'.
    """
    (rail,) = pair.rails
    length = length_mm or max(_SHORTEST_BED_MM, _BED_A_HEAD_MM * heads)
    placed = [_head(pair, k, heads, length) for k in range(heads)]
    return replace(
        pair,
        name=f"rail-{heads}",
        bed_max=(length, pair.bed_max[1]),
        heads=tuple(placed),
        rails=(Rail(rail.axis, tuple(head.name for head in placed), rail.separation_mm),),
        source=f"{heads} heads of {pair.name} along one rail; {pair.name}: {pair.source}",
    )


def _head(pair: Machine, k: int, heads: int, length: float) -> Head:
    """Return head k, counted from the left.

    It reaches as far as the heads beyond it leave room for, pushed together up to the
    nearest park on the other side.
    """
    first, last = pair.heads
    step = pair.rails[0].separation_mm
    left = (heads + 1) // 2  # so many park left of the bed
    beyond = last.park[0] - pair.bed_max[0]  # from the end of the bed to the nearest park
    low, high = 0.0, length
    if k < left:
        x = first.park[0] - step * (left - 1 - k)
        high = min(high, length + beyond - step * (left - k) - _SLACK_MM)
    else:
        x = length + beyond + step * (k - left)
        low = max(low, first.park[0] + step * (k - left + 1) + _SLACK_MM)
    return replace(
        first,
        name=f"head-{k + 1}",
        park=(x, *first.park[1:]),
        reach_min=(low, *first.reach_min[1:]),
        reach_max=(high, *first.reach_max[1:]),
    )


_GEOMETRIES = re.compile(r"^(?P<file>.+\.json):(?P<name>[^:/\\]+)$", re.IGNORECASE)
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
        ``FILE.ini``), or ``geometries.json:NAME`` where NAME is
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
        return _from_toml(Path(file), (_presets() / file).read_bytes())
    geometries = _GEOMETRIES.match(name)
    if geometries is not None:
        return _from_geometries(Path(geometries["file"]), geometries["name"])
    if name.lower().endswith(".toml"):
        return _from_toml(Path(name))
    if name.lower().endswith(".json"):
        return _from_json(Path(name))
    if name.lower().endswith(".ini"):
        return machine_from_ini(Path(name))
    raise InputError(f"unknown machine {name!r}", advice=_known(name))


def preset_for_printer(model: str) -> str | None:
    """Return the preset for a slicer's `printer_model`, e.g. MK4S or MINIIS, or None."""
    known = together("printers").items()
    return next((name for pattern, name in known if re.match(pattern, model.upper())), None)


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


def _from_toml(path: Path, content: bytes | None = None) -> Machine:
    values = read_toml(path, "machine file", page="docs/machine-format.md", content=content)
    return machine_from_dict(values, path=path)


def _from_json(path: Path) -> Machine:
    """Return the machine of a slicer's profile; Prusa's geometries need a name besides."""
    values = read_json(path, "profile")
    if "printers" in values:
        raise InputError(
            "which printer of this file?", path=path, advice=f"write {path}:MODEL, e.g. {path}:MK4S"
        )
    return machine_from_json(path, values)


_KIND = "file of printer geometries"
_KINDS = ("convex", "box")
_PLAIN = re.compile(r"(?:[\w-]|\.\*?|\(\?[!=]\w*+\))*+")  # other patterns may take for ever
_MOST_RUNS = 3


def _from_geometries(path: Path, name: str) -> Machine:
    """Return the printer of PrusaSlicer's file whose model matches a name.

    Bed and limits, which the file has not, are those of our preset of that name, if it has one
    head.
    """
    entry = _find(Fields(read_json(path, _KIND), "", path).tables("printers"), name)
    described = {
        "name": name.lower(),
        "source": f"PrusaSlicer printer geometries, {path.name}, {name.upper()}",
        "bed": {"min": [-UNKNOWN_BED_MM] * 2, "max": [UNKNOWN_BED_MM] * 2},
        "heads": [{"name": "head", "slices": _slices(entry)}],
    }
    machine = machine_from_dict(described, path=path)
    if name.lower() not in preset_names():
        return machine
    like = load_machine(name.lower())
    if len(like.heads) > 1:
        return machine
    head = replace(machine.heads[0], park=like.heads[0].park)
    return replace(
        machine, bed_min=like.bed_min, bed_max=like.bed_max, limits=like.limits, heads=(head,)
    )


def _find(printers: list[Fields], name: str) -> Fields:
    """Return the first printer whose notes pattern matches the model, as PrusaSlicer does."""
    notes = (f"PRINTER_MODEL_{name.upper()}", f"SEQ_ARRANGE_MODEL_{name.upper()}")
    for printer in printers:
        pattern = printer.text("printer_notes_regex")
        if not _PLAIN.fullmatch(pattern) or pattern.count("*") > _MOST_RUNS:
            printer.fail(
                "printer_notes_regex",
                f"{shown(pattern)} is no plain pattern",
                f"it is made of words, at most {_MOST_RUNS} times .* and (?!WORD)",
            )
        if any(re.search(pattern, note) for note in notes):
            return printer
    patterns = [printer.text("printer_notes_regex") for printer in printers]
    models = [(re.findall(r"MODEL_(\w+)", pattern) or [pattern])[0] for pattern in patterns]
    path = printers[0].path if printers else None
    raise InputError(
        f"no printer matches {name!r}", path=path, advice=f"found: {', '.join(models)}"
    )


def _slices(printer: Fields) -> list[dict[str, Any]]:
    """Return slices by height; the file repeats heights and lists them in any order."""
    by_height: dict[float, list[list[list[float]]]] = {}
    for entry in printer.tables("slices"):
        kind = entry.text("type")
        if kind not in _KINDS:
            entry.fail("type", f"unknown kind {kind!r}", f"known: {', '.join(_KINDS)}")
        try:
            height = float(entry.need("height"))
        except (TypeError, ValueError):
            entry.fail("height", f"expected a number, found {entry.need('height')!r}")
        for number, text in enumerate(entry.items("polygons"), 1):
            ring = _ring(str(text), f"{entry.where}, polygon {number}", entry.path)
            by_height.setdefault(height, []).append(ring)
    return [{"height": h, "polygons": by_height[h]} for h in sorted(by_height)]


def _ring(text: str, where: str, path: Path | str | None) -> list[list[float]]:
    """Return a ring counter-clockwise; the file's rings run either way."""
    try:
        points = np.array([[float(v) for v in pair.split(",")] for pair in text.split(";")])
    except ValueError:
        points = np.empty((0, 0))
    if points.ndim != 2 or points.shape[1] != 2 or not (np.abs(points) <= UNKNOWN_BED_MM).all():
        fail(where, f"expected 'x,y;x,y;...', found {text!r}", path)
    if len(points) >= 3 and not shapely.LinearRing(points).is_ccw:
        points = points[::-1]
    return [list(map(float, row)) for row in points]
