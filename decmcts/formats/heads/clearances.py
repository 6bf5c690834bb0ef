"""The head that slicers state: their clearances, and the machine made of them.

PrusaSlicer, SuperSlicer, Slic3r, OrcaSlicer and Bambu Studio check prints of one
object after the other against a few numbers of the printer, and write these into
every G-code file and profile. They describe a head that holds the real one:

- the radius is that of a cylinder around the nozzle that encloses the extruder
  (PrusaSlicer's PrintConfig.cpp; hulls of objects are grown by half of it each);
- from the height of the rod upwards all of the bed's width is taken (Slic3r to
  PrusaSlicer 2.7 refuse any object higher than that but the last);
- the nozzle's height (OrcaSlicer, Bambu Studio) is how far the nozzle stands out
  below the cylinder. Where nobody states it, the cylinder begins at the tip:
  Prusa's own shapes have fan ducts and probes there.

Settings come from `slicer_settings`; no file is read here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from decmcts.arrays import Floats
from decmcts.errors import InputError
from decmcts.formats.files.names import in_one_line
from decmcts.formats.slicers.known import every
from decmcts.print.machine import Head, Machine, Slice

RADII = every("radius")
RODS = tuple(sorted(every("rod"), key=len))  # the plain name first
NOZZLE = "nozzle_height"
BEDS = every("bed")
SETTINGS = (
    *RADII,
    *RODS,
    NOZZLE,
    *BEDS,
    "printer_model",
    "nozzle_diameter",
    "single_extruder_multi_material",
)
LARGEST_MM = 1000.0  # of a radius or a height: no printer of this kind is larger
TALLEST_NOZZLE_MM = 20.0
NOZZLE_HALF_MM = 5.0  # half of the nozzle's width, as PrusaSlicer has it (ArrangeHelper.cpp)
UNKNOWN_BED_MM = 1000.0  # where no bed is stated, so that nothing is refused for its size
CORNERS = 24  # of the polygon around the cylinder
UNCHANGED = (20.0, 20.0)  # radius and height in Slic3r and PrusaSlicer where nobody set them


@dataclass(frozen=True, slots=True)
class Setting:
    """The text of a slicer's setting and the line it stands on (0: unknown)."""

    text: str
    line: int = 0


@dataclass(frozen=True, slots=True)
class Clearances:
    """What a slicer knows of a head, in mm from the nozzle's tip."""

    radius: float
    nozzle: float | None  # None: not stated
    rod: float  # everything is taken from here up
    bed_min: tuple[float, float] | None
    bed_max: tuple[float, float] | None
    printer: str  # the slicer's printer_model, may be empty
    radius_from: str  # the setting's name
    rod_from: str

    @property
    def unchanged(self) -> bool:
        """Whether these are the slicer's defaults, which nobody may have measured."""
        return self.nozzle is None and (self.radius, self.rod) == UNCHANGED

    def __str__(self) -> str:
        begin = "the tip" if not self.nozzle else f"{self.nozzle:g} mm ({NOZZLE})"
        bed = "of unknown size"
        if self.bed_min is not None and self.bed_max is not None:
            bed = "{:g} x {:g} mm".format(*np.subtract(self.bed_max, self.bed_min))
        return (
            f"a disc of radius {self.radius:g} mm ({self.radius_from}) from {begin} up,"
            f" everything from {self.rod:g} mm up ({self.rod_from}), bed {bed}"
        )


def read_clearances(
    settings: Mapping[str, Setting], path: Path | str | None = None
) -> Clearances | None:
    """Return the clearances among a slicer's settings, None where it states no radius or height.

    Of several values (one an extruder) the one that takes most room counts. A nozzle's
    height counts for a head of one nozzle only: of several the others may be as low.

    Raises InputError for a value that can't be, or one of the two without the other.
    """
    radii = _lengths(settings, RADII, path)
    rods = _lengths(settings, RODS, path)
    if not radii and not rods:
        return None
    if not radii or not rods:
        there, missing = (RADII[0], RODS[0]) if radii else (next(iter(rods)), RADII[0])
        raise InputError(
            f"{there} is stated but no {missing}", path=path, advice="name the head with --machine"
        )
    radius_from = max(radii, key=lambda name: max(radii[name]))
    rod_from = min(rods, key=lambda name: min(rods[name]))
    low, high = _bed(settings, path) or (None, None)
    return Clearances(
        max(radii[radius_from]), _nozzle(settings, path), min(rods[rod_from]), low, high,
        _text(settings, "printer_model"), radius_from, rod_from,
    )  # fmt: skip


def clearance_machine(found: Clearances, *, source: str) -> Machine:
    """Return the machine of one head that the clearances describe."""
    low = found.bed_min or (-UNKNOWN_BED_MM, -UNKNOWN_BED_MM)
    high = found.bed_max or (UNKNOWN_BED_MM, UNKNOWN_BED_MM)
    across = float(np.subtract(high, low).max())
    head = clearance_head(found.radius, found.nozzle or 0.0, found.rod, across)
    return Machine(
        name=f"{in_one_line(found.printer)[:100] or 'printer'} by its clearances",
        bed_min=low,
        bed_max=high,
        heads=(Head("head", head, park=(*low, 0.0)),),
        source=f"{source}: {found}",
    )


def clearance_head(radius: float, nozzle: float, rod: float, across: float) -> tuple[Slice, ...]:
    """Return the slices of a head: a nozzle, from `nozzle` up a disc, from `rod` up everything.

    Parameters
    ----------
    radius, nozzle, rod : float
        In mm; the polygon of the disc holds it.
    across : float
        How far the nozzle gets on the bed, mm: the last slice covers that each way.
    """
    parts = [
        (0.0, _square(NOZZLE_HALF_MM)),
        (nozzle, _around(radius)),
        (rod, _square(across + radius)),
    ]
    by_height: dict[float, tuple[Floats, ...]] = {}
    for height, polygon in parts:
        by_height[height] = (*by_height.get(height, ()), polygon)
    return tuple(Slice(height, by_height[height]) for height in sorted(by_height))


def _square(half: float) -> Floats:
    return _frozen(half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]))


def _around(radius: float) -> Floats:
    """Return a regular polygon, counter-clockwise, whose sides touch the circle."""
    angle = 2.0 * math.pi * (np.arange(CORNERS) + 0.5) / CORNERS
    corner = radius / math.cos(math.pi / CORNERS)
    return _frozen(corner * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def _frozen(polygon: Floats) -> Floats:
    polygon.setflags(write=False)
    return polygon


def _text(settings: Mapping[str, Setting], name: str) -> str:
    return settings[name].text.strip() if name in settings else ""


def _lengths(
    settings: Mapping[str, Setting], names: tuple[str, ...], path: Path | str | None
) -> dict[str, list[float]]:
    """Return the values of the settings there are; an empty one is not stated."""
    return {
        name: _numbers(name, settings[name], path, LARGEST_MM)
        for name in names
        if _text(settings, name)
    }


def _numbers(
    name: str, setting: Setting, path: Path | str | None, most: float, *, zero: bool = False
) -> list[float]:
    """Return the numbers of a list with commas, each above 0 (or from 0) and up to `most`."""
    values = []
    for word in setting.text.split(","):
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not (0.0 < value <= most or (zero and value == 0.0)):
            least = "from" if zero else "above"
            raise InputError(
                f"{name} is {word.strip()[:40]!r}, a length {least} 0 and up to {most:g} mm is"
                " needed to know the head",
                path=path,
                line=setting.line or None,
                advice="set it in the slicer's printer settings, or name the head with --machine",
            )
        values.append(value)
    return values


def _nozzle(settings: Mapping[str, Setting], path: Path | str | None) -> float | None:
    if not _text(settings, NOZZLE):
        return None
    heights = _numbers(NOZZLE, settings[NOZZLE], path, TALLEST_NOZZLE_MM, zero=True)
    several = "," in _text(settings, "nozzle_diameter")
    shared = _text(settings, "single_extruder_multi_material") == "1"
    return None if several and not shared else min(heights)


def _bed(
    settings: Mapping[str, Setting], path: Path | str | None
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return the least and the largest corner of the bed, None where it is not stated."""
    name = next((name for name in BEDS if _text(settings, name)), None)
    if name is None:
        return None
    text, line = settings[name].text, settings[name].line
    try:
        corners = np.array([[float(v) for v in pair.split("x")] for pair in text.split(",")])
        box = np.stack([corners.min(axis=0), corners.max(axis=0)])
        size = box[1] - box[0]
        fine = box.shape == (2, 2) and bool((np.abs(box) <= 1e4).all() and (size > 0.0).all())
    except ValueError:
        fine = False
    if not fine:
        raise InputError(
            f"{name} is {text[:60]!r}, expected the corners of a bed as 0x0,200x0,200x200,0x200",
            path=path,
            line=line or None,
            advice="set it in the slicer's printer settings, or name the machine with --machine",
        )
    (x0, y0), (x1, y1) = box.tolist()
    return (x0, y0), (x1, y1)
