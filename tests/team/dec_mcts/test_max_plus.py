"""Max-plus along a chain of heads against all combinations."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from decmcts.team.dec_mcts.max_plus import PairValues

PLANS = [np.array([k], np.int32) for k in range(4)]


def _said(chosen: dict[int, np.ndarray]) -> tuple[int, ...]:
    return tuple(int(chosen[r][0]) for r in sorted(chosen))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("heads", [2, 3, 5])
def test_it_is_the_best_sum_over_neighbours(seed: int, heads: int) -> None:
    """On a chain dynamic programming is exact: the oracle tries all combinations."""
    rng = np.random.default_rng(seed)
    values = PairValues(range(heads))
    for _ in range(40):
        values.note({r: PLANS[int(rng.integers(3))] for r in range(heads)}, float(rng.random()))
    pairs = [values._pairs(r, PLANS[:3], PLANS[:3]) for r in range(heads - 1)]
    best = max(
        itertools.product(range(3), repeat=heads),
        key=lambda row: sum(pairs[r][row[r], row[r + 1]] for r in range(heads - 1)),
    )
    assert _said(values.choose(dict.fromkeys(range(heads), PLANS[:3]))) == best


def test_two_heads_take_the_best_pair_seen_once_all_are_seen() -> None:
    """A pair of two heads is the joint plan: nothing is left to be guessed."""
    values = PairValues((1, 0))
    for i, j in itertools.product(range(4), repeat=2):
        values.note({0: PLANS[i], 1: PLANS[j]}, 1.0 if (i, j) == (2, 3) else 0.1 * i)
    assert _said(values.choose({0: PLANS, 1: PLANS})) == (2, 3)


def test_what_was_never_seen_is_tried() -> None:
    """Optimism: a pair of plans that did well apart is tried before what is known to be worse."""
    values = PairValues((0, 1))
    values.note({0: PLANS[1], 1: PLANS[0]}, 0.9)
    values.note({0: PLANS[0], 1: PLANS[1]}, 0.9)
    values.note({0: PLANS[0], 1: PLANS[0]}, 0.1)
    assert _said(values.choose({0: PLANS[:2], 1: PLANS[:2]})) == (1, 1)


def test_before_anything_is_known_it_takes_the_first() -> None:
    """And of one head there is no pair."""
    assert _said(PairValues((0, 1)).choose({0: PLANS, 1: PLANS})) == (0, 0)
    assert _said(PairValues((3,)).choose({3: PLANS})) == (0,)
