"""Mesh files to one closed solid on a bed, for a slicer that cannot place it there.

Repair is trimesh's own (merge vertices, fill small holes, turn faces); what stays open is
refused, because a solid with holes has no inside to fill.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import trimesh

from decmcts.errors import InputError
from decmcts.formats.files.bounds import refuse_larger
from decmcts.formats.files.reading import read_bytes
from decmcts.formats.mesh.options import Bed


def load_solid(path: Path, bed: Bed) -> trimesh.Trimesh:
    """Return the mesh of a file in mm, standing in the middle of a bed.

    Several objects keep their places relative to each other.

    Raises InputError for a file that holds no mesh, coordinates that are no numbers, and a mesh
    that is flat, larger than the bed or not closed.
    """
    mesh = _read(path)
    if not np.isfinite(mesh.vertices).all():
        raise InputError(
            "a coordinate is no finite number", path=path, advice="export the model again"
        )
    if mesh.extents.min() == 0.0:
        raise InputError("the mesh is flat", path=path)
    most = np.subtract(bed.high, bed.low)
    if (mesh.extents[:2] > most).any():
        size, space = (" x ".join(f"{x:.4g}" for x in xyz) for xyz in (mesh.extents, most))
        raise InputError(
            f"the mesh is {size} mm, larger than the bed, {space} mm",
            path=path,
            advice="check its units, or choose a larger machine",
        )
    _repair(mesh)
    _check_closed(mesh, path)
    low, high = mesh.bounds
    middle = np.array([*bed.center, 0.0])
    mesh.apply_translation(middle - [*(low + high)[:2] / 2.0, low[2]])
    return mesh


def _read(path: Path) -> trimesh.Trimesh:
    """Return all triangles of a file, placed, in mm."""
    content = read_bytes(path)
    if b"\0" not in content:  # words: names may be in any encoding
        content = content.decode("utf-8", "replace").encode()
    kind = path.suffix.lower()[1:]
    try:
        if kind == "3mf":
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                refuse_larger(sum(entry.file_size for entry in archive.infolist()), path)
        # process: it would drop what is not finite
        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False)
        return _joined(scene)
    except InputError:
        raise
    except Exception as error:  # trimesh's readers raise whatever their parsers raise
        raise InputError(
            "is no mesh that can be read, is cut off, or holds no triangles",
            path=path,
            advice="copy the file again, or export the model again",
        ) from error


def _joined(scene: trimesh.Scene) -> trimesh.Trimesh:
    """Return all objects of a scene, placed, in mm, as one mesh.

    ValueError where there is none, or a triangle names a point that is not there.
    """
    placed = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    placed = [part for part in placed if len(part.faces)]
    if not placed or any(part.faces.max() >= len(part.vertices) for part in placed):
        raise ValueError
    mesh = trimesh.util.concatenate(placed)
    assert isinstance(mesh, trimesh.Trimesh)
    units = scene.units or next((part.units for part in placed if part.units), None)
    if units not in (None, "mm", "millimeter", "millimeters"):
        mesh.vertices = mesh.vertices * trimesh.units.unit_conversion(units, "millimeters")
    return mesh


def _repair(mesh: trimesh.Trimesh) -> None:
    """Mutate: merge vertices, drop collapsed faces, fill small holes, turn faces outwards."""
    mesh.merge_vertices()
    corners = mesh.faces
    collapsed = (corners == np.roll(corners, 1, axis=1)).any(axis=1)  # slivers hold seams closed
    mesh.update_faces(~collapsed)
    mesh.remove_unreferenced_vertices()
    if not mesh.is_watertight:
        trimesh.repair.fill_holes(mesh)
    with np.errstate(invalid="ignore", divide="ignore"):  # of no volume: trimesh divides by it
        inside_out = mesh.volume < 0.0
    if inside_out or not mesh.is_winding_consistent:
        trimesh.repair.fix_normals(mesh, multibody=True)  # type: ignore[no-untyped-call]  # trimesh's


def _check_closed(mesh: trimesh.Trimesh, path: Path) -> None:
    _, counts = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    holes = int((counts % 2).sum())
    if holes:
        raise InputError(
            f"the mesh is not closed: {holes} open edges",
            path=path,
            advice="repair it in a mesh editor or slicer first",
        )
