"""Strips of a layer: heads stay apart, take as long at each step, and share what they can."""

import numpy as np
import pytest

from decmcts.team.cutting.strips import Strips, strips_of_layer

NO_PRICE = np.zeros(299)


def seconds_of(strips: Strips, work: np.ndarray, price: np.ndarray) -> np.ndarray:
    """Return the seconds of each strip, cuts at both its edges counted, (heads, steps)."""
    places = np.arange(len(work) + 1)
    done = np.interp(np.stack([strips.begin, strips.end]), places, np.r_[0.0, np.cumsum(work)])
    cuts = np.interp(np.stack([strips.begin, strips.end]), places, np.r_[0.0, price, 0.0])
    return np.asarray(done[1] - done[0] + cuts.sum(axis=0))


@pytest.mark.parametrize("steps", [1, 2, 5])
def test_an_even_layer_is_shared_as_far_as_its_width_allows(steps: int) -> None:
    """Heads L apart share 2 n w of a width B, where (n + 1) w = B - L."""
    strips = strips_of_layer(np.ones(130), NO_PRICE[:129], 10.0, np.full(steps, 70.0), 2)
    w = 60.0 / (steps + 1)
    assert strips.shared_s == pytest.approx(steps * w, abs=1e-3)
    assert strips.seconds == pytest.approx(130.0 - steps * w, abs=1e-3)
    assert strips.begin[0, 0] == 10.0 and strips.end[1, -1] == 140.0


@pytest.mark.parametrize("heads", [2, 3])
def test_all_is_shared_where_the_layer_is_wide(heads: int) -> None:
    """Nothing is left between the territories."""
    strips = strips_of_layer(np.ones(300), NO_PRICE, 0.0, np.full(2, 40.0), heads)
    assert strips.seconds == pytest.approx(300.0 / heads, abs=1e-3)
    assert strips.begin[1:, 0] == pytest.approx(strips.end[:-1, -1], abs=1e-3)


@pytest.mark.parametrize("width", [100, 150, 220])
def test_strips_of_one_step_take_as_long_and_heads_stay_apart(width: int) -> None:
    """Wherever the work of a layer lies, and whatever cuts cost where."""
    random = np.random.default_rng(width)
    for _ in range(20):
        work, price = random.random(width) + 0.1, 0.3 * random.random(width - 1)
        apart = 60.0 + 4.0 * random.random(3)
        strips = strips_of_layer(work, price, 0.0, apart, 2)
        assert (strips.begin[1] - strips.end[0] >= apart - 1e-6).all()
        assert (strips.end >= strips.begin).all()
        assert strips.end[0, -1] <= strips.begin[1, 0] + 1e-6
        left, right = seconds_of(strips, work, price)
        assert left == pytest.approx(right, abs=0.75)  # a cut's price is not continuous
        assert strips.shared_s >= max(left.sum(), right.sum()) - 1e-3


def test_a_layer_narrower_than_the_distance_is_printed_by_one_head() -> None:
    """Its territories are empty."""
    strips = strips_of_layer(np.ones(60), NO_PRICE[:59], 5.0, np.full(2, 70.0), 2)
    assert strips.shared_s == pytest.approx(0.0, abs=1e-3)
    assert strips.alone_s == pytest.approx(60.0, abs=1e-3)
