"""Cutting a print into macro-actions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from decmcts.team.engine.problem import MACROS, cut_macros, numbered, part_of, part_progress


def test_parts_are_connected_footprints(case_of: Callable[..., Any]) -> None:
    """Two strokes that cross are one part, a far one is another."""
    chosen = case_of(
        [(50, 10, 0.5), (60, 10, 0.5)],
        [(90, 10, 0.5), (95, 10, 0.5)],
        [(55, 5, 1.0), (55, 15, 1.0)],
    )
    part = part_of(chosen.job.contours)
    assert part[0] == part[2] != part[1]


def test_progress_is_the_share_done_before() -> None:
    """Contours of a part follow each other in it, parts do not mix."""
    progress = part_progress(np.array([1.0, 5.0, 3.0, 5.0]), np.array([0, 1, 0, 1]))
    assert progress.tolist() == [0.0, 0.0, 0.25, 0.5]


def test_macros_cover_all_and_stay_few() -> None:
    """Every contour is in one macro-action, of one part, and later ones have larger numbers."""
    rng = np.random.default_rng(0)
    part, side = rng.integers(0, 5, 2000), rng.integers(0, 3, 2000)
    seconds = rng.uniform(1, 2, 2000)
    progress = part_progress(seconds, part)
    macro = cut_macros(seconds, part, progress, side)
    assert set(macro.tolist()) == set(range(macro.max() + 1))
    assert macro.max() < 3 * MACROS
    for k in range(macro.max() + 1):
        assert len(set(part[macro == k])) == 1
    when = [progress[macro == k].mean() for k in range(macro.max() + 1)]
    assert np.corrcoef(when, np.arange(len(when)))[0, 1] > 0.9


def test_nothing_to_cut(case_of: Callable[..., Any]) -> None:
    """An empty print has no parts and no macro-actions."""
    empty = np.empty(0)
    none = np.empty(0, np.int64)
    assert len(part_of(case_of().job.contours)) == 0
    assert len(cut_macros(empty, none, part_progress(empty, none), none)) == 0


def test_rows_are_numbered_as_they_sort() -> None:
    """Against numpy's way of sorting rows, which takes twenty times as long."""
    rows = np.random.default_rng(1).integers(-5, 7, (400, 3))
    wanted = np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)
    assert np.array_equal(numbered(*rows.T), wanted)
    assert not len(numbered(*np.empty((3, 0), np.int64)))
