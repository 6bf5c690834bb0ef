"""The program that commands register on, and the options that several share."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from decmcts.errors import InputError
from decmcts.planning.options import (
    MOST_STAGGER_MM,
    STAGGER_MM,
    AvoidWalls,
    Freedom,
    Limits,
    Objective,
    PlannerName,
    ProcessOrder,
    Seam,
)
from decmcts.version import __version__

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Finds a better, proven-safe order for the extrusions of a 3D print.",
)


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"decmcts {__version__}")
        raise typer.Exit


@app.callback()
def of_every_command(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    """Options of every command."""
    if debug:
        os.environ["DECMCTS_DEBUG"] = "1"


def options_of(panel: str) -> Callable[..., Any]:
    """Return what declares an option of a panel of the help.

    It takes the option as the help spells it ("-o --output FILE"), what is said of it, and what
    `typer.Option` takes besides.
    """

    def option(spelled: str, text: str, **more: Any) -> Any:
        words = spelled.split()
        names = [word for word in words if word.startswith("-")]
        metavar = " ".join(words[len(names) :]) or None
        return typer.Option(*names, help=text, metavar=metavar, rich_help_panel=panel, **more)

    return option


basics, search, quality, output, mesh = map(
    options_of, ("Basics", "Search", "Quality", "Output", "Mesh input")
)

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
    basics(
        "--machine NAME|FILE", _MACHINE + "the source's printer, or a head of the clearances in it"
    ),
]
PlateOption = Annotated[
    int | None,
    basics("--plate N", "Of a .gcode.3mf: the plate; default: the only one with G-code", min=1),
]
ListedMachineOption = Annotated[str | None, basics("--machine NAME|FILE", _MACHINE + "all presets")]
PlannerOption = Annotated[
    PlannerName, search("--planner PLANNER", f"How the order is found: {', '.join(PlannerName)}")
]
FreedomOption = Annotated[
    Freedom,
    search(
        "--freedom FREEDOM",
        "fixed: as sliced; reversible: from either end; seam: loops from another vertex too",
    ),
]
SeamOption = Annotated[
    Seam,
    search(
        "--seam SEAM",
        "With --freedom seam. nearest: wherever travel is least (default); aligned: "
        "above the seam below; rear: largest Y; corner: sharpest, concave first",
        show_default=False,
    ),
]
ProcessOption = Annotated[
    ProcessOrder,
    quality(
        "--process-order ORDER",
        "keep: perimeters before the infill they anchor; free: only what --quality holds",
    ),
]
QualityOption = Annotated[
    bool | None,
    quality(
        "--quality/--no-quality",
        "Shells and what is anchored in them as sliced, and cooling; default: on but "
        "for the paper's machine",
        show_default=False,
    ),
]
TowerOption = Annotated[
    bool, quality("--without-tower", "Leave out the wipe tower, where each head has one tool")
]
_DAY_S = 86400.0
CoolingOption = Annotated[
    float | None,
    quality(
        "--min-layer-time S",
        "Seconds before a spot is printed over, or the source's if fewer; default: the "
        "slicer's rule, none with --no-quality or machine `paper`; 0: none",
        min=0.0,
        max=_DAY_S,
    ),
]
LeadOption = Annotated[
    int | None,
    quality(
        "--max-layers-ahead N",
        "How many layers a part may run ahead of the rest; default: no limit",
        min=0,
    ),
]
AvoidOption = Annotated[
    AvoidWalls,
    quality(
        "--avoid-walls WHEN",
        "Lead travels round outer walls, through the part. auto: over walls no more "
        "than the source; always; never",
    ),
]
_HELD = "A plan.json is held to it; default: as the plan says"
HeldProcessOption = Annotated[ProcessOrder | None, quality("--process-order ORDER", _HELD)]
HeldQualityOption = Annotated[
    bool | None, quality("--quality/--no-quality", _HELD, show_default=False)
]
HeldCoolingOption = Annotated[
    float | None, quality("--min-layer-time S", _HELD, min=0.0, max=_DAY_S)
]
HeldLeadOption = Annotated[int | None, quality("--max-layers-ahead N", _HELD, min=0)]
HeldFreedomOption = Annotated[Freedom | None, search("--freedom FREEDOM", _HELD)]
ObjectiveOption = Annotated[
    Objective,
    search(
        "--objective OBJECTIVE",
        "travel: the length of travels; time: their time with retraction, lift and wipe",
    ),
]
LimitsOption = Annotated[
    Limits,
    search(
        "--limits LIMITS",
        "Motion limits. source: as the file states them, else the machine file's; "
        "machine: always the machine file's",
    ),
]
SlowerOption = Annotated[
    bool,
    output(
        "--allow-slower", "Write the new order even where its file takes longer or gains nothing"
    ),
]
MakeSafeOption = Annotated[
    bool,
    output(
        "--make-safe",
        "Print layer by layer what would hit the part in the file's own order; without "
        "it such a file is refused",
    ),
]
MOST_S = 30 * _DAY_S
TimeOption = Annotated[float, basics("--time-limit S", "Search time, seconds", min=0.0, max=MOST_S)]
SeedOption = Annotated[int, search("--seed N", "Equal seeds give equal searches", min=0)]
TimingSeedOption = Annotated[
    int, search("--seed N", "Equal seeds give equal errors of time", min=0)
]
GcodeOption = Annotated[
    Path | None,
    basics("-o --output FILE", "Write the G-code (of a .sop, the tour); -: to standard output"),
]
PlanOption = Annotated[Path | None, output("--plan FILE", "Write plan.json (or .json.gz)")]
ReportOption = Annotated[Path | None, output("--report FILE", "Write an HTML report")]
PictureOption = Annotated[
    Path | None, output("--picture FILE", "Draw what changed, and who prints what: .png or .svg")
]
LayerOption = Annotated[
    int | None,
    output(
        "--picture-layer N", "The layer in the picture; default: where travel changed most", min=1
    ),
]
VerboseOption = Annotated[
    bool, output("-v --verbose", "Show the paper's figures too, and how it was searched")
]
WeldOption = Annotated[
    float | None,
    search(
        "--weld-limit-s S",
        "The most seconds between the printing of a cut's two ends (default: no limit; of a "
        "rest, its plan's)",
        min=0.0,
        max=MOST_S,
    ),
]
StaggerOption = Annotated[
    float | None,
    search(
        "--stagger-mm MM",
        f"By which cuts move from layer to layer, so that joints interlock (default: "
        f"{STAGGER_MM:g}); 0: all above one another",
        min=0.0,
        max=MOST_STAGGER_MM,
    ),
]
JsonOption = Annotated[bool, output("--json", "Print the summary as JSON")]
LayerHeight = Annotated[float, mesh("--layer-height MM", "Layer height, mm")]
Nozzle = Annotated[float, mesh("--nozzle MM", "Nozzle diameter, mm")]
Density = Annotated[float, mesh("--density SHARE", "Infill density, 0 to 1")]
Perimeters = Annotated[int, mesh("--perimeters N", "Number of perimeters")]
SlicerOption = Annotated[
    str,
    mesh(
        "--slicer NAME",
        "auto (the first of PrusaSlicer, OrcaSlicer and CuraEngine that is found), "
        "a slicer's name, or the path of its program",
    ),
]
SlicerConfig = Annotated[
    str | None,
    mesh(
        "--slicer-config FILES",
        "PrusaSlicer: config.ini; OrcaSlicer: "
        "'machine.json;process.json;filament.json'; CuraEngine: fdmprinter.def.json",
    ),
]
Sliced = Annotated[Path | None, mesh("--sliced FILE", "Keep the slicer's own G-code here")]
Temperature = Annotated[float, mesh("--temperature C", "Of the nozzle, °C")]
BedTemperature = Annotated[float, mesh("--bed-temperature C", "Of the bed, °C")]

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


def refuse_layer_alone(picture_layer: int | None, picture: Path | None) -> None:
    """Raise InputError for the layer of a picture where none is drawn."""
    if picture_layer is not None and picture is None:
        raise InputError(
            f"--picture-layer {picture_layer} is of a picture, and none is drawn",
            advice="add --picture FILE, or leave --picture-layer out",
        )
