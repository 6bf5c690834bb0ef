"""Lengths and places of machines, none larger than any printer has."""

from __future__ import annotations

from decmcts.formats.files.bounds import LARGEST_MM
from decmcts.formats.files.fields import Fields


def size(table: Fields, key: str, usual: float | None = None) -> float:
    """Return a length in mm, from 0."""
    return table.number(key, usual, least=0.0, most=LARGEST_MM)


def pair(table: Fields, key: str) -> tuple[float, float]:
    """Return a place on the bed, mm."""
    x, y = table.point(key, 2, most=LARGEST_MM)
    return x, y


def triple(table: Fields, key: str, *, most: float = LARGEST_MM) -> tuple[float, float, float]:
    """Return a place in space, mm, each coordinate up to `most` either way."""
    x, y, z = table.point(key, 3, most=most)
    return x, y, z
