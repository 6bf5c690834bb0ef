"""Mesh files: what is read, and what has no inside to fill."""

from __future__ import annotations

import io
import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from decmcts.errors import InputError
from decmcts.formats.mesh.load import load_solid
from decmcts.formats.mesh.options import Bed

BED = Bed((0.0, 0.0), (200.0, 160.0), 90.0)
BALL = trimesh.creation.icosphere(subdivisions=1, radius=6.0)
BINARY: bytes = BALL.export(file_type="stl")
WORDS: bytes = BALL.export(file_type="stl_ascii").encode()
OBJ: bytes = BALL.export(file_type="obj").encode()
PACKED: bytes = BALL.export(file_type="3mf")
MODEL = zipfile.ZipFile(io.BytesIO(PACKED)).read("3D/3dmodel.model")
BOX = """<?xml version="1.0"?>
<model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources>{objects}</resources><build>{items}</build></model>"""


def archive(text: bytes, name: str = "3D/3dmodel.model") -> bytes:
    """Return a zip archive of one file."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as made:
        made.writestr(name, text)
    return packed.getvalue()


def save(mesh: trimesh.Trimesh, path: Path) -> Path:
    mesh.export(path)
    return path


def model_3mf(path: Path, *, unit: str = "millimeter", places: tuple[float, ...] = (0.0,)) -> Path:
    """A 3MF file with one 1 x 1 x 1 box at each place along X."""
    box = trimesh.creation.box()
    corners = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in box.vertices)
    sides = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in box.faces)
    mesh = f"<mesh><vertices>{corners}</vertices><triangles>{sides}</triangles></mesh>"
    objects = f'<object id="1" type="model">{mesh}</object>' if places else ""
    items = "".join(f'<item objectid="1" transform="1 0 0 0 1 0 0 0 1 {x} 0 0"/>' for x in places)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", BOX.format(unit=unit, objects=objects, items=items))
    return path


@pytest.mark.parametrize("name", ["box.stl", "box.obj", "box.3mf"])
def test_formats_give_the_same_solid(tmp_path, name):
    """The three formats are promised; all stand on the bed, centred."""
    file = save(trimesh.creation.box((20.0, 10.0, 5.0)), tmp_path / name)
    solid = load_solid(file, BED)
    np.testing.assert_allclose(solid.bounds, [[90, 75, 0], [110, 85, 5]], atol=1e-5)
    assert solid.volume == pytest.approx(1000.0)


def test_objects_of_a_3mf_keep_their_distance(tmp_path):
    """Centring each object by itself would print them into each other."""
    file = model_3mf(tmp_path / "two.3mf", places=(0.0, 50.0))
    low, high = load_solid(file, BED).bounds
    assert (low[0], high[0]) == pytest.approx((74.5, 125.5))


def test_inches_become_millimetres(tmp_path):
    """A 3MF names its unit; read as mm the part would come out 25 times too small."""
    solid = load_solid(model_3mf(tmp_path / "inch.3mf", unit="inch"), BED)
    np.testing.assert_allclose(solid.extents, 25.4)


def test_small_holes_are_repaired(tmp_path):
    """One lost triangle is common in exported STL files and has one obvious repair."""
    box = trimesh.creation.box((9.0, 9.0, 9.0))
    box.update_faces(np.arange(len(box.faces)) > 0)
    assert load_solid(save(box, tmp_path / "box.stl"), BED).volume == pytest.approx(729.0)


def test_inverted_meshes_are_turned(tmp_path):
    """Some exporters write all faces inside out."""
    box = trimesh.creation.box((9.0, 9.0, 9.0))
    box.invert()
    assert load_solid(save(box, tmp_path / "box.stl"), BED).volume == pytest.approx(729.0)


def test_slivers_do_not_open_the_mesh(tmp_path):
    """Triangles without area hold T-joints closed; dropping them refused real models."""
    corners = [[0, 0, 0], [4, 0, 0], [2, 3, 0], [2, 1, 3], [2, 0, 0]]
    faces = [[2, 1, 4], [2, 4, 0], [0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 4, 1]]
    sliver = trimesh.Trimesh(np.array(corners, float), faces, process=False)
    assert sliver.is_watertight
    assert load_solid(save(sliver, tmp_path / "sliver.stl"), BED).is_watertight


def test_a_mesh_with_holes_names_its_open_edges(tmp_path):
    """What has no inside cannot be filled; the number says how bad it is."""
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=9.0)
    sphere.update_faces(sphere.triangles_center[:, 2] < 5.0)
    with pytest.raises(InputError, match=r"open\.stl: the mesh is not closed: \d+ open edges"):
        load_solid(save(sphere, tmp_path / "open.stl"), BED)


DAMAGED = {
    "cut.stl": BINARY[:400], "header.stl": BINARY[:50], "none.stl": bytes(84), "empty.stl": b"",
    "many.stl": bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50),
    "text.stl": WORDS[: len(WORDS) // 2], "corner.stl": WORDS.replace(b"vertex", b"vertix", 1),
    "number.stl": WORDS.replace(b"vertex ", b"vertex x", 1), "nothing.stl": b"solid\nendsolid\n",
    "picture.stl": b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
    "empty.obj": b"\n", "binary.obj": bytes(range(256)), "points.obj": b"v 0 0 0\nv 1 0 0\n",
    "far.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99\n", "words.obj": b"v a b c\nf 1 2 3\n",
    "none.3mf": b"PK no", "cut.3mf": PACKED[: len(PACKED) // 2],
    "other.3mf": archive(b"x", "a.txt"), "xml.3mf": archive(MODEL[:900]),
    "far.3mf": archive(MODEL.replace(b'v1="0"', b'v1="999"', 1)),
    "number.3mf": archive(MODEL.replace(b'x="', b'x="q', 1)),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_is_one_line(name, tmp_path):
    """A truncated STL was said to lack a module of Python."""
    (tmp_path / name).write_bytes(DAMAGED[name])
    with pytest.raises(InputError, match=f"{name}: is no mesh that can be read, is cut off, or"):
        load_solid(tmp_path / name, BED)


def test_a_3mf_of_nothing_is_refused(tmp_path):
    """An empty plate is a user's slip, not an empty print."""
    with pytest.raises(InputError, match="holds no triangles"):
        load_solid(model_3mf(tmp_path / "nothing.3mf", places=()), BED)


def test_missing_file_is_refused(tmp_path):
    """A wrong path is the commonest mistake."""
    with pytest.raises(InputError, match=r"gone\.stl"):
        load_solid(tmp_path / "gone.stl", BED)


@pytest.mark.parametrize("kind", ["solid", "Solid"])
def test_a_binary_header_may_say_solid(kind, tmp_path):
    """Many exporters write it there; the size tells the two apart."""
    (tmp_path / "ball.stl").write_bytes(kind.encode() + BINARY[len(kind) :])
    assert load_solid(tmp_path / "ball.stl", BED).is_watertight


@pytest.mark.parametrize(
    ("name", "content"),
    [("ball.obj", b"# W\xfcrfel\n" + OBJ), ("ball.stl", b"solid W\xfc" + WORDS[5:])],
)
def test_comments_may_be_in_any_encoding(name, content, tmp_path):
    """Names with umlauts were written in the encoding of the day."""
    (tmp_path / name).write_bytes(content)
    assert load_solid(tmp_path / name, BED).is_watertight


def test_numbers_of_a_text_stl_may_be_long(tmp_path):
    """Of a word of more than 32 letters the end was lost, and with it the exponent."""
    path, plain = tmp_path / "long.stl", save(BALL, tmp_path / "ball.stl")
    path.write_bytes(
        re.sub(
            rb"vertex (\S+) (\S+) (\S+)",
            lambda found: b"vertex " + b" ".join(b"%.33e" % (7 * float(x)) for x in found.groups()),
            WORDS,
        )
    )
    assert load_solid(path, BED).extents == pytest.approx(7 * load_solid(plain, BED).extents)


def test_a_mesh_in_other_units_is_refused_before_it_is_sliced(tmp_path):
    """A cube of 2 m, as of a file in micrometres, was sliced for minutes."""
    cube = save(trimesh.creation.box([2000.0, 2000.0, 2000.0]), tmp_path / "cube.stl")
    said = "is 2000 x 2000 x 2000 mm, larger than the bed, 200 x 160 mm"
    with pytest.raises(InputError, match=said):
        load_solid(cube, BED)


def test_a_flat_mesh_is_refused(tmp_path):
    """Two sides of a sheet enclose nothing."""
    corners = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0.0]])
    sheet = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 1]], process=False)
    with pytest.raises(InputError, match="flat"):
        load_solid(save(sheet, tmp_path / "sheet.stl"), BED)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e9])
def test_absurd_coordinates_are_refused(tmp_path, bad):
    """A number that is none would poison every comparison that follows."""
    box = trimesh.creation.box((9.0, 9.0, 9.0))
    text = trimesh.exchange.stl.export_stl_ascii(box).replace("4.5", str(bad))
    (tmp_path / "far.stl").write_text(text)
    with pytest.raises(InputError, match=r"far\.stl"):
        load_solid(tmp_path / "far.stl", BED)


@pytest.mark.parametrize("suffix", ["stl", "obj"])
def test_a_corner_that_is_no_number_is_refused(tmp_path, suffix):
    """Dropping the corner and closing the hole would print another part without a word."""
    box = trimesh.creation.box((20.0, 10.0, 5.0))
    corners = box.vertices.copy()
    corners[0, 0] = np.nan
    broken = trimesh.Trimesh(corners, box.faces, process=False)
    with pytest.raises(InputError, match="coordinate"):
        load_solid(save(broken, tmp_path / f"box.{suffix}"), BED)
