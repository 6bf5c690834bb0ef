"""Digests for people: two that differ are shown where they differ."""

from __future__ import annotations

SHOWN = 12
"""Characters of a digest that are shown."""


def apart(one: str, other: str) -> tuple[str, str]:
    """Return a part of each of two digests, with the place in it where they first differ.

    Examples
    --------
    >>> apart("ab" * 16, "cd" * 16)
    ('abababababab', 'cdcdcdcdcdcd')
    >>> apart("ab" * 10 + "01", "ab" * 10 + "02")
    ('…babababab01', '…babababab02')
    """
    pairs = zip(one, other, strict=False)
    first = next((at for at, (a, b) in enumerate(pairs) if a != b), min(len(one), len(other)))
    if first < SHOWN:
        return one[:SHOWN], other[:SHOWN]
    end = min(first + 2, max(len(one), len(other)))
    begin = end - SHOWN + 1
    return f"…{one[begin:end]}", f"…{other[begin:end]}"
