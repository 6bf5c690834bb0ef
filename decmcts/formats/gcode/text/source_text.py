"""Bytes in and out: plain, gzipped or packed G-code, and what is refused at the door.

Packed G-code stands in a file with other things: binary G-code with metadata, the plates of a
.gcode.3mf, the header of a .gx. What is made of such a file can be put back in its place.
Nothing here looks at a command.

Line numbers and checksums are of the source's lines in the source's order: a firmware that reads
them from a file stops where the next number is not the next. So they are taken off once, at the
door, and everything behind it reads and writes plain lines. Each line stays a line, so messages
name those of the file.
"""

from __future__ import annotations

import codecs
import gzip
import io
import os
import re
from pathlib import Path
from typing import BinaryIO, TextIO

from decmcts.errors import InputError
from decmcts.formats.files import archive
from decmcts.formats.files.atomic import write_whole
from decmcts.formats.files.bounds import unpacked
from decmcts.formats.files.reading import read_bytes
from decmcts.formats.gcode.text import binary, flashprint, plates

_PACKED = {  # what such a file begins with, whatever it is called
    binary.SUFFIX: binary.MAGIC, plates.SUFFIX: archive.MAGIC, flashprint.SUFFIX: flashprint.MAGIC,
}  # fmt: skip
PACKED_SUFFIXES = tuple(_PACKED)
# Both begin with a plain byte, which `re` looks for faster than for the begin of a line.
_NUMBERED = re.compile(rb"\n[ \t]*[Nn][ \t]*\d+(?:\.\d*)?[ \t]*([^;\r\n]*)")
_LONE_RETURN = re.compile(rb"\r(?![\r\n]|\Z)")
_ODD_BLANKS = (b"\x0b", b"\x0c", b"\x1c", b"\x1d", b"\x1e", b"\x1f")  # `in` finds one fast
_ODD_BLANK_IN_CODE = re.compile(rb"^[^;\n\x0b\x0c\x1c-\x1f]*+[\x0b\x0c\x1c-\x1f]", re.M)


def load_text(path: Path | str, plate: int | None = None) -> bytes:
    """Return the text of a G-code file, unpacked; what it is shows its content, not its name.

    Of a .gcode.3mf it is that of a `plate`, of the only one that has any where none is named.

    Raises InputError when the file cannot be read, is empty, damaged or no G-code at all, or has
    no such plate.
    """
    return without_numbers(_text_in(path, plate))


def line_with_number(path: Path | str, plate: int | None = None) -> int | None:
    """Return the first line of a file that has a line number; None where none has."""
    return first_number(_text_in(path, plate))


def _text_in(path: Path | str, plate: int | None) -> bytes:
    """Return the text of a file, line for line as it stands there; raises as `load_text`."""
    raw = unpacked(read_bytes(Path(path)), path)
    kind = _suffix_of(raw)
    if plate is not None and kind != plates.SUFFIX:
        raise InputError(
            f"no plate {plate}: only a .gcode.3mf has plates", path=path, advice="leave it out"
        )
    if kind == binary.SUFFIX:
        raw = binary.unpack(raw, path)
    elif kind == plates.SUFFIX:
        raw = plates.unpack(raw, path, plate)
    elif kind == flashprint.SUFFIX:
        raw = flashprint.unpack(raw, path)
    raw = raw.removeprefix(codecs.BOM_UTF8)  # some editors write one, and it commands nothing
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
    refuse_lone_returns(raw, path)
    refuse_odd_blanks(raw, path)
    return raw


def has_plates(path: Path) -> bool:
    """Tell whether a file is a .gcode.3mf: by its name, or because a plate in it has G-code."""
    if path.name.lower().endswith(f".gcode{plates.SUFFIX}"):
        return True
    try:
        raw = read_bytes(path)
        return _suffix_of(raw) == plates.SUFFIX and bool(plates.plates_in(raw, path))
    except InputError:
        return False


def save_text(text: bytes, out: Path | str | BinaryIO | TextIO) -> None:
    """Write `text` to a path (atomically; .gz and .bgcode packed) or to a stream.

    Raises InputError when it cannot be packed or written; what was there before is untouched.
    """
    if isinstance(out, io.TextIOBase):
        out.write(text.decode("utf-8", "surrogateescape"))
    elif isinstance(out, (str, os.PathLike)):
        write_whole(out, packed_text(text, Path(out)))
    else:
        out.write(text)  # type: ignore[arg-type]  # a binary stream


def packed_text(
    text: bytes,
    out: Path,
    source: Path | None = None,
    plate: int | None = None,
    *,
    time_ratio: float = 1.0,
) -> bytes:
    """Return `text` as a file of this name holds it: plain, gzipped or packed.

    In the place of its source it is packed as the source is. What is made of a packed source
    keeps its metadata, thumbnails and other plates.

    Parameters
    ----------
    time_ratio : float
        The time it takes over the time its source takes: a .gx states its time in the header.

    Raises
    ------
    InputError
        When it cannot be packed.
    """
    old = read_bytes(source) if source is not None and source.exists() else b""
    in_place = source is not None and source.exists() and out.exists() and out.samefile(source)
    suffix = _suffix_of(old) if in_place else out.suffix.lower()
    if suffix == binary.SUFFIX:
        return binary.pack(text, like=old if _suffix_of(old) == suffix else None, path=out)
    if suffix in PACKED_SUFFIXES and _suffix_of(old) != suffix:
        raise InputError(
            f"a {suffix} with G-code is only made of another one, for all else that stands in it",
            path=out,
            advice="name a .gcode file",
        )
    if suffix == plates.SUFFIX:
        return plates.pack(text, old, source, plate)
    if suffix == flashprint.SUFFIX:
        return flashprint.pack(text, old, source, time_ratio=time_ratio)
    return gzip.compress(text, 6, mtime=0) if out.suffix.lower() == ".gz" else text


def _suffix_of(raw: bytes) -> str:
    """Return the suffix of packed G-code of this kind, and nothing for any other file."""
    return next((suffix for suffix, begin in _PACKED.items() if raw.startswith(begin)), "")


def without_numbers(text: bytes) -> bytes:
    """Return a text whose lines have no number (`N12`) and no checksum (`*71`)."""
    if not _NUMBERED.search(above := b"\n" + text):
        return text
    return _NUMBERED.sub(lambda line: b"\n" + _without_checksum(line[1]), above)[1:]


def first_number(text: bytes) -> int | None:
    """Return the first line (from 1) that has a number; None where none has."""
    found = _NUMBERED.search(above := b"\n" + text)
    return None if found is None else above.count(b"\n", 0, found.start() + 1)


def _without_checksum(code: bytes) -> bytes:
    """Return a command that had a number without the checksum at its end."""
    command, star, digits = code.rpartition(b"*")
    return command.rstrip() if star and digits.strip().isdigit() else code


def refuse_lone_returns(text: bytes, path: Path | str) -> None:
    """Refuse a carriage return within a line: some firmwares end the line there, others do not."""
    if (found := _LONE_RETURN.search(text)) is None:
        return
    if b"\n" not in text:
        raise InputError(
            "its lines end in a carriage return alone (CR, as on old Macs), where some firmwares "
            "end a line and others do not",
            path=path,
            advice="save it with line ends LF or CRLF (`tr '\\r' '\\n' < IN > OUT`)",
        )
    raise InputError(
        "a carriage return within a line: some firmwares end the line there, and then run what "
        "stands behind it",
        path=path,
        line=text.count(b"\n", 0, found.start()) + 1,
        advice="export the G-code again, or put a line end there",
    )


def refuse_odd_blanks(text: bytes, path: Path | str) -> None:
    """Refuse a vertical tab, form feed or separator (0x1c to 0x1f) in a command.

    Klipper strips them as blanks and carries out what stands behind; Marlin knows no such command.
    In comments they may stay.
    """
    odd = any(blank in text for blank in _ODD_BLANKS)
    if not odd or (found := _ODD_BLANK_IN_CODE.search(text)) is None:
        return
    raise InputError(
        f"a control character (0x{text[found.end() - 1]:02x}) in a command: some firmwares take it "
        "for a blank, others do not know the command",
        path=path,
        line=text.count(b"\n", 0, found.end()) + 1,
        advice="export the G-code again, or put a blank there",
    )
