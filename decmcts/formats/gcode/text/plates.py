"""G-code in a .gcode.3mf: what Bambu Studio and OrcaSlicer export and Bambu's printers take.

A zip archive with `Metadata/plate_N.gcode` for each sliced plate and, beside it, the MD5 sum
that the printer compares (`bbs_3mf.cpp` of Bambu Studio). One plate's G-code and its sum are
replaced; thumbnails, settings and all other plates keep their contents.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from decmcts.errors import InputError
from decmcts.formats.files.archive import Archive

SUFFIX = ".3mf"
_GCODE = re.compile(r"Metadata/plate_([1-9]\d{0,5})\.gcode")
_SUM = re.compile(rb"[0-9A-Fa-f]{32}")


def plates_in(raw: bytes, path: Path | str | None = None) -> list[int]:
    """Return the numbers of the plates that have G-code, ascending; none in a mere project.

    Raises InputError when the archive is damaged.
    """
    found = map(_GCODE.fullmatch, Archive(raw, path).names)
    return sorted(int(match[1]) for match in found if match)


def unpack(raw: bytes, path: Path | str | None = None, plate: int | None = None) -> bytes:
    """Return the G-code of a plate; of the only one that has any where none is named.

    Raises InputError when the archive is damaged or encrypted, the plate has no G-code, or several
    have and none is named.
    """
    archive = Archive(raw, path)
    name = _name(plates_in(raw, path), plate, path)
    text = archive.read(name)
    if f"{name}.md5" in archive.names:
        stated = _SUM.search(archive.read(f"{name}.md5"))
        if stated is None or stated[0].lower() != _sum(text).lower():
            raise InputError(
                f"damaged: {name} is not what {name}.md5 is the checksum of, so a printer refuses "
                "it",
                path=path,
                advice="export it again",
            )
    return text


def pack(
    text: bytes, like: bytes, path: Path | str | None = None, plate: int | None = None
) -> bytes:
    """Return the archive `like` with another G-code of a plate, and the checksum of that.

    Raises InputError as `unpack`.
    """
    archive = Archive(like, path)
    name = _name(plates_in(like, path), plate, path)
    contents = {name: text}
    if f"{name}.md5" in archive.names:
        old = archive.read(f"{name}.md5")
        upper = not re.search(rb"[a-f]", old)
        due = _sum(text)
        contents[f"{name}.md5"] = _SUM.sub(due.upper() if upper else due, old, count=1)
    return archive.replaced(contents)


def _name(plates: list[int], plate: int | None, path: Path | str | None) -> str:
    """Return the member that has the G-code of a plate."""
    if not plates:
        raise InputError(
            "no plate in this archive has G-code (Metadata/plate_N.gcode)",
            path=path,
            advice="slice it and export the sliced plate",
        )
    listed = " and ".join(filter(None, (", ".join(map(str, plates[:-1])), str(plates[-1]))))
    some = f"plate{'s' * (len(plates) > 1)} {listed}"
    if plate is None and len(plates) > 1:
        raise InputError(
            f"this file has the G-code of {some}", path=path, advice="add --plate N for one of them"
        )
    chosen = plates[0] if plate is None else plate
    if chosen not in plates:
        raise InputError(
            f"plate {chosen} has no G-code in this file, {some} ha{'ve' if plates[1:] else 's'}",
            path=path,
            advice="add --plate N for one that has",
        )
    return f"Metadata/plate_{chosen}.gcode"


def _sum(text: bytes) -> bytes:
    return hashlib.md5(text, usedforsecurity=False).hexdigest().encode()
