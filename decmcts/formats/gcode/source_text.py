"""Bytes in and out: plain or gzipped G-code, and what is refused at the door.

Nothing here looks at a command.
"""

from __future__ import annotations

import gzip
import io
import os
from pathlib import Path
from typing import BinaryIO, TextIO

from decmcts.errors import InputError
from decmcts.formats.atomic import write_whole
from decmcts.formats.bounds import unpacked


def load_text(path: Path | str) -> bytes:
    """Return the bytes of a G-code file, unpacked.

    Raises
    ------
    InputError
        When the file cannot be read, is empty, binary G-code or no text at all.
    """
    raw = _read(Path(path))
    if raw[:4] == b"GCDE":
        raise InputError(
            "this is binary G-code (.bgcode), which is not read",
            path=path,
            advice="export plain G-code (PrusaSlicer: Printer Settings > General > Supports "
            "binary G-code off), or convert it with Prusa's bgcode tool",
        )
    raw = unpacked(raw, path)
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


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", path=path) from error


def save_text(text: bytes, out: Path | str | BinaryIO | TextIO) -> None:
    """Write `text` to a path (atomically; gzipped if it ends in .gz) or to a stream.

    Raises
    ------
    InputError
        When the path is .bgcode or cannot be written; what was there before is untouched.
    """
    if isinstance(out, io.TextIOBase):
        out.write(text.decode("utf-8", "surrogateescape"))
    elif isinstance(out, (str, os.PathLike)):
        if Path(out).suffix == ".bgcode":
            raise InputError(
                "binary G-code (.bgcode) is not written", path=out, advice="name a .gcode file"
            )
        packed = gzip.compress(text, 6, mtime=0) if Path(out).suffix == ".gz" else text
        write_whole(out, packed)
    else:
        out.write(text)  # type: ignore[arg-type]  # a binary stream
