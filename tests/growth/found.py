"""Every regular expression of the packages, and whether it looks through a text or at its begin."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("decmcts", "agents", "sim")
LOOKS_THROUGH = frozenset({"search", "findall", "finditer", "sub", "subn", "split"})
METHODS = LOOKS_THROUGH | {"match", "fullmatch"}
FLAGS = {"I": re.I, "IGNORECASE": re.I, "M": re.M, "MULTILINE": re.M, "S": re.S, "A": re.A}


@dataclass(frozen=True)
class Use:
    """One pattern and one way it is used."""

    where: str
    pattern: str | bytes
    flags: int
    method: str

    @property
    def looks_through(self) -> bool:
        return self.method in LOOKS_THROUGH


def uses() -> list[Use]:
    """Return all of them, each pattern once for each kind of use."""
    methods = _methods_by_name()
    found: dict[tuple[str | bytes, int, str], Use] = {}
    for path in _sources():
        for use in [*_named(path, methods), *_inline(path)]:
            kind = "search" if use.looks_through else use.method
            found.setdefault((use.pattern, use.flags, kind), use)
    return list(found.values())


def _sources() -> Iterator[Path]:
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if "experiments" not in path.parts and "re." in path.read_text(encoding="utf-8"):
                yield path


def _methods_by_name() -> dict[str, set[str]]:
    """Return what is called on each name that a compiled pattern may have, in all packages."""
    found: dict[str, set[str]] = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Attribute) and node.attr in METHODS:
                    name = node.value.id if isinstance(node.value, ast.Name) else ""
                    found.setdefault(name, set()).add(node.attr)
    return found


def _named(path: Path, methods: dict[str, set[str]]) -> Iterator[Use]:
    """Yield patterns that a module keeps; those handed on elsewhere count as looking through."""
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    if path.name in ("__init__.py", "__main__.py"):
        return
    for key, value in vars(importlib.import_module(name)).items():
        kept = value.values() if isinstance(value, dict) else [value]
        for pattern in (each for each in kept if isinstance(each, re.Pattern)):
            for method in sorted(methods.get(key, {"search"})):
                yield Use(f"{name}.{key}", pattern.pattern, pattern.flags & ~re.U, method)


def _inline(path: Path) -> Iterator[Use]:
    """Yield patterns that stand where they are used, as far as they are literals."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        owner, method = node.func.value, node.func.attr
        if not (isinstance(owner, ast.Name) and owner.id == "re" and method in METHODS):
            continue
        given = node.args[0]
        if isinstance(given, ast.Constant) and isinstance(given.value, str | bytes):
            at = f"{path.relative_to(ROOT)}:{node.lineno}"
            yield Use(at, given.value, _flags_of(node), method)


def _flags_of(call: ast.Call) -> int:
    names = {n.attr for part in [*call.args[1:], *call.keywords] for n in ast.walk(part)
             if isinstance(n, ast.Attribute)}  # fmt: skip
    return sum(FLAGS.get(name, 0) for name in names)
