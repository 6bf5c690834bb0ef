"""Bare problems of teams, small enough to write down."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from decmcts.formats.bare.qcsp import QcspProblem, read_qcsp


def problem_of(values: dict[str, Any]) -> QcspProblem:
    """Return the problem of a file with these fields."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "small.qcsp"
        path.write_text(json.dumps(values))
        return read_qcsp(path)
