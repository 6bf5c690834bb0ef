"""The rooms of the code: small enough to look over, and each named in ARCHITECTURE."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = sorted(
    folder.parent
    for package in ("decmcts", "agents", "sim")
    for folder in (ROOT / package).rglob("__init__.py")
)
MOST_FILES = 12


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_a_room_has_at_most_a_dozen_files(room):
    assert len([p for p in room.glob("*.py") if p.name != "__init__.py"]) <= MOST_FILES


def test_the_tables_of_rooms_name_what_is_there():
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    tables = re.findall(r"^\*\*[^`\n]*`([\w/]+)`\*\*\n\n((?:\|.*\n)+)", text, re.MULTILINE)
    assert len(tables) == 8
    for folder, table in tables:
        named = re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)
        assert sorted(named) == [room.name for room in ROOMS if room.parent == ROOT / folder]
