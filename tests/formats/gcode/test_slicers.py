"""Files fresh from the real slicers, where their Debian packages are installed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
import trimesh

from decmcts.formats.gcode import read_gcode

pytestmark = [pytest.mark.slicers, pytest.mark.slow]
CURA = Path("/usr/share/cura/resources/definitions")


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """Two small towers apart from each other, one file."""
    folder = tmp_path_factory.mktemp("part")
    one = trimesh.creation.box((12, 12, 3))
    two = trimesh.creation.cylinder(6, 3).apply_translation((30, 0, 0))
    path = folder / "part.stl"
    trimesh.util.concatenate([one, two]).export(path)
    return path


def run(name: str, *arguments: str, env: dict[str, str] | None = None) -> None:
    """Run a slicer; skip, saying so, where it is not installed."""
    if shutil.which(name) is None:
        pytest.skip(f"{name} is not installed (apt-get install slic3r prusa-slicer cura-engine)")
    done = subprocess.run(
        [name, *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, **(env or {})},
    )
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("tools", [1, 2])
@pytest.mark.parametrize("slicer", ["slic3r", "prusa-slicer"])
def test_slic3r_and_prusaslicer(part, tmp_path, again, slicer, tools, relative):
    """Absolute and relative E, one and two extruders, in two orders, loops begun elsewhere."""
    out = tmp_path / "a.gcode"
    words = ["--layer-height", "0.3", "-o", str(out)]
    words += ["--gcode-comments"] if slicer == "slic3r" else ["-g"]
    settings = ["nozzle_diameter = " + ",".join(["0.4"] * tools)]
    settings += ["filament_diameter = " + ",".join(["1.75"] * tools)]
    settings += [f"use_relative_e_distances = {int(relative)}"]
    settings += ["layer_gcode = G92 E0"] if relative else []
    settings += ["infill_extruder = 2", "solid_infill_extruder = 2"] if tools == 2 else []
    config = tmp_path / "c.ini"
    config.write_text("\n".join(settings) + "\n")
    words += ["--load", str(config)]
    run(slicer, *words, str(part))
    job, document = read_gcode(out)
    assert document.relative_e == relative
    assert sorted(set(job.contours.tool.tolist())) == list(range(tools))
    assert len(set(job.contours.role.tolist())) > 2
    again(job, document)
    again(job, document, seed=3, seams=True)


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("tools", [1, 2])
def test_cura(part, tmp_path, again, tools, relative):
    """CuraEngine with its own printer definition, loops begun elsewhere too."""
    out = tmp_path / "a.gcode"
    definition = CURA / (
        "ultimaker_original_dual.def.json" if tools == 2 else "fdmprinter.def.json"
    )
    if not definition.exists():
        pytest.skip(f"{definition} is absent: CuraEngine's Debian package brings no definitions")
    words = ["slice", "-j", str(definition), "-s", f"relative_extrusion={str(relative).lower()}"]
    words += ["-s", "roofing_layer_count=0", "-o", str(out), "-e0"]
    if tools == 2:
        words += ["-l", str(part), "-e1", "-s", "infill_extruder_nr=1"]
    run(
        "CuraEngine",
        *words,
        "-l",
        str(part),
        env={"CURA_ENGINE_SEARCH_PATH": f"{CURA}:{CURA.parent}/extruders"},
    )
    job, document = read_gcode(out)
    again(job, document)
    again(job, document, seed=3, seams=True)
