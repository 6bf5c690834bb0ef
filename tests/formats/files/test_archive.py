"""Zip archives: one member replaced, all else kept, and hostile ones in one line."""

from __future__ import annotations

import io
import struct
import warnings
import zipfile
from collections.abc import Callable

import pytest

from decmcts.errors import InputError
from decmcts.formats.files import archive
from decmcts.formats.files.archive import Archive
from tests.formats.gcode.text.packed import POOR, WHEN, gcode_3mf

NAME = "Metadata/plate_1.gcode"
WHOLE = gcode_3mf({1: POOR, 2: POOR})


def zipped(members: list[tuple[str, bytes]], packing: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return an archive as Python makes it."""
    stream = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(stream, "w", packing) as made:
        warnings.simplefilter("ignore")  # of two members of one name
        for name, content in members:
            made.writestr(zipfile.ZipInfo(name, WHEN), content, packing)
    return stream.getvalue()


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize("content", [b"", b"G1 X1\n" * 1000, b"short"])
def test_another_library_reads_what_was_replaced_and_all_else_as_it_was(content, large):
    """The printer's own reader is none of ours."""
    whole = gcode_3mf({1: POOR, 2: POOR}, large=large)
    old = zipfile.ZipFile(io.BytesIO(whole))
    new = zipfile.ZipFile(io.BytesIO(Archive(whole).replaced({NAME: content})))
    assert new.testzip() is None
    assert new.read(NAME) == content
    assert new.comment == old.comment
    kept = [n for n in old.namelist() if n != NAME]
    assert [new.read(n) for n in kept] == [old.read(n) for n in kept]
    assert new.namelist() == old.namelist()
    for before, after in zip(old.infolist(), new.infolist(), strict=True):
        assert (before.compress_type, before.date_time) == (after.compress_type, after.date_time)


def test_a_replaced_member_can_be_replaced_again():
    """`post` twice."""
    once = Archive(WHOLE).replaced({NAME: b"G28\n"})
    assert Archive(Archive(once).replaced({NAME: POOR})).read(NAME) == POOR


def spoiled(change: Callable[[bytearray], None], whole: bytes = WHOLE) -> bytes:
    content = bytearray(whole)
    change(content)
    return bytes(content)


def at(mark: bytes, where: int, value: bytes, whole: bytes = WHOLE) -> bytes:
    """Return an archive with bytes behind the first of these marks changed."""
    begin = whole.index(mark) + where
    return whole[:begin] + value + whole[begin + len(value) :]


def directory_entry(name: str, whole: bytes = WHOLE) -> int:
    """Return where a member's entry in the directory begins."""
    return whole.index(name.encode(), whole.index(b"PK\x01\x02")) - 46


def listed(where: int, value: bytes, whole: bytes = WHOLE) -> bytes:
    begin = directory_entry(NAME, whole) + where
    return whole[:begin] + value + whole[begin + len(value) :]


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (WHOLE[:-40], "damaged zip archive"),
        (at(b"PK\x05\x06", 12, b"\xff\xff\x00\x00"), "damaged zip archive"),
        (at(b"PK\x01\x02", 0, b"PK\x07\x07"), "damaged zip archive"),
        (listed(8, b"\x01\x00"), "is encrypted"),
        (listed(10, b"\x0c\x00"), "packed in an unusual way (method 12)"),
        (listed(16, b"\x00\x00\x00\x00"), "Bad CRC-32 for file 'Metadata/plate_1.gcode'"),
        (listed(20, b"\x05\x00\x00\x00"), "plate_1.gcode"),
        (listed(20, b"\xff\xff\xff\x0f"), "overlaps what stands behind it"),
        (listed(24, b"\xff\xff\xff\xf0"), "so this is no print"),
        (listed(24, b"\xff\xff\xff\xff"), "so this is no print"),
        (listed(42, b"\x00\x00\x00\x00"), "overlaps"),
        (listed(42, b"\xff\xff\xff\x0f"), "overlaps"),
        (zipped([(NAME, b"G28\n"), (NAME, b"G29\n")]), "two members are named"),
    ],
)
def test_a_hostile_archive_is_refused_in_one_line(raw, said):
    """It comes from the internet; a printer would be given what is made of it."""
    with pytest.raises(InputError, match=said.replace("(", r"\(").replace(")", r"\)")) as error:
        Archive(raw, "part.gcode.3mf").read(NAME)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("part.gcode.3mf: ")


def test_a_bomb_is_not_unpacked(monkeypatch):
    """A member may unpack to what an honest one of its size does, and no more than it states."""
    monkeypatch.setattr(archive, "UNPACKED_FREE", 1000)
    bomb = zipped([(NAME, b"\n" * 2_000_000)])
    with pytest.raises(InputError, match="so this is no print"):
        Archive(bomb).read(NAME)
    entry = directory_entry(NAME, bomb)
    liar = bomb[: entry + 24] + struct.pack("<I", 500) + bomb[entry + 28 :]
    with pytest.raises(InputError, match="CRC-32"):
        Archive(liar).read(NAME)


def test_any_cut_is_refused():
    """A file that was still being copied."""
    for end in range(4, len(WHOLE) - 40, 97):  # the last bytes are a comment
        with pytest.raises(InputError, match="damaged"):
            Archive(WHOLE[:end])


def test_any_changed_byte_is_refused_or_harmless():
    """Whatever is changed, nothing but an InputError is raised."""
    for k in range(0, len(WHOLE), 11):
        try:
            changed = Archive(spoiled(lambda raw, k=k: raw.__setitem__(k, raw[k] ^ 0x55)))
            for name in changed.names:
                changed.read(name)
        except InputError as error:
            assert "\n" not in str(error)
