"""How near heads come, compared with every pair of concurrent moves given to FCL."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely

from decmcts.print.machine import Body, Head, Slice
from decmcts.print.plan import ACTION_END, ActionKind
from sim.content.paths import legs_of
from sim.replay.bodies import concurrent, path_gap
from sim.replay.heads_near import least_gap, outermost
from sim.replay.shapes import parts_of
from sim.rules.order import PartialOrder, order_of

MOST_MM = 1e4


def random_head(rng: np.random.Generator, name: str, x: float) -> Head:
    """Return a head with a narrow slice, a wide one and perhaps an arm beside it."""
    slices = tuple(
        Slice(height, (hull(rng.normal(0.0, spread, (7, 2))),))
        for height, spread in ((0.0, 1.0), (float(rng.uniform(1, 6)), 5.0))
    )
    if rng.random() < 0.4:  # both low: which heights they have beside each other counts
        return Head(
            name, (), (Body("block", (-4.0, -3.0, 0.0), (5.0, 6.0, 2.5)),), park=(x, 0.0, 10.0)
        )
    arm = Body("arm", (3.0, -30.0, 4.0), (9.0, 30.0, float(rng.uniform(5, 30))))
    return Head(name, slices, (arm,) if rng.random() < 0.7 else (), park=(x, 0.0, 10.0))


def hull(points: np.ndarray) -> np.ndarray:
    ring = shapely.get_coordinates(shapely.MultiPoint(points).convex_hull)[:-1]
    return ring if shapely.LinearRing(ring).is_ccw else ring[::-1].copy()


def random_actions(make, rng, heads):
    """Return level, upright and climbing travels and stands, some of which wait for others."""
    sizes, paths = rng.integers(1, 4, len(heads)).tolist(), []
    for head, n in zip(heads, sizes, strict=True):
        at, mine = np.array(head.park), []
        for _ in range(n):
            steps = rng.normal(0.0, 12.0, (int(rng.integers(0, 4)), 3))
            steps *= rng.choice([[1, 1, 0], [0, 0, 1], [1, 1, 0.3]], len(steps))
            mine.append(at + np.cumsum(np.vstack([np.zeros(3), steps]), axis=0))
            at = mine[-1][-1]
        paths.append(mine)
    slots = rng.permutation(np.repeat(np.arange(len(heads)), sizes)).tolist()
    sequence = [(h, slots[:i].count(h)) for i, h in enumerate(slots)]
    waits = {key: [] for key in sequence}
    for (h, a), (g, b) in itertools.combinations(sequence, 2):
        if g != h and rng.random() < 0.5:
            point = int(rng.choice([ACTION_END, len(paths[h][a]) - 1]))
            waits[g, b].append((h, a, point if point else ACTION_END))
    return tuple(
        make.actions_of_rows(
            head.name,
            [(ActionKind.TRAVEL, -1, False)] * sizes[h],
            paths[h],
            [waits[h, a] for a in range(sizes[h])],
        )
        for h, head in enumerate(heads)
    )


def by_all_pairs(heads, all_actions, order) -> float:
    """Return the least distance, every pair of parts of every concurrent pair given to FCL."""
    least = np.inf
    for r, s in itertools.permutations(range(len(heads)), 2):
        parts = list(itertools.product(parts_of(heads[r]), parts_of(heads[s])))
        for stations, others in concurrent(heads, all_actions, order, r, s):
            for i in range(len(stations.low)):
                for j in range(stations.low[i], stations.high[i]):
                    for a, b in parts:
                        shapes = (stations.path(i), a.vertices(), others.path(j), b.vertices())
                        least = min(least, path_gap(*shapes, MOST_MM))
    return least


@pytest.mark.parametrize("n_heads", [2, 3])
def test_the_least_gap_is_that_of_all_pairs(make, n_heads):
    """No pair is left out, none made up; where heads climb past each other it is a bound."""
    gaps, bounds = [], 0
    for seed in range(12 if n_heads == 2 else 1):
        rng = np.random.default_rng([seed, n_heads])
        heads = tuple(random_head(rng, f"h{k}", 45.0 * k) for k in range(n_heads))
        legs = legs_of(random_actions(make, rng, heads))
        order = order_of(legs.all_actions)
        assert isinstance(order, PartialOrder)
        found = least_gap(heads, legs.all_actions, order)
        due = by_all_pairs(heads, legs.all_actions, order)
        assert found.gap_mm <= due + 1e-5, seed
        assert found.at_least or found.gap_mm == pytest.approx(due, abs=1e-5), seed
        bounds += found.at_least
        gaps.append(due)
    assert any(gap > 0.0 for gap in gaps)
    assert bounds <= len(gaps) // 4


def test_parts_within_others_are_left_out():
    """They are never nearer than what holds them; of equal parts one is kept."""
    square = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    head = Head(
        "h",
        (Slice(0.0, (square,)), Slice(5.0, (3 * square, square, 3 * square))),
        (Body("within", (-3.0, -3.0, 5.0), (3.0, 3.0, 60.0)), Body("below", (2, -1, 1), (4, 1, 9))),
    )
    assert [part.name for part in outermost(parts_of(head))] == [
        "slice at 0 mm", "slice at 5 mm", "below",
    ]  # fmt: skip


def test_a_head_without_parts_is_near_to_nothing(make):
    """A machine may describe no head at all."""
    heads = (Head("a", ()), Head("b", ()))
    rng = np.random.default_rng(0)
    legs = legs_of(random_actions(make, rng, heads))
    order = order_of(legs.all_actions)
    assert least_gap(heads, legs.all_actions, order).gap_mm == np.inf
