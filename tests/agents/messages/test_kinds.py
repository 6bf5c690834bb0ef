"""Digests that differ are shown where they do."""

from __future__ import annotations

import pytest

from agents.messages.kinds import apart


@pytest.mark.parametrize("at", [0, 5, 11, 12, 30, 62, 63])
def test_two_that_differ_look_different(at: int) -> None:
    """Twelve like characters on both sides tell a user nothing."""
    one = "0" * 64
    other = one[:at] + "f" + one[at + 1 :]
    shown, against = apart(one, other)
    assert shown != against
    assert len(shown) == len(against) == 12


def test_nothing_is_shown_as_nothing() -> None:
    """A plan that resolves to none has no digest."""
    assert apart("ab" * 16, "") == ("abababababab", "")
