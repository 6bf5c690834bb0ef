"""The program runs on the newest Python that the machine has, with what is newest for it.

Newer Pythons get newer numpy, and one of these had stated its types otherwise than the one before.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.prints import slab

ROOT = Path(__file__).resolve().parents[2]
NEWER = ("3.14", "3.13", "3.12")


def newest() -> Path | None:
    """Return the newest Python of the machine: on the path, or one of pyenv's."""
    beside = Path(sys.base_prefix).parent  # of pyenv, where this one is of pyenv
    for version in NEWER:
        found = [shutil.which(f"python{version}"), *beside.glob(f"{version}.*/bin/python")]
        for python in filter(None, found):
            said = subprocess.run([python, "--version"], capture_output=True, text=True)
            if re.match(rf"Python {re.escape(version)}\.", said.stdout):
                return Path(python)
    return None


@pytest.mark.long
def test_it_plans_judges_and_simulates_there(tmp_path: Path) -> None:
    """In plain Python, as nothing is compiled for that interpreter yet."""
    if (python := newest()) is None:
        pytest.skip(f"no Python of {', '.join(NEWER)} is here")
    home, source = tmp_path / "env", slab(tmp_path / "in.gcode", wide=200.0, deep=4.0, layers=2)
    own = home / "bin" / "python"
    if subprocess.run([python, "-m", "venv", home], capture_output=True).returncode:
        pytest.skip(f"{python} makes no environments")
    install = [own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    done = subprocess.run([*install, "--no-compile", str(ROOT)], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"{python} has not all packages: {done.stderr.strip().splitlines()[-1]}")
    lines = [
        f"plan {source} -o {tmp_path}/out.gcode --machine mk4s --time-limit 0.5",
        f"verify {tmp_path}/out.gcode --source {source} --machine mk4s",
        f"launch {source} -o {tmp_path}/two --plan {tmp_path}/plan.json --time-limit 1",
        f"verify {tmp_path}/plan.json --source {source}",
        f"simulate {tmp_path}/plan.json",
    ]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    environment.pop("PYTHONPATH", None)
    for line in lines:
        words = [own, "-m", "decmcts.cli", "--debug", *line.split()]
        done = subprocess.run(
            words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300
        )
        assert done.returncode == 0, (line, done.stderr)
