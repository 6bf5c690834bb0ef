"""One name stands for one thing: a reader who looks for a class finds that class alone."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("agents", "decmcts", "sim")


def modules() -> Iterator[tuple[str, ast.Module]]:
    """Yield the files of the packages, parsed."""
    for path in sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py")):
        yield path.relative_to(ROOT).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def classes() -> dict[str, list[str]]:
    """Return the names of all classes, without leading underscores, with the files of each."""
    found = defaultdict(list)
    for file, module in modules():
        for node in ast.walk(module):
            if isinstance(node, ast.ClassDef):
                found[node.name.lstrip("_")].append(file)
    return found


def aliases() -> dict[str, list[str]]:
    """Return the names of types that are no classes of their own, with the files of each."""
    found = defaultdict(list)
    for file, module in modules():
        for node in module.body:
            target = node.targets[0] if isinstance(node, ast.Assign) else None
            name = target.id.lstrip("_") if isinstance(target, ast.Name) else ""
            if name[:1].isupper() and not name.isupper():
                found[name].append(file)
    return found


def test_no_name_stands_for_two_classes():
    """Whoever reads `Beads` in an annotation must not have to look which of several it is."""
    found = classes()
    assert len(found) > 400
    assert {name: files for name, files in found.items() if len(files) > 1} == {}


def test_no_class_has_the_name_of_another_type():
    """A name of a tuple or a function's type is read in annotations too."""
    found, others = classes(), aliases()
    assert len(others) > 40
    assert {name: [*found[name], *others[name]] for name in found.keys() & others.keys()} == {}
