"""Zip archives whose members are read, or replaced while all others stay byte for byte.

Python's `zipfile` would pack every member anew. Here the records of the others are copied as
they stand, packed data and times included; only what points at them changes. Nothing is ever
unpacked to disk. Format: APPNOTE.TXT of PKWARE, sections 4.3 to 4.5.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NoReturn

from decmcts.errors import InputError
from decmcts.formats.files.bounds import UNPACKED_FREE, UNPACKED_TIMES, refuse_larger
from decmcts.formats.files.reading import first_twice

MAGIC = b"PK\x03\x04"
_CENTRAL, _END, _END64, _LOCATOR = b"PK\x01\x02", b"PK\x05\x06", b"PK\x06\x06", b"PK\x06\x07"
_LOCAL_FIELDS = struct.Struct("<4s5H3I2H")
_CENTRAL_FIELDS = struct.Struct("<4s6H3I5H2I")
_END_FIELDS = struct.Struct("<4s4H2IH")
_END64_FIELDS = struct.Struct("<4sQ2H2I4Q")
_STORED, _DEFLATED = 0, 8
_ENCRYPTED, _DESCRIPTOR = 0x2041, 0x0008  # bits of the flags
_SIZES64 = 0x0001  # kind of an extra field
_FULL16, _FULL32 = 0xFFFF, 0xFFFFFFFF  # "look in the extra field"


@dataclass(frozen=True, slots=True)
class Member:
    """One member, as the directory at the end of the archive states it."""

    name: str
    flags: int
    method: int
    crc: int
    packed: int  # bytes in the archive
    size: int  # bytes unpacked
    offset: int  # of its record
    listing: bytes  # its entry in the directory


class Archive:
    """A zip archive in memory.

    Parameters
    ----------
    raw : bytes
        The whole file.
    path : Path | str | None
        For messages.

    Raises
    ------
    InputError
        When it is damaged, or two members share a name or a byte.
    """

    def __init__(self, raw: bytes, path: Path | str | None = None) -> None:
        self._raw, self._path = raw, path
        begin, end, count, self._comment = self._directory()
        self._begin = begin
        self._listed = list(self._entries(begin, end, count))
        self.members: Mapping[str, Member] = {member.name: member for member in self._listed}
        if len(self.members) < len(self._listed):
            twice = first_twice(member.name for member in self._listed)
            self._damaged(f"two members are named {twice!r}")
        self._records = sorted(self._listed, key=lambda member: member.offset)
        self._ends = self._record_ends()

    def read(self, name: str) -> bytes:
        """Return what a member holds, unpacking no more than an honest one would.

        Raises
        ------
        InputError
            When there is none, or it is encrypted, damaged, or packed in an unusual way.
        """
        member = self.members.get(name)
        if member is None:
            self._damaged(f"it has no member {name!r}")
        if member.flags & _ENCRYPTED:
            raise InputError(f"{name} is encrypted", path=self._path, advice="export it again")
        most = max(UNPACKED_FREE, UNPACKED_TIMES * member.packed)
        if member.size > most:
            raise InputError(
                f"{name}: {member.packed:,} bytes unpack to {member.size:,}, so this is no print",
                path=self._path,
                advice="unpack it and look",
            )
        refuse_larger(member.size, self._path)
        begin = self._data_begin(member)
        data = self._raw[begin : begin + member.packed]
        content = self._inflated(member, data)
        if len(content) != member.size or zlib.crc32(content) != member.crc:
            self._damaged(f"the checksum of {name} is wrong")
        return content

    def replaced(self, contents: Mapping[str, bytes]) -> bytes:
        """Return the archive with other contents in the place of these members'.

        They keep their place, name, time and kind of packing.
        """
        head = self._raw[: self._records[0].offset]
        parts, listings, at = [head], dict[str, bytes](), len(head)
        for member, end in zip(self._records, self._ends, strict=True):
            record, listing = self._raw[member.offset : end], member.listing
            if (content := contents.get(member.name)) is not None:
                record, listing = self._made(member, content)
            listings[member.name] = _moved(listing, at)
            parts.append(record)
            at += len(record)
        directory = b"".join(listings[member.name] for member in self._listed)
        n = len(self._listed)
        if at + len(directory) >= _FULL32 or n >= _FULL16:
            raise InputError("over 4 GiB or 65,534 members", path=self._path)
        end_fields = (_END, 0, 0, n, n, len(directory), at, len(self._comment))
        return b"".join([*parts, directory, _END_FIELDS.pack(*end_fields), self._comment])

    def _directory(self) -> tuple[int, int, int, bytes]:
        """Return begin, end and length of the directory, and the archive's comment."""
        raw = self._raw
        at = raw.rfind(_END, max(0, len(raw) - _END_FIELDS.size - _FULL16))
        if at < 0 or at + _END_FIELDS.size > len(raw):
            self._damaged("it ends too early")
        _, disk, first, here, count, size, begin, length = _END_FIELDS.unpack_from(raw, at)
        if at + _END_FIELDS.size + length != len(raw):
            self._damaged("something stands behind its end")
        end = at
        if raw[max(0, at - 20) : at - 16] == _LOCATOR:
            (end,) = struct.unpack_from("<Q", raw, at - 12)
            if end + _END64_FIELDS.size > at or raw[end : end + 4] != _END64:
                self._damaged("its directory is not where it says")
            *_, disk, first, here, count, size, begin = _END64_FIELDS.unpack_from(raw, end)
        if disk or first or here != count:
            self._damaged("it is one of several parts")
        if begin + size != end:
            self._damaged("its directory is not where it says")
        return begin, end, count, raw[len(raw) - length :] if length else b""

    def _entries(self, at: int, end: int, count: int) -> list[Member]:
        found = []
        while at < end:
            member, at = self._entry(at, end)
            found.append(member)
        if len(found) != count or not found:
            self._damaged(f"its directory has {len(found)} members and says {count}")
        return found

    def _entry(self, at: int, end: int) -> tuple[Member, int]:
        """Return the member listed at a byte, and where the next is."""
        size = _CENTRAL_FIELDS.size
        if at + size > end or self._raw[at : at + 4] != _CENTRAL:
            self._damaged("its directory is damaged")
        fields = _CENTRAL_FIELDS.unpack_from(self._raw, at)
        flags, method, crc = fields[3], fields[4], fields[7]
        name_end = at + size + fields[10]
        after = name_end + fields[11] + fields[12]
        if after > end:
            self._damaged("its directory is damaged")
        name = self._raw[at + size : name_end].decode("utf-8", "surrogateescape")
        sizes = _sizes(fields, self._raw[name_end : name_end + fields[11]])
        if sizes is None:
            self._damaged(f"the sizes of {name} are missing")
        unpacked, packed, offset = sizes
        listing = self._raw[at:after]
        return Member(name, flags, method, crc, packed, unpacked, offset, listing), after

    def _record_ends(self) -> list[int]:
        """Return where the record of each member ends, in the order they stand in."""
        starts = [member.offset for member in self._records] + [self._begin]
        for member, (_, after) in zip(self._records, pairwise(starts), strict=True):
            if member.offset + _LOCAL_FIELDS.size > after or self._data_end(member) > after:
                self._damaged(f"{member.name} overlaps what stands behind it")
        return starts[1:]

    def _data_begin(self, member: Member) -> int:
        fields = _LOCAL_FIELDS.unpack_from(self._raw, member.offset)
        begin = member.offset + _LOCAL_FIELDS.size
        name = self._raw[begin : begin + fields[9]].decode("utf-8", "surrogateescape")
        if fields[0] != MAGIC or name != member.name:
            self._damaged(f"{member.name} is not where the directory says")
        return begin + int(fields[9]) + int(fields[10])

    def _data_end(self, member: Member) -> int:
        return self._data_begin(member) + member.packed

    def _inflated(self, member: Member, data: bytes) -> bytes:
        if member.method == _STORED:
            return data
        if member.method != _DEFLATED:
            raise InputError(
                f"{member.name} is packed in an unusual way (method {member.method})",
                path=self._path,
                advice="export it again",
            )
        inflate = zlib.decompressobj(-zlib.MAX_WBITS)
        try:
            return inflate.decompress(data, member.size + 1)
        except zlib.error as error:
            self._damaged(f"{member.name}: {error}")

    def _made(self, member: Member, content: bytes) -> tuple[bytes, bytes]:
        """Return the record and the directory's entry of a member with another content."""
        local = list(_LOCAL_FIELDS.unpack_from(self._raw, member.offset))
        name = self._raw[member.offset + _LOCAL_FIELDS.size :][: local[9]]
        extra = self._raw[member.offset + _LOCAL_FIELDS.size + local[9] :][: local[10]]
        data = content
        if member.method == _DEFLATED:
            deflate = zlib.compressobj(6, zlib.DEFLATED, -zlib.MAX_WBITS)
            data = deflate.compress(content) + deflate.flush()
        sizes = zlib.crc32(content), len(data), len(content)
        extra = _without_sizes(extra)
        local[2] &= ~_DESCRIPTOR
        local[6:9], local[10] = sizes, len(extra)
        listed = list(_CENTRAL_FIELDS.unpack_from(member.listing))
        begin, end = _CENTRAL_FIELDS.size, _CENTRAL_FIELDS.size + listed[10] + listed[11]
        rest = _without_sizes(member.listing[begin + listed[10] : end])
        listed[3] &= ~_DESCRIPTOR
        listed[7:10], listed[11], listed[16] = sizes, len(rest), 0
        listing = (
            _CENTRAL_FIELDS.pack(*listed) + member.listing[begin : begin + listed[10]] + rest
        ) + member.listing[end:]
        return _LOCAL_FIELDS.pack(*local) + name + extra + data, listing

    def _damaged(self, what: str) -> NoReturn:
        raise InputError(f"damaged zip archive: {what}", path=self._path, advice="export it again")


def _extra_fields(extra: bytes) -> list[tuple[int, bytes]]:
    """Return the extra fields of a record, kind and content; a damaged rest is left out."""
    found, at = [], 0
    while at + 4 <= len(extra):
        kind, length = struct.unpack_from("<2H", extra, at)
        found.append((kind, extra[at + 4 : at + 4 + length]))
        at += 4 + length
    return found


def _without_sizes(extra: bytes) -> bytes:
    """Return extra fields without the sizes of large members."""
    kept = [(kind, body) for kind, body in _extra_fields(extra) if kind != _SIZES64]
    return b"".join(struct.pack("<2H", kind, len(body)) + body for kind, body in kept)


def _sizes(fields: tuple[int, ...], extra: bytes) -> tuple[int, int, int] | None:
    """Return size, packed size and offset; of large members they stand in an extra field."""
    stated = [fields[9], fields[8], fields[16]]
    wide = iter(struct.iter_unpack("<Q", _wide(extra)))
    for k, value in enumerate(stated):
        if value == _FULL32:
            found = next(wide, None)
            if found is None:
                return None
            stated[k] = found[0]
    return stated[0], stated[1], stated[2]


def _wide(extra: bytes) -> bytes:
    body = dict(_extra_fields(extra)).get(_SIZES64, b"")
    return body[: len(body) // 8 * 8]


def _moved(listing: bytes, offset: int) -> bytes:
    """Return a directory's entry for a record that begins at another byte."""
    fields = list(_CENTRAL_FIELDS.unpack_from(listing))
    if fields[16] != _FULL32:
        fields[16] = offset
        return _CENTRAL_FIELDS.pack(*fields) + listing[_CENTRAL_FIELDS.size :]
    begin = _CENTRAL_FIELDS.size + fields[10]
    extra, made = listing[begin : begin + fields[11]], b""
    at = 8 * ((fields[9] == _FULL32) + (fields[8] == _FULL32))
    for kind, body in _extra_fields(extra):
        wide = body
        if kind == _SIZES64:
            wide = body[:at] + struct.pack("<Q", offset) + body[at + 8 :]
        made += struct.pack("<2H", kind, len(wide)) + wide
    return listing[:begin] + made + extra[len(made) :] + listing[begin + fields[11] :]
