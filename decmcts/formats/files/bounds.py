"""How large a file and its numbers may be: stated once, for G-code, machines and plans.

A limit here is far beyond any printer and near enough that whatever stays within
it costs memory and time like an honest file of its size.
"""

from __future__ import annotations

import io
import zlib
from pathlib import Path

from decmcts.errors import InputError

LARGEST_MM = 10_000.0  # of a coordinate or a size: ten metres
LARGEST_BEAD_MM = 100.0  # of a bead's width or height
LARGEST_FILAMENT_MM = 1e6  # of one move: a kilometre, over three spools
LARGEST_SPEED_MM_S = 1e5
LARGEST_ACCELERATION_MM_S2 = 1e7
LARGEST_SECONDS = 1e7  # of one print: 115 days
LAST_TOOL = 2**15 - 1  # that a contour can have
MOST_LAYERS = 2**31 - 1  # of which contours can be, or by which a part may run ahead of the rest
UNPACKED_FREE = 64 * 2**20  # bytes that any gzipped file may hold
UNPACKED_TIMES = 100  # a larger one may hold this many times its own size
MEMORY_MOST = 4 * 2**30  # bytes that any command may need
MEMORY_TIMES = 25  # what planning needs, over the size of its file
LARGEST_BYTES = MEMORY_MOST // MEMORY_TIMES  # of a file, unpacked
_GZIP_MAGIC = b"\x1f\x8b"
_BLOCK, _FED = 2**20, 2**12  # bytes unpacked and given at a time


def refuse_larger(size: int, path: Path | str | None) -> None:
    """Raise InputError for a file of more than `LARGEST_BYTES`, unpacked.

    The one place where what would need too much memory is refused before it is taken.
    """
    if size > LARGEST_BYTES:
        raise InputError(
            f"holds over {LARGEST_BYTES / 2**20:.0f} MiB, and it takes about {MEMORY_TIMES} times "
            f"as much memory to plan: {MEMORY_MOST / 2**30:.0f} GiB is the limit",
            path=path,
            advice="split the print",
        )


def unpacked(raw: bytes, path: Path | str, *, free: int = UNPACKED_FREE) -> bytes:
    """Return what a gzipped file holds, and any other file as it is.

    Any may hold `free` bytes, a larger one in proportion to its size.

    Raises InputError when the data is damaged or unpacks to more than any honest file holds.
    """
    if not raw.startswith(_GZIP_MAGIC):
        return raw
    most = max(free, UNPACKED_TIMES * len(raw))
    try:
        return _inflated(raw, most, path)
    except zlib.error as error:
        raise InputError(f"damaged gzip data ({error})", path=path) from error


def _inflated(raw: bytes, most: int, path: Path | str) -> bytes:
    """Unpack all members of a gzip file, `most` bytes at the most."""
    whole, at = io.BytesIO(), 0
    while raw.startswith(_GZIP_MAGIC, at):
        member = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
        while not member.eof:
            fed = raw[at : at + _FED]  # what is left of it is copied: little, also of many members
            block = member.decompress(fed, _BLOCK)
            at += len(fed) - len(member.unused_data if member.eof else member.unconsumed_tail)
            if whole.tell() + len(block) > most:
                raise InputError(
                    f"{len(raw):,} bytes unpack to more than {most:,}, so this is no print",
                    path=path,
                    advice="unpack it and look",
                )
            refuse_larger(whole.tell() + len(block), path)
            whole.write(block)
            if not block and not fed and not member.eof:
                raise InputError("damaged gzip data (it ends too early)", path=path)
    return whole.getvalue()
