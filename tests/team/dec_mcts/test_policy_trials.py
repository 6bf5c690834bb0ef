"""Which policies are tried first: some of all kinds by all heads, then what is like the best."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.team.dec_mcts.policy_trials import NEAR, POINTS, PolicyTrials, beside
from decmcts.team.engine.plans import POLICIES, TUNED


def _run(trials: PolicyTrials, of: list[float] | np.ndarray) -> list[int]:
    """Try policies until there are none; returns them in turn."""
    tried = []
    while (row := trials.next()) is not None:
        tried.append(row)
        trials.note(row, float(of[row]))
    return tried


@pytest.mark.parametrize("heads", [1, 2, 5])
def test_the_heads_share_the_first_ones_out(heads: int) -> None:
    """No two heads try the same policy before they know which are good."""
    tries = 30
    everyones = [PolicyTrials(r, heads, tries=tries) for r in range(heads)]
    first = [row for trials in everyones for row in trials._open]
    assert len(first) == len(set(first)) == 10
    assert all(len(_run(trials, np.ones(len(POLICIES)))) == tries // heads for trials in everyones)


def test_the_first_ones_are_of_all_kinds() -> None:
    """Tuned ones, which are good on many prints, and others in turn."""
    first = PolicyTrials(0, 1, tries=48)._open
    assert sum(row < TUNED for row in first) == sum(row >= TUNED for row in first) == 8


def test_then_it_tries_what_is_like_the_best() -> None:
    """A few trials find a good policy where like policies make like plans."""
    at = POINTS
    makespans = np.linalg.norm(at - at[300], axis=1)
    trials = PolicyTrials(0, 1, tries=48)
    tried = _run(trials, makespans)
    assert len(set(tried)) == 48
    random = np.median(np.sort(makespans)[: len(makespans) // 48])
    assert makespans[trials.best(1)[0]] < random
    assert np.mean(makespans[tried[16:]]) < 0.8 * np.mean(makespans[tried[:16]])


@pytest.mark.parametrize(("tries", "heads"), [(1, 1), (1, 4), (3, 2), (512, 2), (512, 8)])
def test_each_head_tries_one_at_least_and_none_twice(tries: int, heads: int) -> None:
    """Also where there are more heads than tries."""
    for turn in range(heads):
        tried = _run(PolicyTrials(turn, heads, tries=tries), np.arange(512.0))
        assert len(tried) == len(set(tried)) == max(1, round(tries / heads))


def test_weights_count_by_their_ratio() -> None:
    """Twice a small weight is as far as twice a large one; nothing is infinitely far."""
    at = POINTS
    assert at.shape == (len(POLICIES), 6) and np.isfinite(at).all()
    step = np.log10(POLICIES[3, 0] / POLICIES[1, 0]) / 2.5
    assert at[3, 0] - at[1, 0] == pytest.approx(step)


def test_most_moves_are_to_near_policies_some_to_any() -> None:
    """Refines a good policy, but does not stay with it for ever."""
    rng, at = np.random.default_rng(0), POINTS
    found = np.array([beside(100, rng) for _ in range(500)])
    order = np.argsort(np.linalg.norm(at - at[100], axis=1), kind="stable")
    near = np.isin(found, order[1 : NEAR + 1])
    assert 0.6 < near.mean() < 0.8 and len(set(found.tolist())) > 3 * NEAR
