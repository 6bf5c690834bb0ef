"""Read a print."""

from __future__ import annotations

from pathlib import Path

from decmcts.arguments import checked
from decmcts.planning.compiling.child import compilation_reported
from decmcts.planning.events import Report, unheard
from decmcts.planning.options import Limits
from decmcts.planning.problem.slicing import Slicing
from decmcts.planning.problem.source import Source, read_source
from decmcts.print.machine import Machine


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
        return read_source(
            Path(path), machine, limits=limits, mesh=mesh, report=reporting, plate=plate
        )
