"""The built-in slicer: STL, 3MF and OBJ without any other program.

It makes honest plain prints (walls, rectilinear infill, solid top and bottom)
so that planning works with no slicer installed; it is no rival to one: no
supports, bridges, gap fill, thin walls or brims. `slicers` has the commands of
real ones. Meshes become G-code text, and the G-code reader makes the print job
of that: one way in for every print.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from decmcts.errors import InputError
from decmcts.formats.files.atomic import draft_folder
from decmcts.formats.gcode import GcodeDocument, read_gcode
from decmcts.formats.mesh.options import (
    MESH_SUFFIXES,
    SliceOptions,
    is_mesh,
    refuse_other_shape,
)
from decmcts.print.job import PrintJob
from decmcts.version import __version__

__all__ = [
    "MESH_SUFFIXES", "SliceOptions", "is_mesh", "read_sliced", "refuse_other_shape", "slice_mesh",
    "slice_to_gcode",
]  # fmt: skip


def slice_mesh(
    path: Path | str, options: SliceOptions | None = None
) -> tuple[PrintJob, GcodeDocument]:
    """Slice a mesh file and return what reading its G-code gives.

    Raises
    ------
    InputError
        For files that are no closed mesh or too small for the nozzle.
    """
    source = Path(path)
    text = slice_to_gcode(source, options)
    with draft_folder() as folder:
        sliced = folder / f"{source.stem}.gcode"
        sliced.write_text(text, encoding="utf-8", newline="\n")
        job, document = read_sliced(sliced, source)
    return job, replace(document, path=str(source), text=text.encode())


def read_sliced(sliced: Path, mesh: Path) -> tuple[PrintJob, GcodeDocument]:
    """Read the G-code a slicer made of a mesh; what is wrong with it is said of the mesh."""
    try:
        job, document = read_gcode(sliced)
    except InputError as error:  # of a file nobody will find
        raise InputError(error.what, path=mesh, advice=error.advice) from error
    ours = f"decmcts {__version__}, built-in slicer"
    return replace(job, name=mesh.stem, slicer=job.slicer or ours), document


def slice_to_gcode(path: Path | str, options: SliceOptions | None = None) -> str:
    """Return the G-code of a mesh file as text; raises InputError like `slice_mesh`."""
    # here, so that only who slices waits for trimesh to load
    from decmcts.formats.mesh.gcode_text import gcode_lines, sliced
    from decmcts.formats.mesh.load import load_solid
    from decmcts.formats.mesh.sections import cut_layers

    chosen = options or SliceOptions()
    source = Path(path)
    solid = load_solid(source, chosen.center)
    if chosen.largest is not None and (solid.extents > chosen.largest).any():
        size, most = (
            " x ".join(f"{x:.4g}" for x in xyz) for xyz in (solid.extents, chosen.largest)
        )
        raise InputError(
            f"the mesh is {size} mm, larger than what can be printed, {most} mm",
            path=source,
            advice="check its units, or choose a larger machine",
        )
    layers = cut_layers(solid, chosen.first_layer_height, chosen.layer_height)
    lines = list(gcode_lines(sliced(layers, chosen), chosen))
    if not any(line.startswith(";TYPE:") and line != ";TYPE:Custom" for line in lines):
        raise InputError(
            f"nothing of the mesh is as wide as a bead of {chosen.bead_width:g} mm "
            f"and half a layer of {chosen.first_layer_height:g} mm high",
            path=source,
            advice="check its units, or take a finer nozzle",
        )
    return "\n".join(lines) + "\n"
