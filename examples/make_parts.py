"""Make the example parts, and with PrusaSlicer the example prints.

``python examples/make_parts.py`` writes the meshes; with ``--slice`` it calls
``prusa-slicer`` as well. Both results are kept in `decmcts/samples`, so nobody
needs the slicer to run the demo. All parts are our own designs, in mm.
"""

from __future__ import annotations

import argparse
import gzip
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import shapely
import trimesh
from shapely import Polygon

from decmcts.samples import SAMPLES

HERE = Path(__file__).parent
SLICER_OPTIONS = HERE / "prusa_slicer.ini"
Solid = trimesh.Trimesh

# Where each part of the plate stands. All beads lie between x 30 and 270, where
# both heads of machine `dual-gantry` reach, so one of them can finish alone.
PLACES = {
    "bracket": (58.0, 72.0),
    "knob": (242.0, 72.0),
    "gear": (106.0, 150.0),
    "spacer": (194.0, 150.0),
    "cup": (58.0, 228.0),
    "tray": (242.0, 228.0),
}


def disc(radius: float, sides: int = 64) -> Polygon:
    """Return a regular polygon around the origin, a corner on the x axis."""
    turn = np.arange(sides) * 2.0 * np.pi / sides
    return Polygon(radius * np.column_stack([np.cos(turn), np.sin(turn)]))


def stack(*levels: tuple[Polygon, float, float]) -> Solid:
    """Return the union of (outline, from z, to z) prisms."""
    prisms = []
    for outline, low, high in levels:
        prism = trimesh.creation.extrude_polygon(outline, high - low)
        prism.apply_translation([0.0, 0.0, low])
        prisms.append(prism)
    return prisms[0] if len(prisms) == 1 else trimesh.boolean.union(prisms, engine="manifold")


def bracket() -> Solid:
    """Return a shelf bracket with a brace, 50 mm legs, lying on its side."""
    legs = Polygon([(0, 0), (50, 0), (50, 6), (6, 6), (6, 50), (0, 50)])
    brace = Polygon([(38, 0), (46, 0), (0, 46), (0, 38)])
    eye = shapely.affinity.translate(disc(2.2, 32), 6.5, 6.5)
    fillet = Polygon([(0, 0), (16, 0), (0, 16)])
    outline = shapely.union_all([legs, brace, fillet]).difference(eye)
    return stack((shapely.affinity.translate(outline, -22.0, -22.0), 0.0, 8.0))


def cup() -> Solid:
    """Return a cup 40 mm across and 12 mm high with a floor of 1.6 mm."""
    return stack((disc(20.0), 0.0, 1.6), (disc(20.0).difference(disc(18.25)), 1.4, 12.0))


def gear(teeth: int = 20, module: float = 2.0) -> Solid:
    """Return a spur gear with straight-sided teeth, a bore, five holes and a hub."""
    pitch = teeth * module / 2.0
    radii = np.tile([pitch - 1.25 * module] * 2 + [pitch + module] * 2, teeth)
    fractions = np.add.outer(np.arange(teeth), [-0.06, 0.18, 0.38, 0.70]).ravel()
    turn = 2.0 * np.pi * fractions / teeth
    outline = Polygon(radii[:, None] * np.column_stack([np.cos(turn), np.sin(turn)]))
    bore = disc(4.1, 6)
    holes = [
        shapely.affinity.translate(disc(3.2, 24), 11.5 * np.cos(a), 11.5 * np.sin(a))
        for a in np.arange(5) * 2.0 * np.pi / 5.0
    ]
    web = outline.difference(shapely.union_all([bore, *holes]))
    return stack((web, 0.0, 6.0), (disc(7.5, 48).difference(bore), 5.0, 9.0))


def spacer() -> Solid:
    """Return a hexagonal spacer, 30 mm across its corners, with a flange."""
    bore = disc(6.0, 48)
    return stack(
        (disc(20.0).difference(bore), 0.0, 3.0), (disc(15.0, 6).difference(bore), 2.0, 9.0)
    )


def tray() -> Solid:
    """Return a tray with three compartments, 46 x 36 x 10 mm."""
    outside = shapely.box(-23.0, -18.0, 23.0, 18.0).buffer(-4.0).buffer(4.0)
    walls = outside.difference(outside.buffer(-1.75))
    walls = walls.union(shapely.box(-0.87, -17.0, 0.87, 17.0)).union(
        shapely.box(0.0, -0.87, 22.0, 0.87)
    )
    return stack((outside, 0.0, 1.6), (walls, 1.4, 10.0))


def knob(lobes: int = 7) -> Solid:
    """Return a lobed knob, about 44 mm across, with a hexagonal pocket for an M8 nut."""
    turn = np.arange(lobes * 24) * 2.0 * np.pi / (lobes * 24)
    radius = 20.0 + 2.0 * np.cos(lobes * turn)
    grip = Polygon(radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)]))
    pocket, bore = disc(7.6, 6), disc(4.2, 32)
    return stack((grip.difference(bore), 0.0, 5.0), (grip.difference(pocket), 4.0, 9.0))


def nut() -> Solid:
    """Return a hexagonal nut, 26 mm across its corners and 8 mm high, without thread."""
    return stack((disc(13.0, 6).difference(disc(6.0, 48)), 0.0, 8.0))


def plate() -> Solid:
    """Return the parts of the two-head demo at their places on a 300 x 300 mm bed."""
    makers = {
        "bracket": bracket,
        "cup": cup,
        "gear": gear,
        "knob": knob,
        "spacer": spacer,
        "tray": tray,
    }
    return trimesh.util.concatenate(
        [makers[name]().apply_translation([*place, 0.0]) for name, place in PLACES.items()]
    )


def four_nuts() -> Solid:
    """Return four nuts in a square, 32 mm apart, as in the paper's first example."""
    corners = [(x, y) for x in (109.0, 141.0) for y in (89.0, 121.0)]
    return trimesh.util.concatenate([nut().apply_translation([x, y, 0.0]) for x, y in corners])


def slice_with_prusa_slicer(mesh: Path, output: Path) -> None:
    """Slice `mesh` where it stands and write gzipped G-code; needs ``prusa-slicer``."""
    x, y = trimesh.load_mesh(mesh).bounds.mean(axis=0)[:2]
    with tempfile.TemporaryDirectory() as folder:
        sliced = Path(folder) / "sliced.gcode"
        call = ["prusa-slicer", "-g", "--load", str(SLICER_OPTIONS), "--dont-arrange"]
        call += ["--center", f"{x:.3f},{y:.3f}", "-o", str(sliced), str(mesh)]
        subprocess.run(call, check=True, stdout=subprocess.DEVNULL)
        output.write_bytes(gzip.compress(sliced.read_bytes(), 9, mtime=0))


def main() -> None:
    """Write the meshes, and the G-code when asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slice", action="store_true", help="also call prusa-slicer")
    wanted = parser.parse_args()
    for name, make in (("plate", plate), ("four_nuts", four_nuts)):
        mesh = SAMPLES / f"{name}.stl"
        make().export(mesh)
        if wanted.slice:
            slice_with_prusa_slicer(mesh, SAMPLES / f"{name}.gcode.gz")


if __name__ == "__main__":
    main()
