"""A print made of arrays, without a file of one's own: they become G-code, and that is read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.arguments import checked
from decmcts.arrays import Floats, Int32s, Ints
from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.mesh import SliceOptions
from decmcts.formats.mesh.gcode_text import PlacedBead, gcode_lines
from decmcts.planning.events import Report, unheard
from decmcts.planning.problem.slicing import SlicedFolder
from decmcts.planning.problem.source import Source, read
from decmcts.print.contours import Role
from decmcts.print.machine import Machine

_FEED_MM_S = 60.0  # where none is stated


@checked
def from_arrays(
    points: Floats,
    offsets: Ints,
    layer: Int32s,
    machine: str | Machine,
    *,
    role: NDArray[np.int8] | None = None,
    extrusion: Floats | None = None,
    feed: Floats | float | None = None,
    width: Floats | float | None = None,
    height: Floats | float | None = None,
    options: SliceOptions | None = None,
    report: Report = unheard,
) -> Source:
    """Make a print of n contours, in the order in which they would be printed.

    Parameters
    ----------
    points : Floats
        (n_points, 3) places of the nozzle, mm; taken to 0.001 mm.
    offsets : Ints
        (n + 1,) contour i is ``points[offsets[i]:offsets[i + 1]]``, two points or more.
    layer : Int32s
        (n,) layer of each contour, from 0, never falling.
    machine : str | Machine
        The printer, as for `read`.
    role : NDArray[np.int8] | None
        (n,) what each is for, a `Role`; None: not known.
    extrusion : Floats | None
        (n_points,) filament of the segment that ends at each point, mm; at the first point of a
        contour it is not used. None: as width and height ask for.
    feed, width, height : Floats | float | None
        (n,) or one for all: mm/s while it is printed, and size of the bead, mm. None: 60 mm/s,
        bead width and layer height of the options.
    options : SliceOptions | None
        Temperatures, fan, retraction, travel and filament; None: for PLA, without a fan.
    report : Report
        Told what is done.

    Returns
    -------
    Source
        What `plan` and `launch` take. Its `path` is G-code in a temporary folder, for `verify`,
        kept as long as the source is. Contours that go on where the one before ends are one.

    Raises
    ------
    InputError
        With the name of an array whose shape or values are wrong, and when the print cannot be
        read.

    Examples
    --------
    >>> import numpy as np
    >>> from decmcts import from_arrays
    >>> walls = np.array([[20, 20, 0.2], [40, 20, 0.2], [80, 20, 0.2], [60, 20, 0.2]])
    >>> source = from_arrays(walls, np.array([0, 2, 4]), np.array([0, 0]), "mk4s")
    >>> len(source.job.contours)
    2
    """
    printer = load_machine(machine) if isinstance(machine, str) else machine
    chosen = (options or SliceOptions()).for_machine(printer)
    paths = _paths(np.asarray(points, np.float64), np.asarray(offsets))
    n = len(paths)
    layers = _values("layer", layer, n, 0)
    _require("layer", layers[0] >= 0 and (np.diff(layers) >= 0).all(), "must not fall, from 0")
    roles = _values("role", role, n, Role.UNKNOWN)
    _require("role", np.isin(roles, list(Role)).all(), "must be values of Role")
    feeds = _values("feed", feed, n, _FEED_MM_S)
    _require("feed", (feeds * 60.0 >= 1.0).all(), "must be at least 1/60: a mm a minute")
    widths = _values("width", width, n, chosen.bead_width, above=0.0)
    heights = _values("height", height, n, chosen.layer_height, above=0.0)
    per_mm = [chosen.filament_per_mm(h, w) for h, w in zip(heights, widths, strict=True)]
    filament = [_lengths(path) * each for path, each in zip(paths, per_mm, strict=True)]
    if extrusion is not None:
        stated = _values("extrusion", extrusion, len(points), 0)
        _require("extrusion", (stated >= 0.0).all(), "must be at least 0")
        filament = [each[1:] for each in np.split(stated, offsets[1:-1])]
    beads = map(
        PlacedBead, layers.astype(int), map(Role, roles), paths, filament, feeds, widths, heights
    )  # fmt: skip
    folder = SlicedFolder()
    file = folder.path / "arrays.gcode"
    file.write_text("\n".join(gcode_lines(beads, chosen)) + "\n", encoding="utf-8", newline="\n")
    return replace(read(file, printer, report=report), folder=folder)


def _paths(points: Floats, offsets: Ints) -> list[Floats]:
    _require("points", points.ndim == 2 and points.shape[-1] == 3, "must have shape (n_points, 3)")
    _require("points", np.isfinite(points).all(), "must be finite")
    shaped = offsets.ndim == 1 and len(offsets) >= 2 and offsets.dtype.kind in "iu"
    _require("offsets", shaped, "must be whole numbers of shape (n + 1,)")
    ends = offsets[0] == 0 and offsets[-1] == len(points) and (np.diff(offsets) >= 2).all()
    _require("offsets", ends, f"must rise from 0 to {len(points)} by at least 2 each")
    return np.split(points.round(3), offsets[1:-1])


def _lengths(path: Floats) -> Floats:
    return np.asarray(np.linalg.norm(np.diff(path, axis=0), axis=1))


def _values(
    name: str, given: object, n: int, usual: float, *, above: float | None = None
) -> Floats:
    """Return one number for each of n, finite; InputError names what is none."""
    found = np.asarray(usual if given is None else given, np.float64)
    _require(name, found.shape in ((), (n,)), f"has shape {found.shape}, must be ({n},)")
    _require(name, np.isfinite(found).all(), "must be finite")
    _require(name, above is None or (found > above).all(), "must be above 0")
    return np.broadcast_to(found, (n,))


def _require(name: str, fits: bool | np.bool_, must: str) -> None:
    if not fits:
        raise InputError(f"{name} {must}")
