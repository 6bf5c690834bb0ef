"""Equal seeds and equal messages give equal plans, whatever version of Python runs them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.team.digest_of_a_plan import SEEDS, digest

PROGRAM = Path(__file__).with_name("digest_of_a_plan.py")
ROOT = Path(__file__).resolve().parents[2]
OTHER = os.environ.get("DECMCTS_OTHER_PYTHON", "")


def digests(python: str) -> list[str]:
    """Return what the program prints, in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [python, str(PROGRAM)], capture_output=True, text=True, env=environment, timeout=900
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split("\n")


@pytest.mark.long
def test_two_processes_plan_the_same() -> None:
    """Nothing of a process (hash seeds, addresses) may come into a plan."""
    here = [digest(seed) for seed in SEEDS]
    assert len(set(here)) == 3 and digests(sys.executable) == [*here, ""]


@pytest.mark.slow
@pytest.mark.skipif(not OTHER, reason="DECMCTS_OTHER_PYTHON names no other interpreter")
def test_another_version_of_python_plans_the_same() -> None:
    """Hosts of one team need not run the same Python; their digests are what they compare."""
    version = [OTHER, "-c", "import sys; print(sys.version)"]
    said = subprocess.run(version, capture_output=True, text=True, check=True).stdout.strip()
    assert said != sys.version, "DECMCTS_OTHER_PYTHON is the same version"
    assert digests(OTHER) == digests(sys.executable)
