"""What is left of a cut plan: the source's contours again, parted where something is printed."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from decmcts.formats.gcode.writing.parts import contours_of
from decmcts.planning.options import Cut, TeamSearch
from decmcts.planning.problem.made_from import rules_of
from decmcts.planning.replanning.replan import Rest, replan, rest_of, search_of
from decmcts.planning.replanning.rest import LeftBeads, stretches_left
from decmcts.print.contours import Contours
from decmcts.print.print_state import PrintState, state_of_events, state_of_layers
from tests.planning.replanning.conftest import Made, log_until, within_print

PARKED = (345.0, 150.0, 10.0)


def within(made: Made, share: float) -> PrintState:
    """Return the state at a share of the print."""
    document = made.document
    return state_of_events(document, log_until(document, share * document.plan.makespan_s))


def left_of(made: Made, state: PrintState, **given: Any) -> Rest:
    return rest_of(made.document, made.source, state, {}, **given)


def sources_left(made: Made, state: PrintState) -> tuple[np.ndarray, np.ndarray]:
    """Tell of each contour of the source whether some of it is left, and whether all of it is."""
    of, n = made.document.contours.sources, len(made.source.job.contours)
    some = np.bincount(of[~state.done], minlength=n) > 0
    return some, some & (np.bincount(of[state.done], minlength=n) == 0)


def test_contours_of_which_nothing_is_printed_are_whole(made: Made, cut: Made) -> None:
    """As the source has them, to the last digit; they were a contour for each piece."""
    source, document = cut.source.job.contours, cut.document
    assert len(document.contours) > 2 * len(source), "the plan is not cut"
    rest = left_of(cut, state_of_layers(document, 1)).source.job.contours
    whole = np.flatnonzero(source.layer >= 1)
    assert len(rest) == len(whole)
    assert np.array_equal(rest.closed, source.closed[whole])
    points = np.concatenate([source.polyline(c) for c in whole])
    assert np.array_equal(rest.points, points)
    filament = np.concatenate(
        [source.extrusion[source.offsets[c] : source.offsets[c + 1]] for c in whole]
    )
    assert np.abs(rest.extrusion - filament).max() < 1e-9


def test_what_is_printed_is_whole_too(cut: Made) -> None:
    """So travels and judge have no more to clear than is there; hops laid nothing."""
    state = within(cut, 0.5)
    printed = left_of(cut, state).source.job.printed
    assert printed is not None
    n = len(cut.source.job.contours)
    done = np.bincount(cut.document.contours.sources[state.done], minlength=n) > 0
    assert len(printed) < state.done.sum() / 3
    assert done.sum() <= len(printed)
    within_contours = np.ones(len(printed.points), np.bool_)
    within_contours[printed.offsets[:-1]] = False
    assert (printed.extrusion[within_contours] > 0.0).all()


@pytest.mark.parametrize("share", [0.1, 0.35, 0.6, 0.9])
def test_what_follows_on_is_one_stretch(cut: Made, share: float) -> None:
    """Of contours that are begun there are as many as there are printed parts between them."""
    state = within(cut, share)
    rest = left_of(cut, state).source.job.contours
    some, whole = sources_left(cut, state)
    assert some.sum() <= len(rest)
    pieces, source = cut.document.contours, cut.source.job.contours
    due = 0
    for c in np.flatnonzero(some & ~whole).tolist():
        ends = intervals(pieces, c, ~state.done)
        due += 1 + sum(a[1] != b[0] for a, b in pairwise(ends))
    assert len(rest) == whole.sum() + due
    left = [intervals(pieces, c, ~state.done) for c in range(len(source))]
    assert filament_mm(rest) == pytest.approx(
        sum(filament_between(source, c, each) for c, each in enumerate(left)), abs=2e-5 * len(rest)
    )


def test_what_no_head_can_print_joined_stays_as_it_was_cut(cut: Made) -> None:
    """Of several heads that live none may reach all of a contour, and each its pieces."""
    every = np.ones(len(cut.document.contours), np.bool_)
    job, reached = cut.source.job, 185.0

    def able(contours: Contours) -> np.ndarray:
        low = np.minimum.reduceat(contours.points[:, 0], contours.offsets[:-1])
        return np.asarray(np.maximum.reduceat(contours.points[:, 0], contours.offsets[:-1]) - low
                          <= reached)  # fmt: skip

    found = contours_of(job.contours, stretches_left(cut.document, job, every, able))
    whole = int(able(job.contours).sum())
    assert 0 < whole < len(job.contours) < len(found)
    assert able(found).sum() > whole
    assert filament_mm(found) == pytest.approx(filament_mm(job.contours), abs=1e-9)
    joined = stretches_left(cut.document, job, every, lambda c: np.ones(len(c), np.bool_))
    assert all(one.whole for one in joined) and len(joined) == len(job.contours)


def intervals(pieces: Contours, contour: int, left: np.ndarray) -> list[tuple[float, float]]:
    """Return from where to where along a contour of the source pieces that are left print it."""
    assert pieces.along is not None
    found = []
    for p in np.flatnonzero((pieces.sources == contour) & left).tolist():
        first, last = int(pieces.offsets[p]), int(pieces.offsets[p + 1])
        along, pushed = pieces.along[first:last].tolist(), pieces.extrusion[first:last].tolist()
        found += [ends for ends, e in zip(pairwise(along), pushed[1:], strict=True) if e > 0.0]
    return sorted(found)


def filament_mm(contours: Contours) -> float:
    return float(contours.extrusion.sum())


def filament_between(source: Contours, c: int, parts: list[tuple[float, float]]) -> float:
    """Return the filament of parts of a contour, each within one segment."""
    pushed = source.extrusion[source.offsets[c] : source.offsets[c + 1]]
    return float(sum((b - a) * pushed[int(np.floor(a)) + 1] for a, b in parts))


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.2, 0.7])
def test_a_rest_is_cut_anew(cut: Made, agents: Any, share: float) -> None:
    """As the print was, where both heads live; and broken off once more it is one again."""
    search = TeamSearch(0.2, cut=Cut.ALL)
    rest = left_of(cut, within(cut, share))
    result = replan(rest, search, rules_of(cut.document), agents=agents)
    assert result.verdict.ok and result.document.contours.of is not None
    again = Made(result.document, rest.source, cut.path)
    state = within(again, 0.3)
    end = left_of(again, state)
    some, _ = sources_left(again, state)
    assert some.sum() <= len(end.source.job.contours) < (~state.done).sum()


def test_a_rest_may_be_cut_as_its_plan_was(made: Made, cut: Made) -> None:
    """And welds be no older."""
    assert search_of(made.document, 1.0, 0).cut is Cut.NONE
    assert cut.document.rules is not None
    aged = replace(cut.document, rules=replace(cut.document.rules, weld_limit_s=60.0))
    search = search_of(aged, 2.0, 7)
    assert search == TeamSearch(2.0, 7, cut=Cut.ALL, weld_limit_s=60.0)
    assert search_of(replace(aged, rules=None), 1.0, 0).cut is Cut.NONE


@pytest.mark.slow
def test_a_piece_broken_off_is_finished(cut: Made, alone: Any) -> None:
    """Its rest is a stretch of its own."""
    document = cut.document
    time_s, action = within_print(document, 1, 20.0)
    state = state_of_events(document, log_until(document, time_s, failed=1))
    contour = int(document.plan.heads[1].contour[action])
    assert document.contours.of is not None and state.done[contour]
    rest = rest_of(document, cut.source, state, {"right": PARKED}, LeftBeads.FINISH)
    (mine,) = [one for one in rest.broken if one.head == "right"]
    assert mine.rest and not rest.left.rows.any()
    result = replan(rest, TeamSearch(0.2), rules_of(document), agents=alone)
    assert result.verdict.ok
