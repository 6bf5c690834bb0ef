"""The options shared by several commands, declared once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from decmcts.errors import InputError
from decmcts.planning.options import (
    AvoidWalls,
    Freedom,
    Limits,
    Objective,
    PlannerName,
    ProcessOrder,
    Rules,
    Seam,
)

BASICS, SEARCH, QUALITY, OUTPUT, MESH = "Basics", "Search", "Quality", "Output", "Mesh input"

Input = Annotated[
    Path,
    typer.Argument(
        help="G-code (.gcode, .gcode.gz, .bgcode, .gcode.3mf, .gx), mesh (.stl, .3mf, .obj); "
        "`plan`: SOP (.sop, .sop.gz); `launch`: QCSP (.qcsp)"
    ),
]
_MACHINE = "Preset, FILE.toml, slicer profile (.json, .ini) or geometries.json:NAME; default: "
MachineOption = Annotated[
    str | None,
    typer.Option(
        "--machine",
        rich_help_panel=BASICS,
        metavar="NAME|FILE",
        help=_MACHINE + "the source's printer, or a head of the clearances in it",
    ),
]
PlateOption = Annotated[
    int | None,
    typer.Option(
        "--plate",
        rich_help_panel=BASICS,
        metavar="N",
        min=1,
        help="Of a .gcode.3mf: the plate; default: the only one with G-code",
    ),
]
ListedMachineOption = Annotated[
    str | None,
    typer.Option(
        "--machine", rich_help_panel=BASICS, metavar="NAME|FILE", help=_MACHINE + "all presets"
    ),
]
PlannerOption = Annotated[
    PlannerName,
    typer.Option(
        "--planner",
        rich_help_panel=SEARCH,
        metavar="PLANNER",
        help=f"How the order is found: {', '.join(PlannerName)}",
    ),
]
FreedomOption = Annotated[
    Freedom,
    typer.Option(
        "--freedom",
        rich_help_panel=SEARCH,
        metavar="FREEDOM",
        help="fixed: as sliced; reversible: from either end; seam: loops from another vertex too",
    ),
]
SeamOption = Annotated[
    Seam | None,
    typer.Option(
        "--seam",
        rich_help_panel=SEARCH,
        metavar="SEAM",
        help="With --freedom seam. nearest: wherever travel is least (default); aligned: above "
        "the seam below; rear: largest Y; corner: sharpest, concave first",
    ),
]
ProcessOption = Annotated[
    ProcessOrder,
    typer.Option(
        "--process-order",
        rich_help_panel=QUALITY,
        metavar="ORDER",
        help="keep: perimeters before the infill they anchor; free: only what --quality holds",
    ),
]
QualityOption = Annotated[
    bool | None,
    typer.Option(
        "--quality/--no-quality",
        rich_help_panel=QUALITY,
        help="Shells and what is anchored in them as sliced, and cooling; "
        "default: on but for the paper's machine",
        show_default=False,
    ),
]
TowerOption = Annotated[
    bool,
    typer.Option(
        "--without-tower",
        rich_help_panel=QUALITY,
        help="Leave out the wipe tower, where each head has one tool",
    ),
]
_DAY_S = 86400.0
CoolingOption = Annotated[
    float | None,
    typer.Option(
        "--min-layer-time",
        rich_help_panel=QUALITY,
        metavar="S",
        min=0.0,
        max=_DAY_S,
        help="Seconds before a spot is printed over, or the source's if fewer; default: the "
        "slicer's rule, none with --no-quality or machine `paper`; 0: none",
    ),
]
LeadOption = Annotated[
    int | None,
    typer.Option(
        "--max-layers-ahead",
        rich_help_panel=QUALITY,
        metavar="N",
        min=0,
        help="How many layers a part may run ahead of the rest; default: no limit",
    ),
]
AvoidOption = Annotated[
    AvoidWalls,
    typer.Option(
        "--avoid-walls",
        rich_help_panel=QUALITY,
        metavar="WHEN",
        help="Lead travels round outer walls, through the part. auto: over walls no more than the "
        "source; always; never",
    ),
]
_HELD = "A plan.json is held to it; default: as the plan says"
HeldProcessOption = Annotated[
    ProcessOrder | None,
    typer.Option("--process-order", rich_help_panel=QUALITY, metavar="ORDER", help=_HELD),
]
HeldQualityOption = Annotated[
    bool | None,
    typer.Option("--quality/--no-quality", rich_help_panel=QUALITY, help=_HELD, show_default=False),
]
HeldCoolingOption = Annotated[
    float | None,
    typer.Option(
        "--min-layer-time", rich_help_panel=QUALITY, metavar="S", min=0.0, max=_DAY_S, help=_HELD
    ),
]
HeldLeadOption = Annotated[
    int | None,
    typer.Option("--max-layers-ahead", rich_help_panel=QUALITY, metavar="N", min=0, help=_HELD),
]
HeldFreedomOption = Annotated[
    Freedom | None,
    typer.Option("--freedom", rich_help_panel=SEARCH, metavar="FREEDOM", help=_HELD),
]
ObjectiveOption = Annotated[
    Objective,
    typer.Option(
        "--objective",
        rich_help_panel=SEARCH,
        metavar="OBJECTIVE",
        help="travel: the length of travels; time: their time with retraction, lift and wipe",
    ),
]
LimitsOption = Annotated[
    Limits,
    typer.Option(
        "--limits",
        rich_help_panel=SEARCH,
        metavar="LIMITS",
        help="Motion limits. source: as the file states them, else the machine file's; "
        "machine: always the machine file's",
    ),
]
SlowerOption = Annotated[
    bool,
    typer.Option(
        "--allow-slower",
        rich_help_panel=OUTPUT,
        help="Write the new order even where its file takes longer or gains nothing",
    ),
]
MakeSafeOption = Annotated[
    bool,
    typer.Option(
        "--make-safe",
        rich_help_panel=OUTPUT,
        help="Print layer by layer what would hit the part in the file's own order; without it "
        "such a file is refused",
    ),
]
TimeOption = Annotated[
    float,
    typer.Option(
        "--time-limit",
        rich_help_panel=BASICS,
        metavar="S",
        min=0.0,
        max=30 * _DAY_S,
        help="Search time, seconds",
    ),
]
SeedOption = Annotated[
    int,
    typer.Option(
        "--seed", rich_help_panel=SEARCH, metavar="N", min=0, help="Equal seeds give equal searches"
    ),
]
GcodeOption = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        metavar="FILE",
        rich_help_panel=BASICS,
        help="Write the G-code (of a .sop, the tour); -: to standard output",
    ),
]
PlanOption = Annotated[
    Path | None,
    typer.Option(
        "--plan", rich_help_panel=OUTPUT, metavar="FILE", help="Write plan.json (or .json.gz)"
    ),
]
ReportOption = Annotated[
    Path | None,
    typer.Option("--report", rich_help_panel=OUTPUT, metavar="FILE", help="Write an HTML report"),
]
PictureOption = Annotated[
    Path | None,
    typer.Option(
        "--picture",
        rich_help_panel=OUTPUT,
        metavar="FILE",
        help="Draw what changed, and who prints what: .png or .svg",
    ),
]
LayerOption = Annotated[
    int | None,
    typer.Option(
        "--picture-layer",
        rich_help_panel=OUTPUT,
        metavar="N",
        min=1,
        help="The layer in the picture; default: where travel changed most",
    ),
]
VerboseOption = Annotated[
    bool,
    typer.Option(
        "-v",
        "--verbose",
        rich_help_panel=OUTPUT,
        help="Show the paper's figures too, and how it was searched",
    ),
]
WeldOption = Annotated[
    float | None,
    typer.Option(
        "--weld-limit-s",
        rich_help_panel=SEARCH,
        metavar="S",
        help="The most seconds between the printing of a cut's two ends (default: no limit; of a "
        "rest, its plan's)",
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", rich_help_panel=OUTPUT, help="Print the summary as JSON")
]
LayerHeight = Annotated[
    float,
    typer.Option("--layer-height", rich_help_panel=MESH, metavar="MM", help="Layer height, mm"),
]
Nozzle = Annotated[
    float, typer.Option("--nozzle", rich_help_panel=MESH, metavar="MM", help="Nozzle diameter, mm")
]
Density = Annotated[
    float,
    typer.Option("--density", rich_help_panel=MESH, metavar="SHARE", help="Infill density, 0 to 1"),
]
Perimeters = Annotated[
    int,
    typer.Option("--perimeters", rich_help_panel=MESH, metavar="N", help="Number of perimeters"),
]
SlicerOption = Annotated[
    str,
    typer.Option(
        "--slicer",
        rich_help_panel=MESH,
        metavar="NAME",
        help="auto (the first of PrusaSlicer, OrcaSlicer and CuraEngine that is found), "
        "builtin (for experiments), a slicer's name, or the path of its program",
    ),
]
SlicerConfig = Annotated[
    str | None,
    typer.Option(
        "--slicer-config",
        rich_help_panel=MESH,
        metavar="FILES",
        help="PrusaSlicer: config.ini; OrcaSlicer: 'machine.json;process.json;filament.json'; "
        "CuraEngine: fdmprinter.def.json",
    ),
]
Sliced = Annotated[
    Path | None,
    typer.Option(
        "--sliced", rich_help_panel=MESH, metavar="FILE", help="Keep the slicer's own G-code here"
    ),
]
Temperature = Annotated[
    float,
    typer.Option("--temperature", rich_help_panel=MESH, metavar="C", help="Of the nozzle, °C"),
]
BedTemperature = Annotated[
    float,
    typer.Option("--bed-temperature", rich_help_panel=MESH, metavar="C", help="Of the bed, °C"),
]

MESH_OPTIONS = (  # they mean nothing to G-code
    "slicer", "slicer_config", "sliced", "layer_height", "nozzle", "density", "perimeters",
    "temperature", "bed_temperature",
)  # fmt: skip


def given(context: typer.Context) -> dict[str, list[str]]:
    """Return what was said on the command line: by name, how it may be spelled (--yes, --no)."""
    found: dict[str, list[str]] = {}
    for parameter in context.command.params:
        origin = context.get_parameter_source(parameter.name or "")
        if parameter.name and origin is not None and origin.name == "COMMANDLINE":
            found[parameter.name] = [*parameter.opts, *parameter.secondary_opts]
    return found


def rules_of(
    freedom: Freedom,
    seam: Seam | None,
    process_order: ProcessOrder,
    quality: bool | None,
    min_layer_time_s: float | None,
    max_layers_ahead: int | None,
    avoid_walls: AvoidWalls = AvoidWalls.AUTO,
    *,
    without_tower: bool = False,
) -> Rules:
    """Return the rules that were asked for; InputError for a seam that would mean nothing."""
    if seam is not None and freedom != Freedom.SEAM:
        raise InputError(
            f"--seam {seam.value} needs --freedom seam, this is freedom {freedom.value}",
            advice="add --freedom seam, or leave --seam out",
        )
    return Rules(
        process_order,
        quality,
        min_layer_time_s,
        max_layers_ahead,
        freedom,
        seam or Seam.NEAREST,
        avoid_walls,
        without_tower,
    )
