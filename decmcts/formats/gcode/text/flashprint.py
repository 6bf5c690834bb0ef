"""G-code of FlashForge's FlashPrint (.gx): a header with a thumbnail, then plain text.

Little-endian. Bytes 0-11 `xgcode 1.0`, a line end and a zero; at 16, 20 and 24 the bytes at which
the bitmap, perhaps a second picture, and the G-code begin; at 28 the print time in seconds, at 32
and 36 the filament of both extruders in mm; then speeds and temperatures, and from 58 on the
picture. Layout as public writers of the format give it (a Cura plugin for the Finder, scripts
for the Creator Pro 2).
"""

from __future__ import annotations

import struct
from pathlib import Path

from decmcts.errors import InputError

MAGIC = b"xgcode 1.0\n"
SUFFIX = ".gx"
_GCODE_AT, _TIME_AT, _HEADER = 24, 28, 58  # bytes


def unpack(raw: bytes, path: Path | str | None = None) -> bytes:
    """Return the G-code behind the header.

    Raises InputError when the header is damaged.
    """
    return raw[_gcode_begin(raw, path) :]


def pack(
    text: bytes, like: bytes, path: Path | str | None = None, *, time_ratio: float = 1.0
) -> bytes:
    """Return other G-code behind the header of `like`, whose print time is multiplied.

    Raises InputError when the header is damaged.
    """
    header = bytearray(like[: _gcode_begin(like, path)])
    (seconds,) = struct.unpack_from("<I", header, _TIME_AT)
    struct.pack_into("<I", header, _TIME_AT, min(round(seconds * time_ratio), 2**32 - 1))
    return bytes(header) + text


def _gcode_begin(raw: bytes, path: Path | str | None) -> int:
    begin = struct.unpack_from("<I", raw, _GCODE_AT)[0] if len(raw) >= _HEADER else 0
    if not _HEADER <= begin < len(raw):
        raise InputError(
            "damaged .gx file: its header does not say where the G-code begins",
            path=path,
            advice="export it again",
        )
    return int(begin)
