"""What silence means: a stopped process has no pulse, a long round has one."""

from __future__ import annotations

from agents.launching.liveness import GRACE_S, HUNG_S, Liveness


def test_a_pulse_is_no_word() -> None:
    """It says that the process runs, not that it plans."""
    liveness = Liveness()
    assert not liveness.was_alive(0) and not liveness.is_hung(0, 1e9)
    liveness.take_pulse(0, 5.0)
    assert liveness.was_alive(0) and liveness.is_alive(0, 5.0 + GRACE_S)
    assert not liveness.has_word_since(0, 1.0)
    assert not liveness.is_hung(0, 5.0 + HUNG_S) and liveness.is_hung(0, 5.1 + HUNG_S)


def test_one_pause_makes_no_long_round() -> None:
    """Else a head that stood still once would be waited for much longer afterwards."""
    liveness = Liveness()
    for now in (0.0, 0.5, 1.0, 8.0, 8.5):
        liveness.take_word(0, now, plans=True)
    assert liveness.longest_round_s() == 0.5
    liveness.take_word(0, 12.5, plans=True)
    assert liveness.longest_round_s() == 4.0
