"""What a slicer can be told."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

from decmcts.arguments import check_fields
from decmcts.errors import InputError
from decmcts.formats.gcode.text.source_text import has_plates
from decmcts.print.machine import Machine

MESH_SUFFIXES = (".stl", ".3mf", ".obj")
OTHER_SHAPES = (
    ".ply", ".off", ".glb", ".gltf", ".amf", ".dae", ".fbx", ".x3d", ".wrl", ".step", ".stp",
    ".iges", ".igs", ".brep", ".f3d", ".fcstd", ".scad", ".blend", ".skp",
)  # fmt: skip
_WIDTH_PER_NOZZLE = 1.125  # what PrusaSlicer takes for a 0.4 mm nozzle: 0.45 mm


def is_mesh(path: Path) -> bool:
    """Tell whether a file is a mesh, by its name; a .3mf is one where no plate has G-code."""
    return path.suffix.lower() in MESH_SUFFIXES and not has_plates(path)


def refuse_other_shape(path: Path) -> None:
    """Raise InputError for a mesh or model of a kind that is not read, by its name."""
    if (suffix := path.suffix.lower()) in OTHER_SHAPES:
        raise InputError(
            f"a {suffix} is not read", path=path,
            advice=f"export the model as {', '.join(MESH_SUFFIXES)}, or slice it and give the "
            "G-code",
        )  # fmt: skip


_LENGTHS = ("retract_mm", "retract_min_travel_mm")
_FEEDS = ("travel_feed", "retract_feed")
_COUNTS = ("perimeters", "skirts")
_PARK_MM = 5.0  # from the edge of the bed
_NO_LIMIT_MM = 1e5  # a reach beyond this is no limit


@dataclass(frozen=True, slots=True)
class Bed:
    """The bed a mesh is put on, and how high may be printed, mm."""

    low: tuple[float, float] = (0.0, 0.0)
    high: tuple[float, float] = (250.0, 210.0)
    height: float = 200.0

    @staticmethod
    def of(machine: Machine) -> Bed:
        """Take a machine's bed: a common one for the paper's machine, whose own is not real."""
        if not machine.bead_width:
            return Bed()
        height = machine.heads[0].reach_max[2]
        return Bed(
            machine.bed_min, machine.bed_max, height if height < _NO_LIMIT_MM else Bed().height
        )

    @property
    def center(self) -> tuple[float, float]:
        """Middle of the bed."""
        return (self.low[0] + self.high[0]) / 2.0, (self.low[1] + self.high[1]) / 2.0

    @property
    def park(self) -> tuple[float, float]:
        """Where the head rests when all is printed: behind, on the left."""
        return self.low[0] + _PARK_MM, self.high[1] - _PARK_MM


@dataclass(frozen=True, slots=True)
class SliceOptions:
    """What a slicer is told of a mesh, and how arrays are written as G-code; mm and mm/s.

    The defaults are for PLA.

    Raises
    ------
    InputError
        For a value that cannot be printed.
    """

    layer_height: float = 0.2
    first_layer_height: float = 0.2
    nozzle: float = 0.4
    width: float = 0.0  # bead width, 0: 1.125 nozzles
    perimeters: int = 2
    density: float = 0.2  # of the sparse infill, 0..1
    bed: Bed = field(default_factory=Bed)  # the part lies in its middle
    skirts: int = 2  # loops around the first layer, which also prime the nozzle; not of arrays
    fan_percent: float = 0.0  # of arrays, from the second layer on; slicers are told 100
    filament_diameter: float = 1.75
    travel_feed: float = 150.0  # of arrays
    retract_mm: float = 1.0
    retract_feed: float = 40.0
    retract_min_travel_mm: float = 2.0  # of arrays
    temperature: float = 210.0  # °C, of the nozzle
    bed_temperature: float = 60.0  # °C

    def __post_init__(self) -> None:
        check_fields(self)
        width = (0.6 * self.nozzle, 2.5 * self.nozzle) if self.width else (0.0, 0.0)
        limits = {
            "nozzle": (0.1, 2.0), "layer_height": (0.02, 0.9 * self.nozzle),
            "first_layer_height": (0.02, self.nozzle), "width": width, "density": (0.0, 1.0),
            "filament_diameter": (0.5, 5.0), **dict.fromkeys(_COUNTS, (0, 1000)),
            **dict.fromkeys(_FEEDS, (0.1, 2000.0)), **dict.fromkeys(_LENGTHS, (0.0, 500.0)),
            "temperature": (150.0, 500.0),  # colder no plastic flows
            "bed_temperature": (0.0, 200.0), "fan_percent": (0.0, 100.0),
        }  # fmt: skip
        for name, (least, most) in limits.items():
            if not least <= (value := getattr(self, name)) <= most:
                what = name.replace("_", " ")  # options of the command line read so, too
                raise InputError(
                    f"{what} {value:g} is out of bounds", advice=f"give {least:g} to {most:g}"
                )

    def for_machine(self, machine: Machine) -> SliceOptions:
        """Return the same options with a machine's bed."""
        return replace(self, bed=Bed.of(machine))

    @property
    def bead_width(self) -> float:
        """Bead width in mm."""
        return self.width or _WIDTH_PER_NOZZLE * self.nozzle

    def filament_per_mm(self, height: float, width: float) -> float:
        """Return filament mm per mm of bead, a rectangle with half-round sides."""
        area = height * (width - height * (1.0 - math.pi / 4.0))
        return area / (math.pi * self.filament_diameter**2 / 4.0)
