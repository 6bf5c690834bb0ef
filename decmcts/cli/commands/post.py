"""`decmcts post`: a slicer's post-processing script, editing one file in place.

Any error leaves the file untouched and the exit code non-zero, so that the
slicer aborts its export (PrusaSlicer, OrcaSlicer).

`--report` and `--picture` may stand alone or with a file. A slicer puts the file it hands over
behind the words of its script. So what follows such an option is its file only if it is named like
one.

`--show-line` prints the line that has a slicer call this program. PrusaSlicer and its kin hand the
line to a shell, on Windows to the system. There the program is looked for under the name that
stands first, so its whole path with `.exe` has to be there.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from decmcts.cli import options as opt
from decmcts.cli.commands.plan import run_single, write_extras
from decmcts.cli.console import err, out, print_json, steps, written
from decmcts.cli.lines import figures, plain_lines, searched_line, whole_file_line
from decmcts.cli.signals import interrupt_stops
from decmcts.errors import InputError
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.gcode.writing.own_header import AsSliced, as_sliced
from decmcts.formats.mesh import is_mesh
from decmcts.planning.options import RULES, SEARCH, Limits, PlannerName, Rules, Search
from decmcts.planning.problem.source import beside, exported_file, is_foreign
from decmcts.planning.result import Written
from decmcts.planning.writing.lines import layers_line, source_lines
from decmcts.planning.writing.places import refuse_other_suffixes, refuse_place, refuse_unwritable

BESIDE = Path("beside")  # no name such an option takes: its file stands next to the exported one
ENDINGS = {"--report": (".html", ".htm"), "--picture": (".png", ".svg")}


def completed(arguments: Sequence[str]) -> list[str]:
    """Return arguments in which each such option has a file.

    Examples
    --------
    >>> completed(["--report", "part.gcode", "--picture", "p.png"])
    ['--report', 'beside', 'part.gcode', '--picture', 'p.png']
    """
    made = list[str]()
    for k, word in enumerate(arguments):
        made.append(word)
        if word == "--":
            return [*made, *arguments[k + 1 :]]
        following = arguments[k + 1] if k + 1 < len(arguments) else ""
        if word in ENDINGS and not following.lower().endswith(ENDINGS[word]):
            made.append(str(BESIDE))
    return made


class OptionalFiles(TyperCommand):
    """A command with such options."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments once each of these options has a file; keep them as they came."""
        ctx.meta[__name__] = list(args)
        return super().parse_args(ctx, completed(args))


BESIDE_WORDS = "; without FILE next to the exported G-code"


@opt.app.command(cls=OptionalFiles)
def post(
    context: typer.Context,
    path: Annotated[
        Path | None, typer.Argument(help="G-code file the slicer hands over", show_default=False)
    ] = None,
    machine: opt.MachineOption = None,
    plate: opt.PlateOption = None,
    planner: opt.PlannerOption = PlannerName.HYBRID,
    freedom: opt.FreedomOption = RULES.freedom,
    seam: opt.SeamOption = RULES.seam,
    process_order: opt.ProcessOption = RULES.process_order,
    objective: opt.ObjectiveOption = SEARCH.objective,
    limits: opt.LimitsOption = Limits.SOURCE,
    quality: opt.QualityOption = None,
    min_layer_time: opt.CoolingOption = None,
    max_layers_ahead: opt.LeadOption = None,
    avoid_walls: opt.AvoidOption = RULES.avoid_walls,
    time_limit: opt.TimeOption = SEARCH.time_limit_s,
    seed: opt.SeedOption = 0,
    allow_slower: opt.SlowerOption = False,
    make_safe: opt.MakeSafeOption = False,
    report: Annotated[
        Path | None, opt.output("--report [FILE]", f"Write an HTML report{BESIDE_WORDS}")
    ] = None,
    picture: Annotated[
        Path | None,
        opt.output("--picture [FILE]", f"Draw what changed, .png or .svg{BESIDE_WORDS}"),
    ] = None,
    as_json: opt.JsonOption = False,
    verbose: opt.VerboseOption = False,
    show_line: Annotated[
        bool,
        opt.output(
            "--show-line",
            "Show the line for the slicer's post-processing scripts, with the options given",
        ),
    ] = False,
) -> None:
    """Reorder a G-code file in place, as a slicer's post-processing script."""
    if show_line:
        show_script_line(context)
        return
    if path is None:
        raise InputError(
            "no file is named", advice="name one, or use --show-line for the slicer's line"
        )
    refuse_unwritable([view for view in (report, picture) if view != BESIDE], path)
    exported = exported_file(path)
    report = named_beside(exported, ".report.html") if report == BESIDE else report
    picture = named_beside(exported, ".picture.png") if picture == BESIDE else picture
    refuse_other_suffixes(None, report, picture)
    refuse_place(path, advice="it is edited in place: make it and its folder writable")
    if is_mesh(path):
        raise InputError("a mesh cannot be edited in place", path=path, advice="use decmcts plan")
    rules = Rules(
        process_order, quality, min_layer_time, max_layers_ahead, freedom, seam, avoid_walls
    )
    if (before := as_sliced(load_text(path, plate))) is not None:
        with written():
            show_planned_already(before, path, views=bool(report or picture), as_json=as_json)
        return
    search = Search(time_limit, seed, planner, objective, certificate=False)
    result = run_single(
        path, machine, search, rules, limits=limits, plate=plate, make_safe=make_safe,
        logged=verbose,
    )  # fmt: skip
    with interrupt_stops() as stop, steps(logged=verbose) as progress:
        made = result.write_gcode(path, allow_slower=allow_slower, report=progress, stop=stop)
        views = write_extras(made.result, None, report, picture, None, progress)
    with written():
        show_rewritten(made, path, views, as_json=as_json, verbose=verbose)


def named_beside(exported: Path, ending: str) -> Path | None:
    """Return the name of a report or picture; None where a file of somebody else has it."""
    path = beside(exported, ending)
    if not is_foreign(path):
        return path
    err.show(f"{path} is left as it is: it is not ours; name another file")
    return None


def show_script_line(context: typer.Context) -> None:
    """Show what to paste into a slicer, with the options that were given."""
    words = [word for word in context.meta[__name__] if word != "--show-line"]
    if context.params["path"] is not None:
        raise InputError("the slicer names the file itself", advice="leave it out with --show-line")
    line = script_line(own_program(), ["post", *wherever_it_runs(words)], windows=os.name == "nt")
    out.show(line)
    err.show(*WHERE)


def show_planned_already(before: AsSliced, path: Path, *, views: bool, as_json: bool) -> None:
    """Say that a file is a result of ours, which another search would only shuffle.

    Then there are no `views`: what it was made of is not known.
    """
    if as_json:
        figures = {"input": str(path), "kept_source": True, "planned_already": before.version}
        print_json("decmcts-result/1", {**figures, "written": []})
        return
    out.show(
        f"{path}: left as it was; decmcts {before.version} has planned it already "
        f"(`decmcts plan` searches on){'; so there is nothing to show' if views else ''}"
    )


def show_rewritten(
    made: Written, path: Path, views: list[Path], *, as_json: bool, verbose: bool = False
) -> None:
    """Print the result in a few plain lines, for slicers show or log what a script says.

    The last lines say where `views`, report and picture, are.
    """
    result, times = made.result, made.times
    kept = times is not None and times.kept
    if as_json:
        paths = [*([] if kept else [path]), *views]
        print_json("decmcts-result/1", figures(result, paths, times))
        return
    planned = result.planned
    err.show(*source_lines(planned.problem.job))
    before, after = planned.before.metrics, planned.after.metrics
    name = result.source.name
    if times is not None and kept:
        lines: list[str | None] = [f"{name}: left as it was; {after['kept_because']}"]
    else:
        lines = [
            f"{name}: rewritten for {planned.after.machine.name} and verified",
            *plain_lines(before, after, verbose=verbose),
            whole_file_line(times),
            layers_line(planned),
        ]
    lines += [searched_line(after) if verbose else None, *(f"wrote {view}" for view in views)]
    out.show(*lines)


FILE_OPTIONS = ("--machine", "--report", "--picture")
WHERE = (
    "PrusaSlicer, SuperSlicer: Print Settings > Output options > Post-processing scripts",
    "OrcaSlicer, Bambu Studio: process settings > Others > Post-processing Scripts",
    "(in the slicer's expert or advanced mode; one script a line)",
)


def script_line(program: Sequence[str], words: Sequence[str], *, windows: bool) -> str:
    r"""Return a program and its arguments as one line for a slicer.

    Examples
    --------
    >>> script_line(["/my tools/decmcts"], ["post"], windows=False)
    "'/my tools/decmcts' post"
    >>> print(script_line([r"C:\my tools\decmcts.exe"], ["post"], windows=True))
    "C:\my tools\decmcts.exe" post
    """
    line = [*program, *words]
    return subprocess.list2cmdline(line) if windows else shlex.join(line)


def own_program() -> list[str]:
    """Return how this program is started from anywhere: the script of its environment, or Python.

    A link in a folder on the path is not used: it may go, and its target stays.
    """
    name = "decmcts.exe" if os.name == "nt" else "decmcts"
    for script in (Path(sys.executable).parent / name, Path(sys.argv[0])):
        if script.name in (name, "decmcts") and script.is_file() and os.access(script, os.X_OK):
            return [str(script.absolute())]
    return [sys.executable, "-P", "-m", "decmcts.cli"]


def wherever_it_runs(words: Sequence[str]) -> list[str]:
    """Return arguments that mean the same in every folder: files that are there, in full."""
    made, before = list[str](), ""
    for word in words:
        name, equals, value = word.partition("=")
        if equals and name in FILE_OPTIONS:
            made.append(f"{name}={_whole(name, value)}")
        else:
            made.append(_whole(before, word) if before in FILE_OPTIONS else word)
        before = word
    return made


def _whole(option: str, value: str) -> str:
    """Return a file's name in full; of a machine only if it is a file."""
    path = Path(value)
    named = option != "--machine" and path.suffix.lower() in (".html", ".htm", ".png", ".svg")
    return str(path.absolute()) if named or path.is_file() else value
