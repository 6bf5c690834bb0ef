"""Is a mesh file whole, and of the kind its name says? Asked before trimesh guesses.

A file that broke off while it was copied must be called that; trimesh takes it for
another format and names what it misses there.
"""

from __future__ import annotations

import io
import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import trimesh

from decmcts.errors import InputError
from decmcts.formats.files.bounds import refuse_larger

_HEADER, _TRIANGLE = 84, 50  # bytes of a binary STL
_AGAIN = "copy the file again, or export the model again"
_VERTEX = re.compile(rb"vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.I)


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
        points = np.array(corners, dtype="S32").astype(np.float64).reshape(-1, 3)
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
