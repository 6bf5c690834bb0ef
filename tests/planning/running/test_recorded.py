"""What is printed, by what controllers stated."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.planning.running.recorded import Carried
from decmcts.print.plan import ActionKind
from tests.planning.replanning.conftest import Made, log_until


@pytest.mark.parametrize("reverse", [False, True])
def test_hops_of_a_piece_that_was_broken_off_are_not_printed(cut: Made, reverse: bool) -> None:
    """Its share is that of what it lays down."""
    plan, contours = cut.document.plan, cut.document.contours
    hops = np.add.reduceat(contours.extrusion == 0.0, contours.offsets[:-1]) > 1
    head, action = next(
        (h, k) for h, actions in enumerate(plan.heads)
        for k in np.flatnonzero(actions.kind == ActionKind.PRINT).tolist()
        if hops[actions.contour[k]] and bool(actions.reversed[k]) == reverse
    )  # fmt: skip
    actions = plan.heads[head]
    time_s = float(actions.begin_s[action] + actions.end_s[action]) / 2.0
    carried = Carried(0, cut.document, (0, 1), is_print=True)
    for event in log_until(cut.document, time_s, failed=head).events:
        carried.take(event.head, event)
    (share,) = [share for _, share in carried.printed() if share < 1.0]
    piece, path = int(actions.contour[action]), actions.action_path(action)
    rows = slice(int(contours.offsets[piece]), int(contours.offsets[piece + 1]))
    steps = np.linalg.norm(np.diff(contours.points[rows], axis=0), axis=1)
    laid = float(steps[contours.extrusion[rows][1:] > 0.0].sum())
    half = float(np.linalg.norm(path[1] - path[0])) / 2.0
    assert share == pytest.approx(half / laid)
