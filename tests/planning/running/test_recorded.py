"""What is printed, by what controllers stated."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.planning.running.recorded import Carried, course_of
from decmcts.print.plan import ActionKind
from tests.makers.printed import printed
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
    (share,) = [share for _, share in printed(carried) if share < 1.0]
    piece, path = int(actions.contour[action]), actions.action_path(action)
    rows = slice(int(contours.offsets[piece]), int(contours.offsets[piece + 1]))
    steps = np.linalg.norm(np.diff(contours.points[rows], axis=0), axis=1)
    laid = float(steps[contours.extrusion[rows][1:] > 0.0].sum())
    half = float(np.linalg.norm(path[1] - path[0])) / 2.0
    assert share == pytest.approx(half / laid)


def test_a_head_that_people_took_away_does_not_finish_its_bead(cut: Made) -> None:
    """Its controller was off without a word: its path ends where it was then, and at its park."""
    plan, machine = cut.document.plan, cut.document.machine
    actions, park = plan.heads[0], machine.heads[0].park
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    action = int(prints[np.argmax((actions.end_s - actions.begin_s)[prints])])
    time_s = float(actions.begin_s[action] + actions.end_s[action]) / 2.0
    carried = Carried(0, cut.document, (0, 1), is_print=True)
    for event in log_until(cut.document, time_s).events:
        carried.take(event.head, event)
    left = course_of([carried], 0, park, {})
    assert left.end[-1] > time_s
    moved = course_of([carried], 0, park, {0: (time_s, park)})
    assert moved.end[-1] == time_s and (np.diff(moved.end) >= 0.0).all()
    assert tuple(moved.points[-1]) == park
    path = actions.action_path(action)
    assert path.min(axis=0)[0] - 0.01 <= moved.points[-2][0] <= path.max(axis=0)[0] + 0.01
