"""Files that would cost far more than their size is worth are refused at the door."""

from __future__ import annotations

import gzip

import pytest

from decmcts.errors import InputError
from decmcts.formats.files.bounds import unpacked


def test_honest_files_are_unpacked():
    """Plain bytes, one member, and several one after the other as `cat` joins them."""
    assert unpacked(b"G1 X1", "a") == b"G1 X1"
    assert unpacked(gzip.compress(b"G1 X1"), "a") == b"G1 X1"
    assert unpacked(gzip.compress(b"G1 ") + gzip.compress(b"X1"), "a") == b"G1 X1"
    assert unpacked(gzip.compress(b""), "a") == b""


def test_a_bomb_is_refused_before_it_is_unpacked():
    """A thousandfold of a small file is no print; neither is a chain of small members."""
    bomb = gzip.compress(bytes(2**24))
    for raw in (bomb, gzip.compress(bytes(2**19)) * 3):
        with pytest.raises(InputError, match=r"a\.gz: .* bytes unpack to more than"):
            unpacked(raw, "a.gz", free=2**20)


@pytest.mark.parametrize("cut", [-1, -9, 12, 3])
def test_cut_files_are_named(cut):
    """A download that broke off must not be taken for a short print."""
    with pytest.raises(InputError, match=r"a\.gz: damaged gzip data"):
        unpacked(gzip.compress(b"G1 X1\n" * 99)[:cut], "a.gz")


def test_garbage_after_the_magic_number():
    """Two bytes do not make a gzip file."""
    with pytest.raises(InputError, match="damaged gzip data"):
        unpacked(b"\x1f\x8b broken", "a.gz")
