"""One name stands for one thing: a reader who looks for a class finds that class alone."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("agents", "decmcts", "sim")


def classes() -> dict[str, list[str]]:
    """Return the names of all classes of the packages, with the files that define each."""
    found = defaultdict(list)
    for path in sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                found[node.name].append(path.relative_to(ROOT).as_posix())
    return found


def test_no_name_stands_for_two_classes():
    """Whoever reads `Beads` in an annotation must not have to look which of several it is."""
    found = classes()
    assert len(found) > 400  # of the packages, not of an empty folder
    assert {name: files for name, files in found.items() if len(files) > 1} == {}
