"""What `pip install` and `pipx install` put on a computer."""

from __future__ import annotations

import subprocess
import sys
from email import message_from_bytes
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("agents", "decmcts", "sim")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> ZipFile:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (path,) = folder.iterdir()
    return ZipFile(path)


@pytest.mark.slow
def test_nothing_else_is_installed_at_top_level(wheel):
    """A package named `examples` or `tests` would shadow another project's."""
    tops = {name.split("/")[0] for name in wheel.namelist()}
    assert {name for name in tops if not name.endswith(".dist-info")} == set(PACKAGES)


@pytest.mark.slow
def test_wheel_holds_every_file_of_the_packages(wheel):
    """Plates of the demo, machine presets and py.typed are there, and no file of a cache."""
    held = {name for name in wheel.namelist() if name.split("/")[0] in PACKAGES}
    here = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert held == here
    assert {f"{package}/py.typed" for package in PACKAGES} <= held
    assert "decmcts/samples/plate.gcode.gz" in held
    assert "decmcts/machines/dual-gantry.toml" in held


@pytest.mark.slow
def test_program_and_license_come_with_it(wheel):
    """`pipx install` puts `decmcts` on the path and nothing besides."""
    (folder,) = {n.split("/")[0] for n in wheel.namelist() if ".dist-info/" in n}
    points = wheel.read(f"{folder}/entry_points.txt").decode()
    assert points.split() == ["[console_scripts]", "decmcts", "=", "decmcts.cli:main"]
    about = message_from_bytes(wheel.read(f"{folder}/METADATA"))
    assert about["License-Expression"] == "Apache-2.0"
    assert f"{folder}/licenses/LICENSE" in wheel.namelist()
