"""What silence means: a stopped process has no pulse, a long round has one."""

from __future__ import annotations

from agents.launching.hearing import Hearing
from agents.launching.limits import GRACE_S, HUNG_S


def test_a_pulse_is_no_word() -> None:
    """It says that the process runs, not that it plans."""
    hearing = Hearing()
    assert not hearing.was_heard(0) and not hearing.is_hung(0, 1e9)
    hearing.feel(0, 5.0)
    assert hearing.was_heard(0) and hearing.speaks(0, 5.0 + GRACE_S)
    assert not hearing.heard_since(0, 1.0)
    assert not hearing.is_hung(0, 5.0 + HUNG_S) and hearing.is_hung(0, 5.1 + HUNG_S)


def test_one_pause_makes_no_long_round() -> None:
    """Else a head that stood still once would be waited for much longer afterwards."""
    hearing = Hearing()
    for now in (0.0, 0.5, 1.0, 8.0, 8.5):
        hearing.hear(0, now, plans=True)
    assert hearing.longest_round_s() == 0.5
    hearing.hear(0, 12.5, plans=True)
    assert hearing.longest_round_s() == 4.0
