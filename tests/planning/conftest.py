"""Heads plan in this process: what is tested here is done around them."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def planned_here(agents_here: None) -> None:
    """Start no agents; tests/integration does."""
