"""Mesh files to one closed solid standing on the bed.

Repair is trimesh's own (merge vertices, fill small holes, turn faces); what
stays open is refused, because a solid with holes has no inside to fill. Whether a file is whole
and of the kind its name says is asked before trimesh guesses: one that broke off while it was
copied must be called that, and trimesh takes it for another format and names what it misses there.
"""

from __future__ import annotations

import io
import re
import struct
import zipfile
from itertools import chain
from pathlib import Path

import numpy as np
import trimesh

from decmcts.errors import InputError
from decmcts.formats.files.bounds import refuse_larger
from decmcts.formats.files.reading import read_bytes

_LARGEST_MM = 1e5
_NOTHING = "holds no triangles"
_EXPORT = "export the model again"
_HEADER, _TRIANGLE = 84, 50  # bytes of a binary STL
_AGAIN = "copy the file again, or export the model again"
_VERTEX = re.compile(rb"vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.I)


def load_solid(path: Path, center: tuple[float, float] | None) -> trimesh.Trimesh:
    """Return the mesh of a file in mm, its lowest point at z 0, `center` in its middle.

    Several objects keep their places relative to each other.

    Raises
    ------
    InputError
        For an unreadable or empty file, non-finite or absurd coordinates, and
        a mesh with holes.
    """
    mesh = _read(path)
    if not len(mesh.faces):
        raise InputError(_NOTHING, path=path, advice=_EXPORT)
    if not np.isfinite(mesh.vertices).all():
        raise InputError("a coordinate is no finite number", path=path, advice=_EXPORT)
    if np.abs(mesh.bounds).max() > _LARGEST_MM:
        raise InputError(f"coordinates beyond {_LARGEST_MM:g} mm", path=path, advice="check units")
    if not mesh.extents.min() > 0.0:
        raise InputError("the mesh is flat", path=path)
    _repair(mesh)
    _check_closed(mesh, path)
    low, high = mesh.bounds
    shift = np.array([0.0, 0.0, -low[2]])
    if center is not None:
        shift[:2] = np.array(center) - (low + high)[:2] / 2.0
    mesh.apply_translation(shift)
    return mesh


def _read(path: Path) -> trimesh.Trimesh:
    """Return all triangles of a file, placed, in mm."""
    content = read_bytes(path)
    try:
        content = whole(content, path)
        if path.suffix.lower() == ".stl" and is_text_stl(content):
            return read_text_stl(content, path)
        kind = path.suffix.lower()[1:]
        # process: it would drop what is not finite
        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False)
        _check_corners(scene, path)
        return _joined(scene, path)
    except InputError:
        raise
    except KeyError as error:  # a 3MF file without items has no root in trimesh's scene
        raise InputError(_NOTHING, path=path, advice=_EXPORT) from error
    except Exception as error:  # trimesh's readers raise whatever their parsers raise
        raise InputError(f"is no readable mesh ({_first_line(error)})", path=path) from error


def _first_line(error: Exception) -> str:
    """Return what a parser found in one line, in words where it has none of its own."""
    lines = str(error).splitlines()
    if isinstance(error, IndexError):
        return "an index names a point that is not there"
    if isinstance(error, ValueError) and not isinstance(error, SyntaxError):
        return "a line is cut off, or something in it is no number"
    return lines[0][:120] if lines else type(error).__name__


def _check_corners(scene: trimesh.Scene, path: Path) -> None:
    """Raise InputError for triangles between points that are not there."""
    for part in scene.geometry.values():
        faces = getattr(part, "faces", None)
        if faces is None or not len(faces):
            continue
        if faces.min() < 0 or faces.max() >= len(part.vertices):
            raise InputError(
                f"a triangle names point {faces.max() + 1} of {len(part.vertices)}",
                path=path,
                advice=_EXPORT,
            )


def _joined(scene: trimesh.Scene, path: Path) -> trimesh.Trimesh:
    """Return all objects of a scene, placed, in mm, as one mesh."""
    placed = [
        part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)
    ]
    if not placed:
        raise InputError(_NOTHING, path=path, advice=_EXPORT)
    mesh = placed[0] if len(placed) == 1 else trimesh.util.concatenate(placed)
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


def whole(content: bytes, path: Path) -> bytes:
    """Return the bytes of a mesh file as trimesh reads them.

    Raises
    ------
    InputError
        For an empty file, one that is cut off, and one that is of another kind.
    """
    kind = path.suffix.lower()
    if not content.strip():
        raise InputError("is empty", path=path, advice=_AGAIN)
    if kind == ".stl":
        return content if is_text_stl(content) else _whole_binary(content, path)
    if kind == ".3mf":
        _require_model(content, path)
        return content
    return _text(content, path)


def is_text_stl(content: bytes) -> bool:
    """Tell whether an STL is written in words; a binary one may begin with `solid` too."""
    if len(content) >= _HEADER and len(content) == _bytes_named(content):
        return False
    head = content[:4096].lower()
    return head.lstrip().startswith(b"solid") and (b"facet" in head or b"endsolid" in head)


def read_text_stl(content: bytes, path: Path) -> trimesh.Trimesh:
    """Return the triangles of an STL in words, of all its solids.

    Raises
    ------
    InputError
        With the line, where it is cut off or something is no number.
    """
    words = content.lower()
    last = words.rstrip().rsplit(b"\n", 1)[-1].lstrip()
    if not last.startswith(b"endsolid"):
        line = content.rstrip().count(b"\n") + 1
        raise InputError("is cut off: no `endsolid`", path=path, line=line, advice=_AGAIN)
    corners = _VERTEX.findall(content)
    facets = len(re.findall(rb"^[ \t]*+facet\b", words, re.M))
    if len(corners) != 3 * facets:
        raise InputError(
            f"{len(corners)} corners of {facets} triangles; three each are due", path=path,
            advice=_AGAIN,
        )  # fmt: skip
    try:
        points = np.array(list(map(float, chain.from_iterable(corners)))).reshape(-1, 3)
    except ValueError:
        raise InputError(
            "a coordinate is no number", path=path, line=_line_of_bad(content), advice=_AGAIN
        ) from None
    return trimesh.Trimesh(points, np.arange(len(points)).reshape(-1, 3), process=False)


def _line_of_bad(content: bytes) -> int | None:
    """Return the line of the first corner that is not three numbers."""
    for found in _VERTEX.finditer(content):
        try:
            [float(word) for word in found.groups()]
        except ValueError:
            return content.count(b"\n", 0, found.start()) + 1
    return None


def _bytes_named(content: bytes) -> int:
    """Return the size a binary STL has by the number of triangles it names."""
    return _HEADER + _TRIANGLE * int(struct.unpack_from("<I", content, _HEADER - 4)[0])


def _whole_binary(content: bytes, path: Path) -> bytes:
    """Return a binary STL without what stands behind its last triangle."""
    if len(content) < _HEADER:
        raise InputError(
            f"is cut off or no STL: {len(content)} bytes, the header alone takes {_HEADER}",
            path=path,
            advice=_AGAIN,
        )
    named = _bytes_named(content)
    if len(content) < named:
        count = (named - _HEADER) // _TRIANGLE
        raise InputError(
            f"truncated STL, or none: {len(content)} bytes, {named} expected for the {count} "
            "triangles it names",
            path=path,
            advice=_AGAIN,
        )
    return content[:named]


def _require_model(content: bytes, path: Path) -> None:
    """Raise InputError unless a 3MF is a zip archive with a model in it."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = archive.infolist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, struct.error) as error:
        raise InputError(
            "is no 3MF, which is a zip archive, or is cut off", path=path, advice=_AGAIN
        ) from error
    if not any(entry.filename.lower().endswith(".model") for entry in entries):
        raise InputError("is a zip archive without a 3MF model", path=path, advice=_AGAIN)
    unpacked = sum(entry.file_size for entry in entries)
    refuse_larger(unpacked, path)


def _text(content: bytes, path: Path) -> bytes:
    """Return the text of an OBJ in UTF-8, whatever its comments are written in."""
    if b"\0" in content:
        line = content.count(b"\n", 0, content.index(b"\0")) + 1
        raise InputError("binary data, no OBJ", path=path, line=line, advice=_AGAIN)
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1").encode("utf-8")
    return content
