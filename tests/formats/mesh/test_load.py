"""Mesh files: what is read, and what has no inside to fill."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from decmcts.errors import InputError
from decmcts.formats.mesh.load import load_solid

BOX = """<?xml version="1.0"?>
<model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources>{objects}</resources><build>{items}</build></model>"""


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
    solid = load_solid(file, (100.0, 80.0))
    np.testing.assert_allclose(solid.bounds, [[90, 75, 0], [110, 85, 5]], atol=1e-5)
    assert solid.volume == pytest.approx(1000.0)


def test_without_center_the_place_is_kept(tmp_path):
    """A plate arranged elsewhere keeps its arrangement; only Z starts at the bed."""
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    box.apply_translation([30.0, 40.0, 50.0])
    solid = load_solid(save(box, tmp_path / "box.stl"), None)
    np.testing.assert_allclose(solid.bounds, [[29, 39, 0], [31, 41, 2]], atol=1e-5)


def test_objects_of_a_3mf_keep_their_distance(tmp_path):
    """Centring each object by itself would print them into each other."""
    file = model_3mf(tmp_path / "two.3mf", places=(0.0, 50.0))
    low, high = load_solid(file, (0.0, 0.0)).bounds
    assert (low[0], high[0]) == pytest.approx((-25.5, 25.5))


def test_inches_become_millimetres(tmp_path):
    """A 3MF names its unit; read as mm the part would come out 25 times too small."""
    solid = load_solid(model_3mf(tmp_path / "inch.3mf", unit="inch"), None)
    np.testing.assert_allclose(solid.extents, 25.4)


def test_small_holes_are_repaired(tmp_path):
    """One lost triangle is common in exported STL files and has one obvious repair."""
    box = trimesh.creation.box((9.0, 9.0, 9.0))
    box.update_faces(np.arange(len(box.faces)) > 0)
    assert load_solid(save(box, tmp_path / "box.stl"), None).volume == pytest.approx(729.0)


def test_inverted_meshes_are_turned(tmp_path):
    """Some exporters write all faces inside out."""
    box = trimesh.creation.box((9.0, 9.0, 9.0))
    box.invert()
    assert load_solid(save(box, tmp_path / "box.stl"), None).volume == pytest.approx(729.0)


def test_slivers_do_not_open_the_mesh(tmp_path):
    """Triangles without area hold T-joints closed; dropping them refused real models."""
    corners = [[0, 0, 0], [4, 0, 0], [2, 3, 0], [2, 1, 3], [2, 0, 0]]
    faces = [[2, 1, 4], [2, 4, 0], [0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 4, 1]]
    sliver = trimesh.Trimesh(np.array(corners, float), faces, process=False)
    assert sliver.is_watertight
    assert load_solid(save(sliver, tmp_path / "sliver.stl"), None).is_watertight


def test_a_mesh_with_holes_names_its_open_edges(tmp_path):
    """What has no inside cannot be filled; the number says how bad it is."""
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=9.0)
    sphere.update_faces(sphere.triangles_center[:, 2] < 5.0)
    with pytest.raises(InputError, match=r"open\.stl: the mesh is not closed: \d+ open edges"):
        load_solid(save(sphere, tmp_path / "open.stl"), None)


def test_a_3mf_of_nothing_is_refused(tmp_path):
    """An empty plate is a user's slip, not an empty print."""
    with pytest.raises(InputError, match="holds no triangles"):
        load_solid(model_3mf(tmp_path / "nothing.3mf", places=()), None)


def test_a_flat_mesh_is_refused(tmp_path):
    """Two sides of a sheet enclose nothing."""
    corners = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0.0]])
    sheet = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 1]], process=False)
    with pytest.raises(InputError, match="flat"):
        load_solid(save(sheet, tmp_path / "sheet.stl"), None)


@pytest.mark.parametrize("name", ["bad.stl", "bad.obj", "bad.3mf"])
@pytest.mark.parametrize("content", [b"", b"\x00\xff" * 60, b"solid nothing\nendsolid\n"])
def test_files_that_are_no_mesh_are_refused(tmp_path, name, content):
    """Empty, binary and foreign files get one line, not a traceback."""
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(InputError) as error:
        load_solid(file, None)
    assert name in str(error.value)
    assert "\n" not in str(error.value)


def test_missing_file_is_refused(tmp_path):
    """A wrong path is the commonest mistake."""
    with pytest.raises(InputError, match=r"gone\.stl"):
        load_solid(tmp_path / "gone.stl", None)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e9])
def test_absurd_coordinates_are_refused(tmp_path, bad):
    """A number that is none would poison every comparison that follows."""
    box = trimesh.creation.box((9.0, 9.0, 9.0))
    text = trimesh.exchange.stl.export_stl_ascii(box).replace("4.5", str(bad))
    (tmp_path / "far.stl").write_text(text)
    with pytest.raises(InputError, match=r"far\.stl"):
        load_solid(tmp_path / "far.stl", None)


@pytest.mark.parametrize("suffix", ["stl", "obj"])
def test_a_corner_that_is_no_number_is_refused(tmp_path, suffix):
    """Dropping the corner and closing the hole would print another part without a word."""
    box = trimesh.creation.box((20.0, 10.0, 5.0))
    corners = box.vertices.copy()
    corners[0, 0] = np.nan
    broken = trimesh.Trimesh(corners, box.faces, process=False)
    with pytest.raises(InputError, match="coordinate"):
        load_solid(save(broken, tmp_path / f"box.{suffix}"), None)
