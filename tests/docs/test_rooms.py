"""ARCHITECTURE names each room of the code, and is short enough to be read."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("agents", "decmcts", "sim")


def rooms() -> list[str]:
    """Return the folders of code below the packages."""
    found = [folder for name in PACKAGES for folder in (ROOT / name).rglob("__init__.py")]
    named = [folder.parent.relative_to(ROOT).as_posix() for folder in found]
    return sorted(name for name in named if name not in PACKAGES)


def test_the_table_of_rooms_names_what_is_there():
    """A newcomer looks for the place of a change there."""
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    table = re.search(r"^\| room \| holds \|\n\|---\|---\|\n((?:\|.*\n)+)", text, re.MULTILINE)
    assert table
    assert sorted(re.findall(r"^\| `([\w/]+)` \|", table[1], re.MULTILINE)) == rooms()
