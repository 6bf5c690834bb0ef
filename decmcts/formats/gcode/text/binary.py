"""Binary G-code (.bgcode), unpacked to text and packed again.

The one wrapper around `pybgcode`, the bindings of Prusa's libbgcode, an extra
(``decmcts[bgcode]``) because its licence is the AGPL. Blocks are walked and
checked here before the library sees them: sizes, checksums, and what compressed
data may grow to. Format: libbgcode's doc/specifications.md.
"""

from __future__ import annotations

import re
import struct
import tempfile
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from decmcts.errors import InputError
from decmcts.formats.files.bounds import LARGEST_BYTES

MAGIC = b"GCDE"
SUFFIX = ".bgcode"
VERSION = 1
_KINDS = ("file metadata", "G-code", "slicer metadata", "printer metadata", "print metadata",
          "thumbnail")  # fmt: skip
_GCODE, _PRINTER, _PRINT, _THUMBNAIL = 1, 3, 4, 5
_PLAIN, _DEFLATE = 0, 1
_HEATSHRINK = {  # compression: its tokens as bits, the group is the length of a copy less 1
    2: re.compile("1[01]{8}|0[01]{11}([01]{4})"),
    3: re.compile("1[01]{8}|0[01]{12}([01]{4})"),
}
_AS_TEXT = b"\0\0"
_ENCODINGS = (_AS_TEXT, b"\1\0", b"\2\0")  # of G-code: plain, MeatPack, with comments
_MEATPACK_GROWTH = 2  # two characters a byte
_CRC32 = 1
_COMMAND = re.compile(rb"^[^;\s]", re.M)
_SETTING = re.compile(rb"^;[^=\r\n]* = ", re.M)
_MARKED = re.compile(rb"^;(;[^=\r\n]* = )", re.M)
_TIMES = b"estimated"  # what the keys of times in metadata begin with


@dataclass(frozen=True, slots=True)
class BinaryBlock:
    """One block as it stands in a file."""

    kind: int
    compression: int
    size: int  # of the data unpacked, bytes
    parameters: bytes  # of its kind, before the data
    data: bytes  # as stored


def unpack(raw: bytes, path: Path | str | None = None) -> bytes:
    """Return the text of binary G-code: header, thumbnails and settings as comments.

    Raises InputError when it is damaged or too large, or the extra is not installed.
    """
    library = _library(path)
    read_blocks(raw, path)
    return _MARKED.sub(rb"\g<1>", _converted(library, raw, "from_binary_to_ascii", path))


def pack(text: bytes, *, like: bytes | None = None, path: Path | str | None = None) -> bytes:
    """Return G-code text as binary G-code.

    The text is in the form of PrusaSlicer, which names itself in the first line. Metadata and
    thumbnails of the binary G-code that it was made from (`like`) are kept as they stand, but for
    the print times, which come from the text.

    Raises InputError when the text is no slicer's, or the extra is not installed.
    """
    packed = _converted(_library(path), _marked(text), "from_ascii_to_binary", path)
    if like is not None:
        packed = _with_metadata(packed, like, path)
    if _commands(unpack(packed, path)) != _commands(text):
        raise InputError(
            "this G-code loses commands when it is packed as .bgcode",
            path=path,
            advice="name a .gcode file",
        )
    return packed


def _with_metadata(packed: bytes, like: bytes, path: Path | str | None) -> bytes:
    """Return the G-code of one file with all else of another, but for the print times."""
    new, old = read_blocks(packed, path), read_blocks(like, path)
    times = {k: v for b in new if b.kind in (_PRINTER, _PRINT) for k, v in _values(b).items()}
    kept = [_retimed(block, times) for block in old if block.kind != _GCODE]
    printed = [block for block in new if block.kind == _GCODE]
    return MAGIC + struct.pack("<IH", VERSION, _CRC32) + b"".join(map(_stored, kept + printed))


def _commands(text: bytes) -> list[bytes]:
    """Return the lines of a text without comments, empty ones left out."""
    bare = (line.partition(b";")[0].strip() for line in text.split(b"\n"))
    return [line for line in bare if line]


def _marked(text: bytes) -> bytes:
    """Return the text with a second `;` before settings among its commands.

    The library takes such comments out for its blocks of metadata, wherever they stand.
    """
    first = _COMMAND.search(text)
    if first is None:
        return text
    end = len(text)
    while end > 0:  # settings below the last command are meant to be taken
        begin = text.rfind(b"\n", 0, end) + 1
        if _COMMAND.match(text, begin, end):
            break
        end = begin - 1
    body = _SETTING.sub(rb";\g<0>", text[first.start() : end])
    return text[: first.start()] + body + text[end:]


def _library(path: Path | str | None) -> ModuleType:
    try:
        import pybgcode
    except ImportError as error:
        raise InputError(
            "binary G-code (.bgcode) needs the extra `bgcode`",
            path=path,
            advice="pip install 'decmcts[bgcode]', or export plain G-code (PrusaSlicer: Printer "
            "Settings > General > Supports binary G-code off)",
        ) from error
    return pybgcode  # type: ignore[no-any-return]  # the package is untyped


def _converted(library: Any, content: bytes, function: str, path: Path | str | None) -> bytes:
    """Run one of the library's conversions, which go from file to file."""
    with tempfile.TemporaryDirectory(prefix="decmcts-") as folder:
        begin, end = Path(folder) / "in", Path(folder) / "out"
        begin.write_bytes(content)
        source, target = library.open(str(begin), "rb"), library.open(str(end), "wb")
        try:
            result = getattr(library, function)(source, target)
        finally:
            library.close(target)
            library.close(source)
        if result == library.EResult.Success:
            return end.read_bytes()
    why = library.translate_result(result)
    if function == "from_binary_to_ascii":
        _damaged(path, why)
    raise InputError(
        f"this G-code cannot be packed as .bgcode ({why})",
        path=path,
        advice="only PrusaSlicer's can; name a .gcode file",
    )


def read_blocks(
    raw: bytes, path: Path | str | None = None, *, largest: int = LARGEST_BYTES
) -> list[BinaryBlock]:
    """Return the blocks of binary G-code, checked.

    Raises InputError for another version, a cut or changed file, or a text of more than `largest`
    bytes.
    """
    if len(raw) < 10:
        _damaged(path, "it ends within its header")
    version, checksum = struct.unpack_from("<IH", raw, 4)
    if version != VERSION or checksum > _CRC32:
        _damaged(path, f"version {version}, checksum {checksum}; known is version {VERSION}")
    blocks, at, grown = [], 10, 0
    while at < len(raw):
        block, end = _read_block(raw, at, bool(checksum), path)
        blocks.append(block)
        grown += block.size * (_MEATPACK_GROWTH if block.kind == _GCODE else 1)
        if grown > largest:
            _damaged(path, f"it would be over {largest >> 20} MiB unpacked")
        at = end
    if not any(block.kind == _GCODE for block in blocks):
        _damaged(path, "it holds no G-code")
    return blocks


def _read_block(
    raw: bytes, at: int, checked: bool, path: Path | str | None
) -> tuple[BinaryBlock, int]:
    """Return the block that begins at a byte, and where it ends."""
    here = f"at byte {at}"
    if at + 12 > len(raw):
        _damaged(path, f"it ends within a block header {here}")
    kind, compression, size, packed = struct.unpack_from("<HHII", raw, at)
    if kind >= len(_KINDS) or compression > max(_HEATSHRINK):
        _damaged(path, f"unknown block {kind} or compression {compression} {here}")
    head = at + (12 if compression else 8)
    begin = head + (6 if kind == _THUMBNAIL else 2)
    end = begin + (packed if compression else size)
    after = end + (4 if checked else 0)
    if after > len(raw):
        _damaged(path, f"it ends within a block of {_KINDS[kind]} {here}")
    if checked and struct.unpack_from("<I", raw, end)[0] != zlib.crc32(raw[at:end]):
        _damaged(path, f"the checksum of a block of {_KINDS[kind]} is wrong {here}")
    block = BinaryBlock(kind, compression, size, raw[head:begin], raw[begin:end])
    if not _grows_as_stated(block):
        _damaged(path, f"a block of {_KINDS[kind]} is not of the size it says {here}")
    if not _is_known(block):
        _damaged(path, f"a block of {_KINDS[kind]} is encoded in an unknown way {here}")
    return block, after


def _grows_as_stated(block: BinaryBlock) -> bool:
    """Tell whether compressed data is of its stated size, unpacking no more than that."""
    if block.compression == _DEFLATE:
        inflate = zlib.decompressobj()
        try:
            size = len(inflate.decompress(block.data, block.size + 1))
        except zlib.error:
            return False
        return inflate.eof and size == block.size  # not cut off behind its last byte
    return block.compression == _PLAIN or _heatshrink_size(block) == block.size


def _heatshrink_size(block: BinaryBlock) -> int:
    """Return how many bytes heatshrink data unpacks to: `1` and a byte, or `0` and a copy.

    The library trusts the size in the header and crashes where it is another.
    """
    bits = format(int.from_bytes(b"\1" + block.data), "b")
    at, size = 1, 0
    for token in _HEATSHRINK[block.compression].finditer(bits, 1):
        if token.start() != at:
            break
        at = token.end()
        size += 1 if token[1] is None else int(token[1], 2) + 1
    return size


def _is_known(block: BinaryBlock) -> bool:
    """Tell whether what a block holds is encoded as the library can read it.

    It never returns from metadata whose lines are no `name=value`, and reads on behind the end
    of plain G-code whose last line does not end.
    """
    if block.kind == _THUMBNAIL:
        return block.compression == _PLAIN and block.parameters[:2] < b"\3"
    if block.kind == _GCODE:
        if block.parameters != _AS_TEXT or block.compression in _HEATSHRINK:
            return block.parameters in _ENCODINGS
        return _plain(block).endswith(b"\n")
    if block.compression in _HEATSHRINK or block.parameters != b"\0\0":
        return False
    lines = _plain(block).split(b"\n")
    return lines[-1] == b"" and all(b"=" in line for line in lines[:-1])


def _damaged(path: Path | str | None, what: str) -> NoReturn:
    raise InputError(f"damaged binary G-code: {what}", path=path, advice="export it again")


def _values(block: BinaryBlock) -> dict[bytes, bytes]:
    """Return the settings in a block of metadata, `name=value` a line."""
    lines = [line.partition(b"=") for line in _plain(block).split(b"\n")]
    return {name: value for name, equals, value in lines if equals}


def _plain(block: BinaryBlock) -> bytes:
    return zlib.decompress(block.data) if block.compression == _DEFLATE else block.data


def _retimed(block: BinaryBlock, times: dict[bytes, bytes]) -> BinaryBlock:
    """Return a block of metadata with print times put in the place of its own."""
    if block.kind not in (_PRINTER, _PRINT) or block.compression in _HEATSHRINK:
        return block
    lines = [line.partition(b"=") for line in _plain(block).split(b"\n")]
    new = b"\n".join(
        name + equals + (times.get(name, value) if name.startswith(_TIMES) else value)
        for name, equals, value in lines
    )
    if new == _plain(block):
        return block
    data = zlib.compress(new) if block.compression == _DEFLATE else new
    return replace(block, size=len(new), data=data)


def _stored(block: BinaryBlock) -> bytes:
    sizes = struct.pack("<HHI", block.kind, block.compression, block.size)
    if block.compression:
        sizes += struct.pack("<I", len(block.data))
    content = sizes + block.parameters + block.data
    return content + struct.pack("<I", zlib.crc32(content))
