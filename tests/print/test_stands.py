"""Where heads stand idle, and when they are heated again."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.print.machine import Idle
from decmcts.print.plan import ActionKind, HeadActions
from decmcts.print.stands import SAFE, Stand, primed_before, standby_in, stands_of

PRINT, TRAVEL, WAIT = ActionKind.PRINT, ActionKind.TRAVEL, ActionKind.WAIT
USUAL = Idle()


def actions(
    rows: list[tuple[int, int, float, float]], edges: dict[int, list[float]]
) -> HeadActions:
    """Rows of kind, contour, begin and end; `edges` are lags behind head 1 by the action."""
    kind, contour, begin, end = (np.array(column) for column in zip(*rows, strict=True))
    n, lags = len(rows), [edges.get(k, []) for k in range(len(rows))]
    flat = np.array([lag for each in lags for lag in each], np.float64)
    m = len(flat)
    return HeadActions(
        "a", kind.astype(np.int8), contour.astype(np.int32), np.zeros(n, np.bool_),
        np.zeros(n, np.int32), np.arange(0, 2 * n + 1, 2), np.zeros((2 * n, 3)),
        begin.astype(float), end.astype(float),
        np.concatenate([[0], np.cumsum([len(each) for each in lags])]).astype(np.int64),
        np.ones(m, np.int32), np.zeros(m, np.int32), np.full(m, -1, np.int32), flat,
    )  # fmt: skip


def test_a_head_stands_where_its_next_action_begins_late() -> None:
    """At its park before the first; not for 9 s; not behind its last bead."""
    made = actions(
        [(TRAVEL, -1, 12, 13), (PRINT, 0, 13, 20), (TRAVEL, -1, 29, 30), (PRINT, 1, 30, 31),
         (PRINT, 2, 61, 70), (TRAVEL, -1, 100, 101)],
        {},
    )  # fmt: skip
    found = stands_of(made, 0, np.zeros(3, np.int32), 10.0)
    assert found == {0: Stand(0, 12.0, 0.0), 4: Stand(4, 30.0, 0.0)}
    assert primed_before(made, 10.0).tolist() == [False, True, False, True, True, False]


def test_a_rest_counts_with_what_it_waits_for() -> None:
    """15 s for the other head, of which 4 s are a lag, and 20 s of rest: 24 s are known."""
    made = actions([(PRINT, 0, 0, 5), (WAIT, -1, 20, 40), (PRINT, 1, 40, 41)], {1: [4.0, 1.0]})
    assert stands_of(made, 0, np.zeros(2, np.int32), 10.0) == {1: Stand(1, 35.0, 24.0)}


@pytest.mark.parametrize("epoch", [[0, 1], [1, 1]])
def test_the_sources_own_lines_part_beads(epoch: list[int]) -> None:
    """They set filament and heat; so where they stand a head does nothing by itself."""
    made = actions([(PRINT, 0, 0, 5), (PRINT, 1, 50, 51)], {})
    here = stands_of(made, 0, np.array(epoch, np.int32), 10.0)
    assert set(here) == ({1} if epoch[0] == epoch[1] else set())


def test_it_is_heated_before_what_it_waits_for_comes() -> None:
    """A tenth of the wait is left when it is hot."""
    rests = standby_in(Stand(0, 100.0, 0.0), 40.0, USUAL)
    assert rests is not None and not rests.behind
    assert rests.cool_s + rests.heat_s == pytest.approx(SAFE * 100.0)
    assert rests.heat_s == pytest.approx(20.0)


def test_in_a_rest_of_known_length_it_is_heated_at_its_end() -> None:
    """It dwells for the rest and no longer."""
    rests = standby_in(Stand(0, 100.0, 80.0), 40.0, USUAL)
    assert rests is not None and rests.behind
    assert rests.cool_s + rests.heat_s == pytest.approx(80.0)


@pytest.mark.parametrize("behind_s", np.linspace(0.0, 100.0, 41).tolist())
def test_nobody_waits_longer_than_planned(behind_s: float) -> None:
    """Whatever part of a stand is known: not before the signal, and not behind it."""
    rests = standby_in(Stand(0, 100.0, behind_s), 40.0, USUAL)
    assert rests is not None and rests.cool_s > 0.0
    if rests.behind:
        assert rests.cool_s + rests.heat_s <= behind_s + 1e-9
    else:
        assert rests.cool_s <= 100.0 - behind_s
        assert rests.cool_s + rests.heat_s <= 100.0


@pytest.mark.parametrize(("seconds", "degrees"), [(30.0, 40.0), (100.0, 0.0), (100.0, -20.0)])
def test_short_waits_and_higher_temperatures_cool_nothing(seconds: float, degrees: float) -> None:
    """Less than 10 s would be left at standby; and standby is never hotter than the print."""
    assert standby_in(Stand(0, seconds, 0.0), degrees, USUAL) is None
