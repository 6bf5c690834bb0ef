"""Bytes in and out: plain, gzipped or binary G-code, and what is refused at the door.

Nothing here looks at a command.
"""

from __future__ import annotations

import gzip
import io
import os
from pathlib import Path
from typing import BinaryIO, TextIO

from decmcts.errors import InputError
from decmcts.formats.files.atomic import write_whole
from decmcts.formats.files.bounds import unpacked
from decmcts.formats.files.reading import read_bytes
from decmcts.formats.gcode.text.binary import SUFFIX, is_binary, pack, unpack


def load_text(path: Path | str) -> bytes:
    """Return the text of a G-code file, unpacked; what it is shows its content, not its name.

    Raises
    ------
    InputError
        When the file cannot be read, is empty, damaged or no G-code at all.
    """
    raw = read_bytes(Path(path))
    raw = unpacked(raw, path)
    if is_binary(raw):
        raw = unpack(raw, path)
    if not raw.strip():
        raise InputError("the file is empty", path=path, advice="export the G-code again")
    if b"\0" in raw:
        line = raw.count(b"\n", 0, raw.index(b"\0")) + 1
        raise InputError(
            "binary data (a zero byte), not G-code text",
            path=path,
            line=line,
            advice="give the G-code as a slicer exports it",
        )
    return raw


def save_text(text: bytes, out: Path | str | BinaryIO | TextIO) -> None:
    """Write `text` to a path (atomically; .gz and .bgcode packed) or to a stream.

    Raises
    ------
    InputError
        When it cannot be packed or written; what was there before is untouched.
    """
    if isinstance(out, io.TextIOBase):
        out.write(text.decode("utf-8", "surrogateescape"))
    elif isinstance(out, (str, os.PathLike)):
        write_whole(out, packed_text(text, Path(out)))
    else:
        out.write(text)  # type: ignore[arg-type]  # a binary stream


def packed_text(text: bytes, out: Path, source: Path | None = None) -> bytes:
    """Return `text` as a file of this name holds it: plain, gzipped or binary.

    In the place of its source it is binary if the source is. What is made of a binary
    source keeps its metadata and thumbnails.

    Raises
    ------
    InputError
        When it cannot be packed.
    """
    old = read_bytes(source) if source is not None and source.exists() else b""
    like = old if is_binary(old) else None
    in_place = source is not None and source.exists() and out.exists() and out.samefile(source)
    if (like is not None) if in_place else out.suffix.lower() == SUFFIX:
        return pack(text, like=like, path=out)
    return gzip.compress(text, 6, mtime=0) if out.suffix.lower() == ".gz" else text
