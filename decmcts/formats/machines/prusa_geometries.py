"""Head shapes from PrusaSlicer's own file of printer geometries.

The file (resources/data/printer_gantries/geometries.json of PrusaSlicer 2.9)
lists for each printer model slices of what moves above the print: 'convex'
outlines and 'box' outlines, in mm relative to the nozzle, heights above the
tip. It holds neither bed nor motion limits.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.files.fields import Fields, fail, shown
from decmcts.formats.files.reading import read_json
from decmcts.formats.heads.clearances import UNKNOWN_BED_MM
from decmcts.formats.machines.machine_dict import machine_from_dict
from decmcts.print.machine import Machine

_KIND = "file of printer geometries"
_KINDS = ("convex", "box")
_PLAIN = re.compile(r"(?:[\w-]|\.\*?|\(\?[!=]\w*+\))*+")  # other patterns may take for ever
_MOST_RUNS = 3


def machine_from_geometries(path: Path, name: str, *, like: Machine | None = None) -> Machine:
    """Return the printer of PrusaSlicer's file whose model matches `name`.

    Parameters
    ----------
    path : Path
        The JSON file.
    name : str
        A printer model, e.g. ``MK4S``; any case.
    like : Machine | None
        Where bed and limits come from, if it has one head; the file has none.

    Raises
    ------
    InputError
        For an unreadable file, an unknown model, or shapes that are not convex.
    """
    entry = _find(Fields(read_json(path, _KIND), "", path).tables("printers"), name)
    described = {
        "name": name.lower(),
        "source": f"PrusaSlicer printer geometries, {path.name}, {name.upper()}",
        "bed": {"min": [-UNKNOWN_BED_MM] * 2, "max": [UNKNOWN_BED_MM] * 2},
        "heads": [{"name": "head", "slices": _slices(entry)}],
    }
    machine = machine_from_dict(described, path=path)
    if like is None or len(like.heads) > 1:
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
    models = [_model_of(printer.text("printer_notes_regex")) for printer in printers]
    path = printers[0].path if printers else None
    raise InputError(
        f"no printer matches {name!r}", path=path, advice=f"found: {', '.join(models)}"
    )


def _model_of(pattern: str) -> str:
    """Return the model a pattern names."""
    found = re.search(r"MODEL_(\w+)", pattern)
    return found[1] if found else pattern


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
    """Return a counter-clockwise convex ring; the file's rings run either way."""
    try:
        points = np.array([[float(v) for v in pair.split(",")] for pair in text.split(";")])
    except ValueError:
        points = np.empty((0, 0))
    if points.ndim != 2 or points.shape[1] != 2 or not (np.abs(points) <= UNKNOWN_BED_MM).all():
        fail(where, f"expected 'x,y;x,y;...', found {text!r}", path)
    return [list(map(float, row)) for row in _counter_clockwise(points, where, path)]


def _counter_clockwise(
    points: NDArray[np.float64], where: str, path: Path | str | None
) -> NDArray[np.float64]:
    hull = shapely.MultiPoint(points).convex_hull
    if len(points) < 3 or hull.geom_type != "Polygon":
        fail(where, f"{len(points)} points with no area between them", path)
    ring = shapely.LinearRing(points)
    if not ring.is_simple or shapely.Polygon(ring).area < hull.area * (1.0 - 1e-9):
        fail(where, "it is not convex", path, "split it into convex polygons")
    return points if ring.is_ccw else points[::-1]
