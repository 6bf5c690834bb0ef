"""Other distributions, or a user's own files, may have the names of our packages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
@pytest.mark.parametrize("name", ["agents", "sim"])
def test_a_package_that_is_not_ours_is_named(name: str, tmp_path: Path) -> None:
    """An AttributeError or a missing module from deep inside would not say why."""
    (tmp_path / f"{name}.py").touch()
    code = [sys.executable, "-c", "import sys; sys.path.insert(0, '.'); import decmcts"]
    done = subprocess.run(code, cwd=tmp_path, capture_output=True, text=True, check=False)
    said = done.stderr.splitlines()[-1]
    assert said.startswith("ImportError") and f"{name}.py" in said and "environment" in said
