"""A print as it was read: from G-code, or from a mesh a slicer makes G-code of.

And where a slicer will put the file that it hands to a post-processing script: PrusaSlicer,
SuperSlicer, OrcaSlicer and Bambu Studio export to a temporary name, run the script on that file,
and rename it then. They say the final name in the environment.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from decmcts.arguments import checked
from decmcts.arrays import Floats
from decmcts.errors import InputError
from decmcts.formats.files.reading import require_file
from decmcts.formats.gcode import GcodeDocument, read_gcode
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.machines.own_machine import PAGE, machine_of_text
from decmcts.formats.mesh import is_mesh, refuse_other_shape
from decmcts.planning.compiling import compilation_reported
from decmcts.planning.events import Note, Report, Step, unheard
from decmcts.planning.options import Limits
from decmcts.planning.problem.slicing import SlicedFolder, Slicing, choose_slicer
from decmcts.print.brief import brief
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.metrics import Metrics


@dataclass(frozen=True, slots=True)
class Regrouped:
    """What a source was made of that has fewer changes of tools."""

    given: Source
    before: Metrics  # of the given source's own order
    fewer: int  # changes that it has less
    left_s: Floats  # (n,) that what is below a contour has to cool there at least


@dataclass(frozen=True, slots=True)
class Source:
    """A print that was read, and the machine it is for."""

    path: Path
    job: PrintJob
    document: GcodeDocument  # its text; of a mesh, the text that a slicer made of it
    machine: Machine
    own_limits: bool = True  # whether the motion limits it states replace the machine's
    sliced_by: str = ""  # what made the G-code of a mesh
    seconds: tuple[tuple[str, float], ...] = ()  # time of each step
    folder: SlicedFolder | None = None  # keeps the G-code of a mesh on disk
    plate: int | None = None  # of a .gcode.3mf; None: the only one with G-code
    original: Source | None = None  # what was given, where this is a safe order made of it
    regrouped: Regrouped | None = None  # what was given, where this has fewer changes of tools
    given: Source | None = None  # as it was read, where changes of tools or a tower are left out
    towerless: bool = False  # its wipe tower is left out

    __repr__ = brief("name", "machine.name", "job", "sliced_by")

    @property
    def name(self) -> str:
        """What people call it: the name that a slicer will give it, else its own."""
        return exported_file(self.path).name


@checked
def read(
    path: str | Path,
    machine: str | Machine | None = None,
    *,
    limits: Limits = Limits.SOURCE,
    mesh: Slicing | None = None,
    plate: int | None = None,
    report: Report = unheard,
) -> Source:
    """Read G-code, or slice a mesh and read what comes of it.

    Parameters
    ----------
    path : str | Path
        G-code (``.gcode``, ``.gcode.gz``, ``.bgcode``, ``.gcode.3mf``, ``.gx``) or a mesh
        (``.stl``, ``.3mf``, ``.obj``).
    machine : str | Machine | None
        The printer: a `Machine`, or what `load_machine` takes; None: the one the file names.
        A mesh names none.
    limits : Limits
        Whose motion limits count where file and machine both state some.
    mesh : Slicing | None
        How a mesh is sliced; None: as `Slicing()` states it.
    plate : int | None
        Of a ``.gcode.3mf``: whose G-code is read; None: the only one's that has any.
    report : Report
        Told what is done.

    Returns
    -------
    Source
        The print; what a slicer made of a mesh is kept as long as this is.

    Raises
    ------
    InputError
        When the file cannot be used, or no machine is known for it.

    Examples
    --------
    >>> from decmcts import read, sample_path
    >>> source = read(sample_path("four_nuts.gcode.gz"), "mk4s")
    >>> source.machine.name, len(source.job.contours)
    ('mk4s', 964)
    """
    with compilation_reported(report) as reporting:
        return _read(Path(path), machine, limits, mesh, plate, reporting)


def _read(
    path: Path, machine: str | Machine | None, limits: Limits, mesh: Slicing | None,
    plate: int | None, report: Report,
) -> Source:  # fmt: skip
    if not path.exists():
        raise InputError("no such file", path=path)
    require_file(path)
    refuse_other_shape(path)
    chosen, origin = machine_for(machine, path, plate)
    if origin:
        report(Note(origin))
    from_mesh = is_mesh(path)
    if from_mesh and plate is not None:
        raise InputError(
            f"no plate {plate}: this is a mesh", path=path, advice="leave the plate out"
        )
    seconds: list[tuple[str, float]] = []
    sliced, sliced_by, folder = None, "", None
    if from_mesh:
        started = time.perf_counter()
        how = mesh or Slicing()
        slicer = how.chosen or choose_slicer()
        sliced_by = str(slicer.program)
        report(Step(f"slicing {path.name} with {sliced_by}"))
        folder = SlicedFolder()
        sliced = how.slice_with(slicer, path, chosen, folder.path)
        seconds.append(("slice", time.perf_counter() - started))
    started = time.perf_counter()
    report(Step(f"reading {path.name}"))
    job, document = read_gcode(path, plate) if sliced is None else _read_sliced(sliced, path)
    seconds.append(("read", time.perf_counter() - started))
    own = limits == Limits.SOURCE
    return Source(path, job, document, chosen, own, sliced_by, tuple(seconds), folder, plate)


def _read_sliced(sliced: Path, mesh: Path) -> tuple[PrintJob, GcodeDocument]:
    """Read the G-code a slicer made of a mesh; what is wrong with it is said of the mesh."""
    try:
        job, document = read_gcode(sliced)
    except InputError as error:  # of a file nobody will find
        raise InputError(error.what, path=mesh, advice=error.advice) from error
    return replace(job, name=mesh.stem), document


def machine_for(
    named: str | Machine | None, source: Path, plate: int | None = None
) -> tuple[Machine, str]:
    """Return the machine that is named, else the source's own, and a line on where it is from.

    Raises InputError when none is named and the source names no known one either.
    """
    if isinstance(named, Machine):
        return named, ""
    if named is not None:
        return load_machine(named), ""
    if not source.exists():
        raise InputError("no such file", path=source)
    if is_mesh(source):
        raise InputError(
            "a mesh names no printer",
            path=source,
            advice=f"add --machine NAME (`decmcts machines` lists them; own ones: {PAGE})",
        )
    printer = os.environ.get("SLIC3R_PRINTER_MODEL", "")
    return machine_of_text(load_text(source, plate), source, printer=printer)


def first_head(source: Source, report: Report) -> Source:
    """Return the source for the first head alone, and tell so where there are more."""
    machine = source.machine
    if len(machine.heads) == 1:
        return source
    head = machine.heads[0]
    report(
        Note(
            f"{machine.name} has {len(machine.heads)} heads; planned for {head.name} alone, "
            "`decmcts launch` uses all"
        )
    )
    return replace(source, machine=machine.alone(head))


NAME, HOST = "SLIC3R_PP_OUTPUT_NAME", "SLIC3R_PP_HOST"
HEAD = 8192  # bytes in which a report or picture says who made it
A_FILE = ("", "File")  # hosts that are none: the file stays on this computer


def exported_file(path: Path, environment: Mapping[str, str] = os.environ) -> Path:
    """Return the name a file will have; its own where no slicer says another.

    Where the file will be sent to a printer, or the slicer names a folder that is not there,
    only the name is taken: the folder is that of the file that was handed over.
    """
    stated = environment.get(NAME, "")
    if not stated or "\0" in stated or stated.endswith(("/", os.sep)):
        return path
    final = Path(stated)
    if final.name in ("", "..", "."):
        return path
    stays = environment.get(HOST, "") in A_FILE and final.is_absolute() and final.parent.is_dir()
    return final if stays else path.with_name(final.name)


def is_foreign(path: Path) -> bool:
    """Tell whether a file is there that no report or picture of ours is; so are links and folders.

    Ours name this program near their begin.
    """
    if path.is_symlink() or (path.exists() and not path.is_file()):
        return True
    try:
        with path.open("rb") as file:
            return b"decmcts" not in file.read(HEAD)
    except FileNotFoundError:
        return False
    except OSError:
        return True


def beside(path: Path, ending: str) -> Path:
    """Return the name of what stands next to a file: `part.gcode` with another ending.

    Examples
    --------
    >>> beside(Path("my/part.gcode.gz"), ".report.html").name
    'part.report.html'
    """
    stem = path.name
    for suffix in (".gz", ".3mf", ".gcode", ".bgcode", ".gx", ".gco", ".g"):
        stem = stem[: -len(suffix)] if stem.lower().endswith(suffix) and stem != suffix else stem
    return path.with_name(stem + ending)
