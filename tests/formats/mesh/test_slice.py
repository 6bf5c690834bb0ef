"""The built-in slicer: right amount, right place, right order."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
import trimesh

from decmcts.errors import InputError
from decmcts.formats.mesh import SliceOptions, slice_mesh, slice_to_gcode
from decmcts.formats.mesh.options import Bed
from decmcts.formats.mesh.sections import Layers, cut_layers, find_shells
from decmcts.formats.mesh.toolpaths import border_joints, zigzags
from decmcts.print.contours import Role

FILAMENT_MM2 = math.pi * 1.75**2 / 4.0
HERE = SliceOptions(center=(100.0, 100.0))


@pytest.fixture(scope="module")
def cube(tmp_path_factory):
    file = tmp_path_factory.mktemp("mesh") / "cube.stl"
    trimesh.creation.box((16.0, 16.0, 4.0)).export(file)
    return file


def test_solid_cube_has_its_own_volume(cube):
    """At full density the filament is what the cube holds; more would burst, less be weak."""
    job, _ = slice_mesh(cube, SliceOptions(density=1.0))
    volume = job.contours.extrusion.sum() * FILAMENT_MM2
    assert volume == pytest.approx(16 * 16 * 4, rel=0.02)


def test_sparse_cube_has_walls_shells_and_its_density(cube):
    """Volume as asked: 2 walls, 3 + 3 solid layers, the rest at 20 %."""
    job, _ = slice_mesh(cube, HERE)
    spacing = 0.45 - 0.2 * (1 - math.pi / 4)
    inner = 16 - 2 * (0.225 + 1.5 * spacing)  # side of what the walls leave
    room = inner - spacing + 2 * 0.15 * 0.45  # of the infill's centre lines
    joints = 2 * room * spacing  # they run along half of the border
    sparse = 256 - inner**2 + 0.2 * room**2 + joints
    wanted = 6 * 0.2 * 256 + 14 * 0.2 * sparse
    volume = job.contours.extrusion.sum() * FILAMENT_MM2
    assert volume == pytest.approx(wanted, rel=0.03)


def test_layers_fill_the_height(cube):
    """One layer too few leaves the part open, one too many makes it too tall."""
    job, _ = slice_mesh(cube, HERE)
    assert np.unique(job.contours.top).round(6).tolist() == [
        round(0.2 * k, 6) for k in range(1, 21)
    ]
    assert set(job.contours.height.round(6)) == {0.2}


def test_first_layer_height_is_its_own(cube):
    """A thicker first layer holds to the bed."""
    job, _ = slice_mesh(cube, SliceOptions(first_layer_height=0.3))
    tops = np.unique(job.contours.top)
    assert tops[:2] == pytest.approx([0.3, 0.5])
    assert tops[-1] == pytest.approx(3.9)
    assert job.contours.height[0] == pytest.approx(0.3)


def test_walls_are_closed_and_as_many_as_asked(cube):
    """A wall with a gap leaks; the reader must see it as one closed contour."""
    job, _ = slice_mesh(cube, SliceOptions(perimeters=3))
    walls = np.isin(job.contours.role, (Role.PERIMETER, Role.EXTERNAL_PERIMETER))
    assert job.contours.closed[walls].all()
    assert walls.sum() == 3 * 20
    assert (job.contours.role == Role.EXTERNAL_PERIMETER).sum() == 20


@pytest.mark.parametrize("external_first", [False, True])
def test_walls_come_before_infill_in_the_order_asked(cube, external_first):
    """Infill anchors in walls; outer walls last look better, first measure better."""
    job, _ = slice_mesh(cube, SliceOptions(external_first=external_first))
    middle = job.contours.role[job.contours.layer == 10].tolist()
    walls = [Role.EXTERNAL_PERIMETER, Role.PERIMETER]
    assert middle[:2] == (walls if external_first else walls[::-1])
    assert set(middle[2:]) == {Role.INFILL}


def test_beads_stay_inside_the_part(cube):
    """Outer beads end at the surface; infill reaches 15 % of a bead into the walls, no more."""
    job, _ = slice_mesh(cube, HERE)
    contours = job.contours
    fill = np.repeat(
        ~np.isin(contours.role, (Role.PERIMETER, Role.EXTERNAL_PERIMETER)),
        np.diff(contours.offsets),
    )
    reach = np.abs(contours.points[:, :2] - 100.0).max(axis=1)
    assert reach.max() == pytest.approx(8.0 - 0.225, abs=1e-3)
    spacing = 0.45 - 0.2 * (1 - math.pi / 4)
    inner_edge = 8.0 - 0.225 - 1.5 * spacing
    assert reach[fill].max() <= inner_edge - spacing / 2 + 0.15 * 0.45 + 2e-3


def test_top_and_bottom_are_solid(cube):
    """Three layers each, the last of them a top surface."""
    job, _ = slice_mesh(cube, HERE)
    contours = job.contours
    roles = [set(contours.role[contours.layer == k].tolist()) for k in range(20)]
    sparse = [Role.INFILL in r for r in roles]
    assert sparse == [3 <= k < 17 for k in range(20)]
    assert [Role.TOP_SOLID_INFILL in r for r in roles] == [k == 19 for k in range(20)]


def test_infill_alternates_its_direction(cube):
    """Lines on lines of the same direction would be walls, not a lattice."""
    job, _ = slice_mesh(cube, HERE)
    contours = job.contours
    slopes = []
    for layer in (8, 9):
        (first, *_) = np.flatnonzero((contours.layer == layer) & (contours.role == Role.INFILL))
        steps = np.diff(contours.polyline(first), axis=0)
        longest = steps[np.argmax(np.linalg.norm(steps, axis=1))]
        slopes.append(longest[1] / longest[0])
    assert sorted(slopes) == pytest.approx([-1.0, 1.0], abs=0.01)


def test_density_zero_leaves_the_inside_empty(cube):
    """Hollow parts are asked for as density 0."""
    job, _ = slice_mesh(cube, SliceOptions(density=0.0))
    assert Role.INFILL not in job.contours.role


def test_same_input_same_bytes(cube):
    """Results are compared by digest; a slicer that varies would break that."""
    assert slice_to_gcode(cube, HERE) == slice_to_gcode(cube, HERE)


def test_job_names_its_source_not_a_temporary_file(cube):
    """Messages and reports show these names to the user."""
    job, document = slice_mesh(cube, HERE)
    assert job.name == "cube"
    assert "built-in" in job.slicer
    assert document.path == str(cube)


def test_settings_reach_the_reader(cube):
    """Regenerated travels retract as the options say."""
    job, _ = slice_mesh(cube, SliceOptions(retract_mm=0.7, travel_feed=123.0))
    assert job.settings.retract_mm == pytest.approx(0.7)
    assert job.settings.travel_feed == pytest.approx(123.0)


@pytest.mark.parametrize("perimeters", [0, 1])
def test_few_walls_still_fill(cube, perimeters):
    """Without walls the infill goes to the border itself."""
    job, _ = slice_mesh(cube, SliceOptions(perimeters=perimeters, density=1.0))
    volume = job.contours.extrusion.sum() * FILAMENT_MM2
    assert volume == pytest.approx(16 * 16 * 4, rel=0.05)


def test_edges_of_four_faces_are_sliced(tmp_path):
    """Two cubes that share an edge are closed but no manifold."""
    one, two = trimesh.creation.box((6.0, 6.0, 2.0)), trimesh.creation.box((6.0, 6.0, 2.0))
    two.apply_translation([6.0, 6.0, 0.0])
    file = tmp_path / "edge.stl"
    trimesh.util.concatenate([one, two]).export(file)
    job, _ = slice_mesh(file, SliceOptions(density=1.0))
    volume = job.contours.extrusion.sum() * FILAMENT_MM2
    assert volume == pytest.approx(2 * 72, rel=0.05)


def test_parts_finer_than_a_bead_are_refused(tmp_path):
    """A model in metres read as mm is the usual reason; an empty print helps nobody."""
    file = tmp_path / "tiny.stl"
    trimesh.creation.box((0.1, 0.1, 0.1)).export(file)
    with pytest.raises(InputError, match=r"as wide as a bead of 0\.45 mm .*; check its units"):
        slice_mesh(file)


@pytest.mark.parametrize(
    "wrong",
    [{"layer_height": 0.5}, {"layer_height": math.nan}, {"density": 1.5}, {"perimeters": -1},
     {"nozzle": 0.0}, {"travel_feed": 0.0}, {"center": (math.inf, 0.0)}, {"width": 5.0}],
)  # fmt: skip
def test_options_that_cannot_be_printed_are_refused(wrong):
    """A layer higher than the nozzle is wide does not stick; say so before slicing."""
    with pytest.raises(InputError, match=next(iter(wrong)).replace("_", "[_ ]")):
        SliceOptions(**wrong)


def test_overlapping_objects_are_printed_once(tmp_path):
    """Parts of a plate that overlap are one solid, not twice the filament."""
    one, two = trimesh.creation.box((8.0, 8.0, 2.0)), trimesh.creation.box((8.0, 8.0, 2.0))
    two.apply_translation([4.0, 0.0, 0.0])
    layers = cut_layers(trimesh.util.concatenate([one, two]).apply_translation([0, 0, 1]), 0.2, 0.2)
    assert [r.area for r in layers.regions] == pytest.approx([12.0 * 8.0] * 10)


def test_alike_layers_share_one_region():
    """Prismatic parts are common; their shells cost nothing then."""
    box = trimesh.creation.box((8.0, 8.0, 2.0)).apply_translation([0, 0, 1])
    assert len({id(r) for r in cut_layers(box, 0.2, 0.2).regions}) == 1


def test_shells_are_the_places_near_the_outside():
    """Against the definition: solid where not all neighbours within reach cover it."""
    rng = np.random.default_rng(4)
    regions = tuple(
        shapely.union_all([shapely.box(x, y, x + 5, y + 5) for x, y in rng.random((6, 2)) * 8])
        for _ in range(9)
    )
    shells = find_shells(Layers(np.arange(9.0), np.ones(9), regions), 3, 2)
    for i, region in enumerate(regions):
        inside = region
        for j in range(i - 2, i + 4):
            inside = inside.intersection(regions[j] if 0 <= j < 9 else shapely.MultiPolygon())
        assert shells.solid[i].symmetric_difference(region.difference(inside)).area < 1e-9


SQUARE_WITH_HOLE = shapely.box(0, 0, 20, 20).difference(shapely.Point(9, 11).buffer(4))


@pytest.mark.parametrize("region", [shapely.box(0, 0, 20, 20), SQUARE_WITH_HOLE])
def test_zigzags_stay_inside_and_cover(region):
    """A joint across a hole would close it; a lost line would leave a gap."""
    ways = zigzags(region, distance=0.5, angle_rad=0.7, shortest=0.0)
    lines = shapely.MultiLineString([shapely.LineString(way) for way in ways])
    assert region.buffer(1e-6).covers(lines)
    assert region.buffer(-0.3).difference(lines.buffer(0.26)).area < 0.05
    assert len(ways) <= 4


def test_a_convex_region_is_one_zigzag():
    """Each further piece would cost a travel and a retraction in every layer."""
    (way,) = zigzags(shapely.box(0, 0, 10, 10), distance=1.0, angle_rad=math.pi / 4, shortest=0.0)
    assert len(way) > 20


def test_joints_never_close_a_loop():
    """Two lines joined at both ends would have no beginning and be lost."""
    region = shapely.box(0, 0, 10, 1.5)
    ends = np.array([[[0, 0.5], [10, 0.5]], [[0, 1.0], [10, 1.0]]])
    joints = border_joints(ends, region, longest=5.0)
    assert len(joints) == 2
    assert {end // 2 for end in joints} == {0, 1}


def test_empty_regions_have_no_infill():
    """Thin layers have walls only."""
    assert zigzags(shapely.MultiPolygon(), distance=1.0, angle_rad=0.0, shortest=0.0) == []


def test_a_mesh_lower_than_half_a_layer_is_refused(tmp_path):
    """A cut above the solid finds no outline; that is the user's units, not our error."""
    path = tmp_path / "flat.stl"
    trimesh.creation.box((20.0, 20.0, 0.05)).export(path)
    with pytest.raises(InputError, match="half a layer"):
        slice_to_gcode(path)


def test_the_skirt_runs_around_the_part_and_comes_first(cube):
    """It fills the nozzle and shows whether the bed is level, before the part begins."""
    job, _ = slice_mesh(cube, SliceOptions(center=(100.0, 100.0), skirts=2))
    contours = job.contours
    assert contours.role[:3].tolist() == [Role.SKIRT_BRIM, Role.SKIRT_BRIM, Role.PERIMETER]
    reach = [np.abs(contours.polyline(k)[:, :2] - 100.0).max() for k in (0, 1)]
    assert reach == pytest.approx([8.0 + 6.0 + 0.45, 8.0 + 6.0], abs=1e-3)


def test_a_skirt_stays_on_the_bed(tmp_path):
    """Beads beyond the edge hang on the clips; where there is no room there is no skirt."""
    file = tmp_path / "plate.stl"
    trimesh.creation.box((200.0, 80.0, 0.4)).export(file)
    bed = Bed((0.0, 0.0), (205.0, 90.0))
    here = SliceOptions(center=bed.center, bed=bed, skirts=2, density=0.0)
    job, _ = slice_mesh(file, here)
    first = job.contours.polyline(0)
    assert job.contours.role[0] == Role.SKIRT_BRIM
    assert first[:, 0].min() >= 0.225 - 1e-9 and first[:, 0].max() <= 205.0 - 0.225 + 1e-9
    tight = Bed((0.0, 0.0), (201.0, 81.0))
    job, _ = slice_mesh(file, replace(here, center=tight.center, bed=tight))
    assert Role.SKIRT_BRIM not in job.contours.role


def test_the_head_lifts_within_the_machine_and_parks(cube):
    """On the tallest prints there is no room for the whole lift."""
    text = slice_to_gcode(cube, SliceOptions(bed=Bed((0, 0), (180, 170), 9.0)))
    end = text[text.rindex(";TYPE:Custom") :].splitlines()
    assert end[1:4] == ["G1 E-1 F2400", "G1 Z9.000 F600 ; up", "G1 X5.000 Y165.000 F9000 ; park"]
    assert "M104 S0 ; nozzle off" in end


def test_temperatures_nothing_flows_at_are_refused():
    """A cold nozzle grinds the filament and prints nothing."""
    with pytest.raises(InputError, match="temperature 20 is out of bounds; give 150 to 500"):
        SliceOptions(temperature=20.0)
