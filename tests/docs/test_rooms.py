"""The rooms of the code: each is named in ARCHITECTURE."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROOMS = sorted(
    folder.parent
    for package in ("decmcts", "agents", "sim")
    for folder in (ROOT / package).rglob("__init__.py")
)


def test_the_tables_of_rooms_name_what_is_there():
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    tables = re.findall(r"^\*\*[^`\n]*`([\w/]+)`\*\*\n\n((?:\|.*\n)+)", text, re.MULTILINE)
    assert len(tables) == 8
    for folder, table in tables:
        named = re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)
        assert sorted(named) == [room.name for room in ROOMS if room.parent == ROOT / folder]
