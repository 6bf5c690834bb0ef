"""Multisets of extrusions: matched through rounding and reversing, and not otherwise."""

from __future__ import annotations

import numpy as np
import pytest

from sim.content import inventory
from sim.content.inventory import NO_MATCH, Segments, compare, match_segments
from sim.faults import FaultKind as K


def segments(ends, extrusion=None, feed=None) -> Segments:
    ends = np.array(ends, float).reshape(-1, 6)
    n = len(ends)
    return Segments(
        ends,
        np.full(n, 0.5) if extrusion is None else np.array(extrusion, float),
        np.full(n, 30.0) if feed is None else np.array(feed, float),
        np.arange(n),
        "line",
    )


def kinds(ours, source):
    return {fault.kind for fault in compare(ours, source, match_segments(ours, source))}


def random_ends(n, seed=0):
    rng = np.random.default_rng(seed)
    return np.round(rng.uniform(0, 100, (n, 6)), 3)


def test_shuffled_reversed_and_rounded_is_the_same():
    """A plan may reorder and reverse; a file rounds to three decimals, also across a grid line."""
    rng = np.random.default_rng(2)
    exact = rng.uniform(0, 100, (500, 6))
    exact[:50] = np.round(exact[:50], 3) + 0.0005  # halfway between two grid points
    either_way = np.where(rng.random(500)[:, None] < 0.5, exact, np.roll(exact, 3, axis=1))
    ours = np.round(either_way, 3)[rng.permutation(500)]
    assert kinds(segments(ours), segments(exact)) == set()


def test_missing_doubled_and_foreign_are_told_apart():
    """The line says what happened, not only that something differs."""
    ends = random_ends(20)
    other = random_ends(1, seed=9)
    full = segments(ends)
    assert kinds(segments(ends[1:]), full) == {K.MISSING, K.E_TOTAL}
    assert kinds(segments(np.vstack([ends, ends[:1]])), full) == {K.DOUBLED, K.E_TOTAL}
    assert kinds(segments(np.vstack([ends, other])), full) == {K.EXTRUSION, K.E_TOTAL}


def test_the_same_segment_twice_in_the_source():
    """Multisets count: printed twice in the source, it must be printed twice."""
    ends = np.repeat(random_ends(3), 2, axis=0)
    assert kinds(segments(ends), segments(ends)) == set()
    assert kinds(segments(ends[1:]), segments(ends)) == {K.MISSING, K.E_TOTAL}


@pytest.mark.parametrize(
    ("extrusion", "feed", "due"),
    [
        (0.501, 30.0, {K.EXTRUSION}),
        (0.5, 31.0, {K.FEED}),
        (0.50001, 30.0005, set()),
        (0.50005, 30.0, {K.EXTRUSION}),
        (0.5, 30.01, {K.FEED}),
    ],
)
def test_filament_and_speed_are_compared(extrusion, feed, due):
    """Same line, other bead: that is another print."""
    ends = random_ends(4)
    ours = segments(ends, [extrusion, 0.5, 0.5, 0.5], [feed, 30.0, 30.0, 30.0])
    assert kinds(ours, segments(ends)) == due


def test_a_shift_of_a_hundredth_is_found():
    """A hundredth of a millimetre is more than rounding."""
    ends = random_ends(10)
    moved = ends.copy()
    moved[3, 0] += 0.01
    assert kinds(segments(moved), segments(ends)) == {K.MISSING, K.EXTRUSION}


def test_empty_against_empty():
    """No extrusion on either side is equal."""
    assert kinds(segments([]), segments([])) == set()


@pytest.mark.parametrize("off", [0.0, 1e-5])
def test_alike_segments_are_matched_in_turn(off):
    """A line twice in a file, once on each side of a barrier: the first is the first.

    Rounding makes the later of two alike the smaller; that must not turn them round.
    """
    rng = np.random.default_rng(4)
    ends = np.repeat(random_ends(40), 3, axis=0)
    source = segments(ends, 0.4 + off * rng.integers(0, 2, 120))
    ours = segments(np.roll(ends, 3, axis=1), 0.4 + off * rng.integers(0, 2, 120))
    assert match_segments(ours, source).tolist() == list(range(120))


def test_twins_of_other_filament_are_matched_by_it():
    """One place, three amounts: each is matched with its own, wherever it comes."""
    ends = np.repeat(random_ends(1), 3, axis=0)
    ours, source = segments(ends, [0.3, 0.1, 0.2]), segments(ends, [0.1, 0.2, 0.3])
    assert match_segments(ours, source).tolist() == [2, 0, 1]
    altered = segments(ends, [0.35, 0.1, 0.2])
    assert kinds(altered, source) == {K.EXTRUSION, K.E_TOTAL}


def all_may_have_several(ours, source, mine, theirs, match):
    """Match nothing ahead, so that all are matched in turn."""
    return np.arange(len(mine)), np.arange(len(theirs))


@pytest.mark.parametrize("seed", range(8))
def test_what_is_alone_is_matched_as_in_turn(seed, monkeypatch):
    """Matching what is alone first saves time; it must not change who is matched with whom."""
    rng = np.random.default_rng(seed)
    ends = random_ends(30, seed)[rng.integers(0, 30, 60)]  # some alone, some doubled
    feed, extrusion = rng.choice([30.0, 40.0], 60), rng.choice([0.5, 0.6], 60)
    source = segments(ends, extrusion, feed)
    rows = rng.permutation(60)[:50]
    changed = np.where(rng.random(50) < 0.1, 0.7, extrusion[rows])
    mine = np.vstack([ends[rows], random_ends(5, seed + 100)])
    ours = segments(mine, np.append(changed, np.full(5, 0.5)), np.append(feed[rows], [30.0] * 5))
    at_once = match_segments(ours, source)
    monkeypatch.setattr(inventory, "_match_single", all_may_have_several)
    in_turn = match_segments(ours, source)
    assert (at_once != NO_MATCH).sum() > 30
    np.testing.assert_array_equal(at_once, in_turn)
