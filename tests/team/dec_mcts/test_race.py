"""Which policies are tried first: some of all kinds by all heads, then what is like the best."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.team.dec_mcts.race import Race
from decmcts.team.engine.plans import POLICIES, TUNED
from decmcts.team.engine.policy_space import places


def _run(race: Race, of: list[float] | np.ndarray) -> list[int]:
    """Try policies until the race has none; returns them in turn."""
    tried = []
    while (row := race.next()) is not None:
        tried.append(row)
        race.note(row, float(of[row]))
    return tried


@pytest.mark.parametrize("heads", [1, 2, 5])
def test_the_heads_share_the_first_ones_out(heads: int) -> None:
    """No two heads try the same policy before they know which are good."""
    tries = 30
    races = [Race(r, heads, policies=len(POLICIES), tries=tries) for r in range(heads)]
    first = [row for race in races for row in race._open]
    assert len(first) == len(set(first)) == 10
    assert all(len(_run(race, np.ones(len(POLICIES)))) == tries // heads for race in races)


def test_the_first_ones_are_of_all_kinds() -> None:
    """Tuned ones, which are good on many prints, and others in turn."""
    first = Race(0, 1, policies=len(POLICIES), tries=48)._open
    assert sum(row < TUNED for row in first) == sum(row >= TUNED for row in first) == 8


def test_then_it_tries_what_is_like_the_best() -> None:
    """A cheap race finds a good policy where like policies make like plans."""
    at = places(len(POLICIES))
    makespans = np.linalg.norm(at - at[300], axis=1)
    race = Race(0, 1, policies=len(POLICIES), tries=48)
    tried = _run(race, makespans)
    assert len(set(tried)) == 48
    random = np.median(np.sort(makespans)[: len(makespans) // 48])
    assert makespans[race.best(1)[0]] < random
    assert np.mean(makespans[tried[16:]]) < 0.8 * np.mean(makespans[tried[:16]])


@pytest.mark.parametrize(("policies", "heads"), [(1, 1), (1, 4), (3, 2), (3, 8), (20, 2)])
def test_each_head_tries_one_at_least_and_none_twice(policies: int, heads: int) -> None:
    """Also where there are more heads than policies."""
    for turn in range(heads):
        race = Race(turn, heads, policies=policies, tries=512)
        tried = _run(race, np.arange(512.0))
        assert 1 <= len(tried) == len(set(tried)) <= policies and max(tried) < policies
