"""Zip archives in memory: members are read, or replaced while all others keep their contents."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from itertools import pairwise
from pathlib import Path

from decmcts.errors import InputError
from decmcts.formats.files.bounds import UNPACKED_FREE, UNPACKED_TIMES, refuse_larger
from decmcts.formats.files.reading import first_twice

MAGIC = b"PK\x03\x04"
_HEADER_BYTES = 30  # of a member, without its name
_AGAIN = "export it again"
_ENCRYPTED = 0x2041  # bits of the flags
_USUAL = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_DAMAGED = (  # what `zipfile` raises
    zipfile.BadZipFile, NotImplementedError, zlib.error, struct.error, EOFError, OSError,
    OverflowError, ValueError,
)  # fmt: skip


class Archive:
    """A zip archive of a file's bytes; the path is for messages.

    Raises InputError when it is damaged, two members share a name or a byte, or all together
    unpack to more than any print.
    """

    def __init__(self, raw: bytes, path: Path | str | None = None) -> None:
        self._path = path
        with self._in_one_line():
            self._zip = zipfile.ZipFile(io.BytesIO(raw), metadata_encoding="utf-8")
            self.names = self._zip.namelist()
            if (twice := first_twice(self.names)) is not None:
                raise zipfile.BadZipFile(f"two members are named {twice!r}")
            self._refuse_overlaps()
        size = sum(member.file_size for member in self._zip.infolist())
        if size > max(UNPACKED_FREE, UNPACKED_TIMES * len(raw)):
            raise InputError(
                f"{len(raw):,} bytes unpack to {size:,}, so this is no print",
                path=path,
                advice="unpack it and look",
            )

    def read(self, name: str) -> bytes:
        """Return what a member holds; raises InputError when it cannot be unpacked."""
        member = self._zip.getinfo(name)
        if member.flag_bits & _ENCRYPTED:
            raise InputError(f"{name} is encrypted", path=self._path, advice=_AGAIN)
        if member.compress_type not in _USUAL:
            what = f"{name} is packed in an unusual way (method {member.compress_type})"
            raise InputError(what, path=self._path, advice=_AGAIN)
        refuse_larger(member.file_size, self._path)
        with self._in_one_line():
            return self._zip.read(member)

    def replaced(self, contents: Mapping[str, bytes]) -> bytes:
        """Return the archive with other contents in the place of these members'.

        All members keep their place, name, time and kind of packing, and the archive its comment.
        """
        made = io.BytesIO()
        with self._in_one_line(), zipfile.ZipFile(made, "w") as out:
            out.comment = self._zip.comment
            for member in self._zip.infolist():
                content = contents.get(member.filename)
                whole = self.read(member.filename) if content is None else content
                out.writestr(copy(member), whole)
        return made.getvalue()

    def _refuse_overlaps(self) -> None:
        members = sorted(self._zip.infolist(), key=lambda member: member.header_offset)
        starts = [*(member.header_offset for member in members), self._zip.start_dir]
        for member, (start, after) in zip(members, pairwise(starts), strict=True):
            if start + _HEADER_BYTES + member.compress_size > after:
                what = f"{member.filename} overlaps what stands behind it"
                raise zipfile.BadZipFile(what)

    @contextmanager
    def _in_one_line(self) -> Iterator[None]:
        try:
            yield
        except _DAMAGED as error:
            what = " ".join(str(error).split()) or type(error).__name__
            raise InputError(
                f"damaged zip archive: {what}", path=self._path, advice=_AGAIN
            ) from error
