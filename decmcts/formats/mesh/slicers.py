"""The commands of real slicers: what is handed on to each, and how.

Nothing is run here; `decmcts.planning.problem.slicing` runs what these functions return.
PrusaSlicer takes options as words, CuraEngine as settings beside a definition file,
OrcaSlicer from profile files only (its command line knows no single settings and does
not follow `inherits`), so edited copies of those are handed on.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from decmcts.errors import InputError
from decmcts.formats.files.reading import read_json
from decmcts.formats.mesh.options import SliceOptions

CURA_DEFINITION = "resources/definitions/fdmprinter.def.json"
_LIFT_MM = 10.0  # above the print, before the head parks


class Slicer(StrEnum):
    """The slicers whose command lines are known, first choice first."""

    PRUSA = "prusaslicer"
    ORCA = "orcaslicer"
    CURA = "curaengine"


PROGRAMS = {
    Slicer.PRUSA: ("prusa-slicer", "PrusaSlicer", "prusa-slicer-console"),
    Slicer.ORCA: ("orca-slicer", "OrcaSlicer"),
    Slicer.CURA: ("CuraEngine", "curaengine"),
}


@dataclass(frozen=True, slots=True)
class Request:
    """What is to be sliced, and how; paths are absolute."""

    program: Path
    mesh: Path
    folder: Path  # where everything is written
    options: SliceOptions
    given: Set[str]  # options the user named; with a configuration only these are handed on
    config: tuple[Path, ...] = ()  # profiles in the slicer's own format


@dataclass(frozen=True, slots=True)
class SlicerCommand:
    """A command, the file it makes, and files that must be there before it starts."""

    words: tuple[str, ...]
    output: Path
    files: tuple[tuple[Path, str], ...] = ()


def slicer_of(program: Path) -> Slicer | None:
    """Return which slicer a program is, by its name; None if that says nothing.

    Examples
    --------
    >>> slicer_of(Path("/opt/PrusaSlicer-2.9.2-x86_64.AppImage"))
    <Slicer.PRUSA: 'prusaslicer'>
    """
    name = program.name.lower().replace("-", "").replace("_", "")
    return next((slicer for slicer in Slicer if name.startswith(slicer.value)), None)


def command_for(slicer: Slicer, request: Request) -> SlicerCommand:
    """Return the command that slices; raises InputError for a configuration it cannot use."""
    makers: dict[Slicer, Callable[[Request], SlicerCommand]] = {
        Slicer.PRUSA: _prusa, Slicer.ORCA: _orca, Slicer.CURA: _cura,
    }  # fmt: skip
    return makers[slicer](request)


# -- PrusaSlicer ----------------------------------------------------------------


def _prusa(request: Request) -> SlicerCommand:
    output = request.folder / "sliced.gcode"
    x, y = request.options.bed.center
    printer = request.folder / "printer.ini"
    words = [str(request.program), "--export-gcode", "--center", f"{x:g},{y:g}"]
    for config in request.config or (printer,):
        words += ["--load", str(config)]
    for name, values in _prusa_options(request.options).items():
        if not request.config or name in request.given:
            for key, value in values:
                words += [f"--{key}", value]
    files = [] if request.config else [(printer, _prusa_printer(request.options))]
    return SlicerCommand((*words, "-o", str(output), str(request.mesh)), output, tuple(files))


def _prusa_options(options: SliceOptions) -> dict[str, list[tuple[str, str]]]:
    """Return for each of our options PrusaSlicer's with their values."""
    warm, bed = f"{options.temperature:g}", f"{options.bed_temperature:g}"
    first = f"{options.first_layer_height:g}"
    return {
        "layer_height": [("layer-height", f"{options.layer_height:g}")],
        "first_layer_height": [("first-layer-height", first)],
        "nozzle": [("nozzle-diameter", f"{options.nozzle:g}")],
        "density": [("fill-density", f"{100.0 * options.density:g}%")],
        "perimeters": [("perimeters", str(options.perimeters))],
        "temperature": [("temperature", warm), ("first-layer-temperature", warm)],
        "bed_temperature": [("bed-temperature", bed), ("first-layer-bed-temperature", bed)],
    }


def _prusa_printer(options: SliceOptions) -> str:
    """Return a plain printer with this bed, printing PLA: fan, skirt, and a head that parks."""
    bed = options.bed
    (x0, y0), (x1, y1) = bed.low, bed.high
    px, py = bed.park
    up = f"G1 Z{{min(max_layer_z+{_LIFT_MM:g},{bed.height:g})}} F600"
    values = {
        "bed_shape": f"{x0:g}x{y0:g},{x1:g}x{y0:g},{x1:g}x{y1:g},{x0:g}x{y1:g}",
        "max_print_height": f"{bed.height:g}",
        "filament_diameter": f"{options.filament_diameter:g}",
        "gcode_flavor": "marlin",
        "retract_length": f"{options.retract_mm:g}",
        "retract_speed": f"{options.retract_feed:g}",
        "cooling": "1",
        "fan_always_on": "1",
        "min_fan_speed": "100",
        "max_fan_speed": "100",
        "disable_fan_first_layers": "1",
        "skirts": f"{options.skirts}",
        "min_skirt_length": "10",
        "start_gcode": "G28 ; home",
        "end_gcode": rf"{up}\nG1 X{px:g} Y{py:g} F6000\nM104 S0\nM140 S0\nM107\nM84",
    }
    return "".join(f"{key} = {value}\n" for key, value in values.items())


# -- CuraEngine -----------------------------------------------------------------


def _cura(request: Request) -> SlicerCommand:
    """Return CuraEngine's command; it takes settings as they are and derives none of another."""
    if len(request.config) != 1:
        raise InputError(
            "CuraEngine has no settings of its own and needs one definition file",
            path=request.program,
            advice="add --slicer-config fdmprinter.def.json, from the folder "
            "resources/definitions of Cura",
        )
    output = request.folder / "sliced.gcode"
    settings = [word for s in _cura_settings(request.options) for word in ("-s", "=".join(s))]
    words = [str(request.program), "slice", "-j", str(request.config[0]), *settings]
    words += ["-e0", *settings, "-o", str(output), "-l", str(request.mesh)]
    return SlicerCommand(tuple(words), output)


def _cura_settings(options: SliceOptions) -> list[tuple[str, str]]:
    """Return settings with all that Cura's front end would derive of them."""
    bed, width = options.bed, options.bead_width
    (x0, y0), (x1, y1) = bed.low, bed.high
    px, py = bed.park
    lines = 2.0 * width / options.density if options.density else 0.0  # grid: two directions
    end = (
        f"G91\nG1 E-1 F1800\nG1 Z{_LIFT_MM:g} F600\nG90\nG1 X{px:g} Y{py:g} F6000\n"
        "M104 S0\nM140 S0\nM107\nM84"
    )
    values: dict[str, float | str] = {
        "machine_width": x1 - x0, "machine_depth": y1 - y0, "machine_height": bed.height,
        "machine_center_is_zero": "false", "center_object": "false",
        "mesh_position_x": (x0 - x1) / 2.0, "mesh_position_y": (y0 - y1) / 2.0,  # it adds the half
        "machine_gcode_flavor": "RepRap (Marlin/Sprinter)", "machine_heated_bed": "true",
        "machine_start_gcode": "G28 ;Home\nG92 E0", "machine_end_gcode": end,
        "machine_nozzle_size": options.nozzle, "material_diameter": options.filament_diameter,
        "layer_height": options.layer_height, "layer_height_0": options.first_layer_height,
        "infill_sparse_thickness": options.layer_height,
        "adhesion_type": "skirt" if options.skirts else "none",
        "skirt_line_count": options.skirts, "infill_pattern": "grid",
        "infill_sparse_density": 100.0 * options.density, "infill_line_distance": lines,
        "wall_line_count": options.perimeters,
        "wall_thickness": options.perimeters * width,
        "top_layers": 3, "bottom_layers": 3, "initial_bottom_layers": 3,
        "retraction_amount": options.retract_mm, "retraction_extrusion_window": options.retract_mm,
        "retraction_speed": options.retract_feed,
        "retraction_retract_speed": options.retract_feed,
        "retraction_prime_speed": options.retract_feed,
        "material_print_temperature": options.temperature,
        "material_print_temperature_layer_0": options.temperature,
        "material_initial_print_temperature": options.temperature,
        "material_final_print_temperature": options.temperature,
        "material_bed_temperature": options.bed_temperature,
        "material_bed_temperature_layer_0": options.bed_temperature,
    }  # fmt: skip
    widths = ("", "wall_", "skin_", "infill_", "skirt_brim_")
    values |= {f"{part}line_width": width for part in widths}
    values |= {"wall_line_width_0": width, "wall_line_width_x": width}
    return [(k, v if isinstance(v, str) else f"{v:g}") for k, v in values.items()]


# -- OrcaSlicer -----------------------------------------------------------------


def _orca(request: Request) -> SlicerCommand:
    """Return OrcaSlicer's command; it writes `plate_1.gcode` into a folder."""
    read = ((path, read_json(path, "profile of OrcaSlicer")) for path in request.config)
    profiles = {_orca_type(profile, path): profile for path, profile in read}
    if not {"machine", "process"} <= profiles.keys():
        raise InputError(
            "OrcaSlicer takes its settings from profiles only: a machine and a process are needed",
            path=request.program,
            advice="add --slicer-config 'machine.json;process.json;filament.json', exported whole",
        )
    files = []
    for kind, profile in profiles.items():
        chosen = {
            k: v for k, v, name in _orca_options(kind, request.options) if name in request.given
        }
        files.append((request.folder / f"{kind}.json", json.dumps({**profile, **chosen})))
    words = [str(request.program), "--slice", "0", "--arrange", "1", "--ensure-on-bed"]
    loaded = ";".join(str(request.folder / f"{kind}.json") for kind in ("machine", "process"))
    words += ["--load-settings", loaded]
    if "filament" in profiles:
        words += ["--load-filaments", str(request.folder / "filament.json")]
    words += ["--outputdir", str(request.folder), str(request.mesh)]
    return SlicerCommand(tuple(words), request.folder / "plate_1.gcode", tuple(files))


def _orca_options(kind: str, options: SliceOptions) -> list[tuple[str, Any, str]]:
    """Return the keys of one kind of profile with their values and our options' names."""
    warm, bed = [f"{options.temperature:g}"], [f"{options.bed_temperature:g}"]
    known: dict[str, list[tuple[str, Any, str]]] = {
        "machine": [("nozzle_diameter", [f"{options.nozzle:g}"], "nozzle")],
        "process": [
            ("layer_height", f"{options.layer_height:g}", "layer_height"),
            ("sparse_infill_density", f"{100.0 * options.density:g}%", "density"),
            ("wall_loops", str(options.perimeters), "perimeters"),
        ],
        "filament": [
            ("nozzle_temperature", warm, "temperature"),
            ("nozzle_temperature_initial_layer", warm, "temperature"),
            ("hot_plate_temp", bed, "bed_temperature"),
            ("hot_plate_temp_initial_layer", bed, "bed_temperature"),
        ],
    }
    return known[kind]


def _orca_type(profile: Mapping[str, Any], path: Path) -> str:
    """Return the kind of a profile; raises InputError for one its command line cannot read."""
    kind = profile.get("type")
    if kind not in ("machine", "process", "filament"):
        raise InputError(
            f"names no type of profile OrcaSlicer loads (type: {kind})",
            path=path,
            advice='"type" must be "machine", "process" or "filament"',
        )
    if profile.get("inherits"):
        raise InputError(
            f"inherits from '{profile['inherits']}', which OrcaSlicer's command line ignores",
            path=path,
            advice="write all its settings into one profile and leave `inherits` out",
        )
    return str(kind)


def config_paths(text: str | None) -> tuple[Path, ...]:
    """Return the files of `--slicer-config`, several parted by `;`."""
    names: Sequence[str] = [name for name in (text or "").split(";") if name.strip()]
    for path in map(Path, names):
        if not path.is_file():
            raise InputError("no such file", path=path, advice="see --slicer-config")
    return tuple(Path(name).resolve() for name in names)
