"""Kernels stand beside their callers, in files that know nothing else of the project."""

from __future__ import annotations

import ast
from pathlib import Path

import decmcts

ROOT = Path(decmcts.__file__).parent
KERNELS = sorted(ROOT.rglob("*_kernels.py"))
DECORATORS = {"kernel", "inlined", "apart"}


def imported(path: Path) -> list[str]:
    """Return what of the project a file imports."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [name.name for name in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            found.append(module)
            if (ROOT.parent / module.replace(".", "/")).is_dir():
                found += [f"{module}.{name.name}" for name in node.names]
    return [name for name in found if name.startswith((".", "decmcts", "agents", "sim"))]


def decorated(path: Path) -> list[str]:
    """Return the functions of a file that are kernels."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [
        node.name
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        and any(isinstance(d, ast.Name) and d.id in DECORATORS for d in node.decorator_list)
    ]


def test_kernels_import_kernels_and_nothing_else_of_the_project():
    """Their machine code is kept by a digest of these files alone: nothing else may change it."""
    assert len(KERNELS) > 40
    others = {
        path.name: [name for name in imported(path)
                    if name not in ("decmcts.compiled", "decmcts.arrays")
                    and not name.endswith("_kernels")]
        for path in KERNELS
    }  # fmt: skip
    assert {name: what for name, what in others.items() if what} == {}


def test_kernels_stand_in_no_other_file():
    """A kernel elsewhere would outlive a change of what it calls."""
    elsewhere = [path for path in ROOT.rglob("*.py") if path not in KERNELS and decorated(path)]
    assert elsewhere == []


def test_the_judge_calls_no_kernel_of_the_planner():
    """It shares data types with the planner, no algorithm."""
    judge = [path for path in (ROOT.parent / "sim").rglob("*.py")
             if path.relative_to(ROOT.parent / "sim").parts[0]
             not in ("pictures", "controllers", "experiments")]  # fmt: skip
    assert len(judge) > 30
    assert {path.name for path in judge for name in imported(path) if "_kernels" in name} == set()
