"""What a slicer can be told."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

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


_COUNTS = ("perimeters", "top_layers", "bottom_layers", "skirts")
_FEEDS = (
    "perimeter_feed", "external_feed", "infill_feed", "solid_feed", "first_layer_feed",
    "travel_feed", "retract_feed",
)  # fmt: skip
_LENGTHS = ("retract_mm", "retract_min_travel_mm", "skirt_distance")
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
    """Options of the built-in slicer; lengths in mm, feeds in mm/s.

    The defaults are for PLA. Skirt and fan are off, for a bare print to compute with;
    `decmcts plan` turns them on.

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
    external_first: bool = False  # outer wall before the inner ones
    density: float = 0.2  # of the sparse infill, 0..1
    top_layers: int = 3
    bottom_layers: int = 3
    center: tuple[float, float] | None = (125.0, 105.0)  # of the whole mesh; None: as in the file
    bed: Bed = field(default_factory=Bed)  # for the end code and other slicers
    largest: tuple[float, float, float] | None = None  # larger meshes are refused; None: none is
    skirts: int = 0  # loops around the first layer, which also prime the nozzle
    skirt_distance: float = 6.0
    fan_percent: float = 0.0  # from the second layer on
    filament_diameter: float = 1.75
    perimeter_feed: float = 60.0
    external_feed: float = 40.0
    infill_feed: float = 80.0
    solid_feed: float = 60.0
    first_layer_feed: float = 30.0
    travel_feed: float = 150.0
    retract_mm: float = 1.0
    retract_feed: float = 40.0
    retract_min_travel_mm: float = 2.0
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
        """Return the same options for a mesh in the middle of a machine's bed."""
        bed = Bed.of(machine)
        return replace(self.no_larger_than(machine), bed=bed, center=bed.center)

    def no_larger_than(self, machine: Machine) -> SliceOptions:
        """Return the same options that refuse what a machine has no space for."""
        width, depth = np.subtract(machine.bed_max, machine.bed_min).tolist()
        height = max(head.reach_max[2] for head in machine.heads)
        return replace(self, largest=(width, depth, height))

    @property
    def bead_width(self) -> float:
        """Bead width in mm."""
        return self.width or _WIDTH_PER_NOZZLE * self.nozzle

    def spacing(self, height: float, width: float | None = None) -> float:
        """Return the distance of neighbouring beads of one layer, of this width or ours, mm.

        A bead is a rectangle with half-round sides; at this distance its area
        is spacing times height, so beads side by side fill their volume.
        """
        wide = self.bead_width if width is None else width
        return wide - height * (1.0 - math.pi / 4.0)

    def filament_per_mm(self, height: float, width: float | None = None) -> float:
        """Return filament mm per mm of bead."""
        area = height * self.spacing(height, width)
        return area / (math.pi * self.filament_diameter**2 / 4.0)
