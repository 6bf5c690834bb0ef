"""What a file lays down without going across the bed, by the judge's own account."""

from __future__ import annotations

import numpy as np
import pytest

from sim.content.laid import laying_rows, lying

LOW, HIGH = (0.0, 0.0, 0.3), (0.0, 0.0, 6.0)
BEAD = [((5.0, 0.0, 0.3), 0.5)]
AWAY = [((0.0, 9.0, 0.3), 0.0)]
ON = [((50.0, 9.0, 0.3), 0.0)]


def rows_of(moves, *, tool=None, known=()):
    """Return the laying ones of (place, filament) moves between a bead and another."""
    moves = [(LOW, 0.0), *BEAD, *AWAY, *moves, *ON, *BEAD]
    n = len(moves)
    points = np.array([LOW, *(to for to, _ in moves)])
    tools = np.zeros(n, np.int64)
    tools[3 : n - 2] = 0 if tool is None else tool
    is_known = np.isin(np.arange(n), [k + 3 for k in known])
    rows = laying_rows(points, np.array([e for _, e in moves]), tools, is_known).tolist()
    assert rows[0] == 1 and rows[-1] == n - 1
    return [k - 3 for k in rows[1:-1]]


def test_what_is_pushed_on_the_spot_lies_there():
    """Whatever the reader made of it: a judge that does not count dots lets them vanish."""
    assert rows_of([(AWAY[0][0], 1.5)]) == [0]


def test_a_push_while_the_nozzle_climbs_lies_there():
    assert rows_of([((0.0, 9.0, 6.0), 1.2)]) == [0]


@pytest.mark.parametrize("back", [[0.8], [0.5, 0.3], [0.8, 0.1], [0.9]])
def test_what_pays_back_a_retraction_does_not(back):
    """As slicers do before a bead, and sometimes before one more travel."""
    spot = AWAY[0][0]
    assert rows_of([(spot, -0.8), *((spot, e) for e in back)]) == ([2] if back[1:] == [0.1] else [])


def test_only_what_goes_beyond_a_retraction_counts():
    assert rows_of([(AWAY[0][0], -0.8), (AWAY[0][0], 2.3)]) == [1]


def test_what_a_bead_follows_at_once_is_that_beads_begin():
    """A restart distance moves with its bead; the book of filament keeps it."""
    start = (0.0, 20.0, 0.3)
    ending = [(start, 0.0), (start, 1.5), ((5.0, 20.0, 0.3), 0.5)]
    assert rows_of(ending) == [2]
    assert rows_of(ending, known=[1]) == [1, 2]  # but where a file parts the two


def test_another_tools_pushes_are_not_the_prints():
    """A nozzle is loaded between two changes of tools: lines that stand as they are."""
    assert rows_of([(AWAY[0][0], 30.0)], tool=1) == []


def test_each_tool_has_an_account_of_its_own():
    """What one has retracted another does not pay back."""
    beyond = lying(np.array([1.0, -2.0, 2.0, 2.0, 0.5]), np.array([0, 1, 0, 1, 1]))
    assert beyond.tolist() == pytest.approx([1.0, -2.0, 2.0, 0.0, 0.5])
