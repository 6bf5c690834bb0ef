"""Mesh files that broke off or were damaged: one line that says so, never a library's."""

from __future__ import annotations

import io
import random
import re
import struct
import zipfile
from pathlib import Path

import pytest
import trimesh

from decmcts.errors import InputError
from decmcts.formats.mesh.load import load_solid

BALL = trimesh.creation.icosphere(subdivisions=1, radius=6.0)
BINARY: bytes = BALL.export(file_type="stl")
WORDS: bytes = BALL.export(file_type="stl_ascii").encode()
OBJ: bytes = BALL.export(file_type="obj").encode()
PACKED: bytes = BALL.export(file_type="3mf")


def archive(text: bytes, name: str = "3D/3dmodel.model") -> bytes:
    """Return a zip archive of one file."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as made:
        made.writestr(name, text)
    return packed.getvalue()


MODEL = zipfile.ZipFile(io.BytesIO(PACKED)).read("3D/3dmodel.model")
DAMAGED = {
    "cut.stl": (BINARY[:400], "400 bytes, 4084 expected for the 80 triangles"),
    "many.stl": (bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50), "134 bytes, 214748364834"),
    "header.stl": (BINARY[:50], "50 bytes, the header alone takes 84"),
    "none.stl": (bytes(84), "no triangles"),
    "empty.stl": (b"", "is empty"),
    "text.stl": (WORDS[: len(WORDS) // 2], "no `endsolid`"),
    "corner.stl": (WORDS.replace(b"vertex", b"vertix", 1), "239 corners of 80 triangles"),
    "number.stl": (WORDS.replace(b"vertex ", b"vertex x", 1), ":4: a coordinate is no number"),
    "picture.stl": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "or none: 264 bytes"),
    "empty.obj": (b"\n", "is empty"),
    "binary.obj": (bytes(range(256)), "binary data"),
    "far.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99\n", "a point that is not there"),
    "words.obj": (b"v a b c\nf 1 2 3\n", "no number"),
    "points.obj": (b"v 0 0 0\nv 1 0 0\n", "no triangles"),
    "none.3mf": (b"PK no", "zip archive"),
    "cut.3mf": (PACKED[: len(PACKED) // 2], "cut off"),
    "other.3mf": (archive(b"x", "a.txt"), "without a 3MF model"),
    "far.3mf": (archive(MODEL.replace(b'v1="0"', b'v1="999"', 1)), "point 1000 of 42"),
    "xml.3mf": (archive(MODEL[:900]), "is no readable mesh"),
    "number.3mf": (archive(MODEL.replace(b'x="', b'x="q', 1)), "no number"),
}


def refusal(path: Path, content: bytes) -> str:
    """Return the one line a damaged file is refused with, or '' if it is read."""
    path.write_bytes(content)
    try:
        load_solid(path, None)
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_says_what_is_wrong_with_it(name: str, tmp_path: Path) -> None:
    """A truncated STL was said to lack a module of Python."""
    content, words = DAMAGED[name]
    said = refusal(tmp_path / name, content)
    assert words in said
    assert name in said and "\n" not in said


def test_bytes_behind_the_last_triangle_are_left_alone(tmp_path: Path) -> None:
    """Some programs put their own there; the triangles are whole."""
    assert refusal(tmp_path / "ball.stl", BINARY + b"made by someone") == ""


@pytest.mark.parametrize("kind", ["solid", "Solid"])
def test_a_binary_header_may_say_solid(kind: str, tmp_path: Path) -> None:
    """Many exporters write it there; the size tells the two apart."""
    assert refusal(tmp_path / "ball.stl", (kind.encode() + BINARY[len(kind) :])) == ""


def test_comments_of_an_obj_may_be_in_any_encoding(tmp_path: Path) -> None:
    """Names with umlauts were written in the encoding of the day."""
    assert refusal(tmp_path / "ball.obj", b"# W\xfcrfel\n" + OBJ) == ""


@pytest.mark.parametrize("suffix", ["stl", "words.stl", "obj", "3mf", "model.3mf"])
def test_no_damage_crashes_or_names_our_libraries(suffix: str, tmp_path: Path) -> None:
    """Cut, changed and added bytes, 25 times each: read, or refused in one line."""
    good = {"stl": BINARY, "words.stl": WORDS, "obj": OBJ, "3mf": PACKED, "model.3mf": MODEL}
    rng = random.Random(suffix)
    for _ in range(25):
        content = bytearray(good[suffix])
        at = rng.randrange(len(content))
        match rng.randrange(3):
            case 0:
                del content[at:]
            case 1:
                for _ in range(5):
                    content[rng.randrange(len(content))] = rng.randrange(256)
            case 2:
                content[at:at] = rng.randbytes(20)
        whole = archive(bytes(content)) if suffix == "model.3mf" else bytes(content)
        said = refusal(tmp_path / f"mesh.{suffix}", whole)
        assert "module" not in said and "\n" not in said and "broadcast" not in said


def test_numbers_of_a_text_stl_may_be_long(tmp_path: Path) -> None:
    """Of a word of more than 32 letters the end was lost, and with it the exponent."""
    path = tmp_path / "long.stl"
    words = re.sub(
        rb"vertex (\S+) (\S+) (\S+)",
        lambda found: (
            b"vertex " + b" ".join(b"%.33e" % (10.0 * float(word)) for word in found.groups())
        ),
        WORDS,
    )
    path.write_bytes(WORDS)
    plain = load_solid(path, None)
    path.write_bytes(words)
    assert load_solid(path, None).bounds == pytest.approx(10.0 * plain.bounds)
