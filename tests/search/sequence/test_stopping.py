"""When a search ends: whatever comes first, and what planners pace themselves by."""

from __future__ import annotations

import pytest

from decmcts.search.sequence.stopping import Stopping


def test_it_ends_at_the_first_of_its_limits() -> None:
    """None stands for no limit; there is no number that does."""
    both = Stopping(seconds=2.0, iterations=10)
    assert [both.ends(s, i) for s, i in ((1.9, 9), (2.0, 0), (0.0, 10))] == [False, True, True]
    assert not Stopping(seconds=2.0).ends(1.9, 10**15)
    assert not Stopping(iterations=10).ends(1e15, 9)


def test_whoever_asks_ends_it() -> None:
    """Ctrl-C ends any search."""
    asked = iter([False, True])
    stopping = Stopping(seconds=2.0, asked=lambda: next(asked))
    assert [stopping.ends(0.0, 0) for _ in range(2)] == [False, True]
    assert Stopping(seconds=2.0, asked=lambda: True).is_asked()
    assert not Stopping(seconds=0.0).is_asked()


def test_iterations_keep_the_pace_where_they_are_limited() -> None:
    """Else equal seeds would not give equal results."""
    assert Stopping(seconds=8.0).spent(2.0, 99) == 0.25
    assert Stopping(seconds=8.0, iterations=10).spent(2.0, 5) == 0.5
    assert Stopping(seconds=8.0).share_of(2.0) == 0.25
    assert Stopping(seconds=8.0, iterations=10).share_of(2.0) == 0.0
    assert Stopping(seconds=0.0).spent(0.0, 0) == Stopping(iterations=0).spent(0.0, 0) == 1.0


def test_a_part_of_a_search_has_a_part_of_its_seconds() -> None:
    """Where seconds have no limit a part has none either, unless it is given one."""
    both, endless = Stopping(seconds=8.0, iterations=10), Stopping(iterations=10)
    assert both.shortened(0.25) == Stopping(seconds=2.0, iterations=10)
    assert endless.shortened(0.25) == endless
    assert [each.seconds_up_to(3.0) for each in (both, both.shortened(0.25), endless)] == [3, 2, 3]


@pytest.mark.parametrize(
    ("seconds", "iterations", "message"),
    [
        (None, None, "seconds or iterations"),
        (-1.0, None, "limit of -1.0 s, must be finite and at least 0"),
        (float("nan"), 5, "limit of nan s"),
        (float("inf"), None, "limit of inf s"),
        (1.0, -5, "limit of -5 iterations, must be at least 0"),
    ],
)
def test_bad_limits_are_named(seconds: float | None, iterations: int | None, message: str) -> None:
    """A typing error should not search for a minute, nor for ever."""
    with pytest.raises(ValueError, match=message):
        Stopping(seconds, iterations)
