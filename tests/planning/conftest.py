"""Heads plan in this process: what is tested here is done around them."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def planned_here(agents_here: None) -> None:
    """Start no agents; tests/integration does."""


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give this process and its children an empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("DECMCTS_TEMPORARY_CACHE", raising=False)
    return tmp_path
