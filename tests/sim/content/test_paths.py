"""Paths of prints looked at all at once against one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.plan import ActionKind
from sim.content.paths import _along, _print_problem


def print_of(rng, contours, contour):
    """Return a row and a path of one print, right or wrong in some way."""
    back, path = bool(rng.integers(2)), contours.polyline(contour).copy()
    wrong = int(rng.integers(6))
    if wrong == 1:
        path[rng.integers(len(path))] += [0.0, rng.choice([0.5e-3, 2e-3, -2e-3]), 0.0]
    elif wrong == 2:
        path = np.vstack([path, path[-1:]])
    elif wrong == 3:
        path = path[:-1]
    goes_back = back if wrong != 4 else not back
    return (ActionKind.PRINT, contour, back), path[::-1].copy() if goes_back else path


@pytest.mark.parametrize("seed", range(8))
def test_prints_that_need_no_look_have_no_problem(make, seed):
    """Those not asked why must be just those about which there is nothing to say."""
    rng = np.random.default_rng(seed)
    contours = make.contours_of([rng.uniform(0, 50, (int(n), 3)) for n in rng.integers(2, 6, 40)])
    contours = replace(contours, reversible=rng.random(40) < 0.7)
    made = [print_of(rng, contours, c) for c in rng.permutation(40).tolist()]
    travel = ((ActionKind.TRAVEL, -1, False), np.zeros((2, 3)))
    made = [one for pair in made for one in (travel, pair)]
    actions = make.actions_of_rows(
        "a", [row for row, _ in made], [path for _, path in made], [[]] * len(made)
    )
    prints = np.arange(1, len(made), 2)
    along = _along(contours, actions, prints)
    due = [not _print_problem(contours, actions, a) for a in prints.tolist()]
    assert any(due) and not all(due)
    assert along.tolist() == due
