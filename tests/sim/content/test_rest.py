"""What is left of a print, held against the plan that was broken off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.writing.parts import contours_of
from decmcts.planning.replanning.rest import stretches_left
from decmcts.print.contours import Contours, joined, taken
from decmcts.print.plan import PlanDocument
from sim.content.inventory import contour_segments
from sim.content.rest import check_rest
from sim.faults import FaultKind
from tests.makers.printed import laid_twice
from tests.makers.slab import slab_gcode
from tests.planning.replanning.conftest import Made, made
from tests.sim.content.test_pieces import cut_at

__all__ = ["made"]


def parted(document: PlanDocument) -> tuple[Contours, Contours]:
    """Return what is left behind the second layer, and what is printed."""
    contours = document.contours
    left = contours.layer > 1
    return taken(contours, np.flatnonzero(left)), taken(contours, np.flatnonzero(~left))


def kinds(rest: Contours, printed: Contours | None, whole: PlanDocument) -> set[FaultKind]:
    return {fault.kind for fault in check_rest(rest, printed, whole, {}).faults}


def test_a_rest_that_is_one_is_sound(made: Made) -> None:
    """However its contours run."""
    rest, printed = parted(made.document)
    assert not check_rest(rest, printed, made.document, {}).faults
    assert not check_rest(rest, None, made.document, {}).faults


def test_what_is_printed_already_is_found(made: Made) -> None:
    """A contour of the rest that stands on the bed."""
    rest, printed = parted(made.document)
    whole = made.document.contours
    assert kinds(whole, printed, made.document) == {FaultKind.DOUBLED}
    twice = taken(whole, np.concatenate([np.flatnonzero(whole.layer > 1), [len(whole) - 1]]))
    assert kinds(twice, printed, made.document) == {FaultKind.DOUBLED}
    assert kinds(rest, rest, made.document) == {FaultKind.DOUBLED}


@pytest.mark.parametrize("column", ["points", "extrusion", "feed"])
def test_what_is_not_of_the_print_is_found(made: Made, column: str) -> None:
    """A segment that lies elsewhere, or has other filament or feed."""
    rest, printed = parted(made.document)
    values = getattr(rest, column).copy()
    values[1] += 0.05
    other = replace(rest, **{column: values})
    assert kinds(other, printed, made.document) == {FaultKind.EXTRUSION}


def test_another_tool_has_to_be_allowed(made: Made) -> None:
    """By the very pair."""
    rest, printed = parted(made.document)
    other = replace(rest, tool=np.full_like(rest.tool, 1))
    assert kinds(other, printed, made.document) == {FaultKind.INELIGIBLE}
    assert not check_rest(other, printed, made.document, {0: 1}).faults
    assert check_rest(other, printed, made.document, {1: 0}).faults
    assert check_rest(
        rest, printed, made.document, {0: 1}
    ).faults  # allowed is meant: it is said so


@pytest.mark.parametrize("end", [0, 1])
def test_a_part_of_a_bead_is_left(made: Made, end: int) -> None:
    """Of one that was broken off, with its share of the filament."""
    rest, printed = parted(made.document)
    points, extrusion = rest.points.copy(), rest.extrusion.copy()
    a, b = (0, 1) if end == 0 else (int(rest.offsets[1]) - 1, int(rest.offsets[1]) - 2)
    points[a] = (points[a] + points[b]) / 2.0
    extrusion[max(a, b)] /= 2.0
    part = replace(rest, points=points, extrusion=extrusion)
    assert not check_rest(part, printed, made.document, {}).faults
    extrusion = extrusion.copy()
    extrusion[max(a, b)] *= 1.5
    assert kinds(replace(part, extrusion=extrusion), printed, made.document) == {
        FaultKind.EXTRUSION
    }


class Cut(NamedTuple):
    """A print that was cut and broken off."""

    document: PlanDocument
    rest: Contours  # as few stretches as there can be
    printed: Contours


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory, made: Made) -> Cut:
    """All of the first layer is printed, and of the others what lies in the middle."""
    path = tmp_path_factory.mktemp("slab") / "slab.gcode"
    path.write_text(slab_gcode(layers=3))
    job = read_gcode(path)[0]
    pieces = cut_at(job, [90.0, 130.0, 171.3, 190.0]).contours
    document = replace(made.document, contours=pieces)
    middle = np.add.reduceat(pieces.points[:, 0], pieces.offsets[:-1]) / np.diff(pieces.offsets)
    done = (pieces.layer < 1) | ((middle > 130.0) & (middle < 171.0) & (pieces.layer < 2))
    stretches = stretches_left(document, job, ~done, lambda c: np.ones(len(c), np.bool_))
    rest = contours_of(job.contours, stretches)
    return Cut(document, rest, taken(pieces, np.flatnonzero(done)))


def checked(cut: Cut, rest: Contours) -> set[FaultKind]:
    none = taken(rest, np.empty(0, np.int64))
    return {f.kind for f in check_rest(rest, cut.printed, cut.document, {}, none).faults}


def test_the_rest_of_a_cut_print_is_whole_where_it_can_be(cut: Cut) -> None:
    """Parts of a segment, printed and left, are that segment; nothing is missing."""
    assert checked(cut, cut.rest) == set()
    assert checked(cut, parted_rest(cut)) == set()


def parted_rest(cut: Cut) -> Contours:
    """Return what is left as the plan has it, piece by piece."""
    pieces = cut.document.contours
    keys = {tuple(cut.printed.polyline(c).ravel()) for c in range(len(cut.printed))}
    left = [c for c in range(len(pieces)) if tuple(pieces.polyline(c).ravel()) not in keys]
    return taken(pieces, np.array(left))


def a_stretch(cut: Cut, *, reversible: bool = True) -> int:
    """Return a stretch of a contour that is printed in part, of several segments."""
    rest = cut.rest
    able = (rest.layer == 1) & (np.diff(rest.offsets) > 2) & (rest.reversible == reversible)
    return int(np.flatnonzero(able)[0])


def _twice(cut: Cut) -> Contours:
    return taken(cut.rest, np.sort(np.append(np.arange(len(cut.rest)), a_stretch(cut))))


def _missing(cut: Cut) -> Contours:
    return taken(cut.rest, np.delete(np.arange(len(cut.rest)), a_stretch(cut)))


def _printed_too(cut: Cut) -> Contours:
    """A piece of a contour that is printed there."""
    ours = cut.printed.layer == 1
    return joined(cut.rest, taken(cut.printed, np.flatnonzero(ours)[:1]))


def _whole(cut: Cut) -> Contours:
    """All of a contour of which a part is printed, beside what is left of it."""
    pieces = cut.document.contours
    first = pieces.sources[np.flatnonzero(pieces.layer == 1)[0]]
    return joined(cut.rest, taken(pieces, np.flatnonzero(pieces.sources == first)))


def _changed(cut: Cut, column: str, change: Callable[[Any, int, int], None]) -> Contours:
    c = a_stretch(cut)
    values = getattr(cut.rest, column).copy()
    change(values, int(cut.rest.offsets[c]), int(cut.rest.offsets[c + 1]) - 1)
    return replace(cut.rest, **{column: values})


def _shorter(cut: Cut) -> Contours:
    """The first segment begins 0.1 mm later, with as much less filament."""
    c = a_stretch(cut)
    points, pushed = cut.rest.points.copy(), cut.rest.extrusion.copy()
    first = int(cut.rest.offsets[c])
    length = float(np.linalg.norm(points[first + 1] - points[first]))
    points[first] += (points[first + 1] - points[first]) * (0.1 / length)
    pushed[first + 1] *= 1.0 - 0.1 / length
    return replace(cut.rest, points=points, extrusion=pushed)


def _longer(cut: Cut) -> Contours:
    """A stretch goes 0.1 mm on into what is printed behind it, with its filament."""
    rest = cut.rest
    c = next(c for c in np.flatnonzero(rest.layer == 1).tolist() if _is_cut_behind(cut, c))
    last = int(rest.offsets[c + 1]) - 1
    points, pushed = rest.points.copy(), rest.extrusion.copy()
    way = points[last] - points[last - 1]
    length = float(np.linalg.norm(way))
    points[last] += way * (0.1 / length)
    pushed[last] *= 1.0 + 0.1 / length
    return replace(rest, points=points, extrusion=pushed)


def _is_cut_behind(cut: Cut, c: int) -> bool:
    """Tell whether a stretch ends where a piece of its contour that is printed begins."""
    ends, begins = cut.rest.end[c], cut.printed.start
    return bool((np.abs(begins - ends).max(axis=1) < 1e-9).any())


def _backwards(cut: Cut) -> Contours:
    """A stretch runs the other way, which its contour may not."""
    c = a_stretch(cut, reversible=False)
    a, b = int(cut.rest.offsets[c]), int(cut.rest.offsets[c + 1])
    points, pushed, feed = (
        getattr(cut.rest, name).copy() for name in ("points", "extrusion", "feed")
    )  # fmt: skip
    points[a:b] = points[a:b][::-1].copy()
    for values in (pushed, feed):
        values[a + 1 : b] = values[a + 1 : b][::-1].copy()
    return replace(cut.rest, points=points, extrusion=pushed, feed=feed)


def _shift(values: Any, first: int, _: int) -> None:
    values[first + 1] += 3e-4
    values[first + 2] -= 3e-4


def _beside(values: Any, first: int, _: int) -> None:
    values[first + 1, 1] += 0.01


def _slower(values: Any, first: int, _: int) -> None:
    values[first + 1] *= 0.9


SPOILT: dict[str, tuple[Callable[[Cut], Contours], FaultKind]] = {
    "a stretch twice": (_twice, FaultKind.DOUBLED),
    "a stretch missing": (_missing, FaultKind.MISSING),
    "a piece that is printed": (_printed_too, FaultKind.DOUBLED),
    "a contour whole of which a part is printed": (_whole, FaultKind.DOUBLED),
    "begins too late": (_shorter, FaultKind.MISSING),
    "goes on into what is printed": (_longer, FaultKind.DOUBLED),
    "runs backwards": (_backwards, FaultKind.WRONG_PATH),
    "filament one segment further": (
        lambda cut: _changed(cut, "extrusion", _shift), FaultKind.EXTRUSION
    ),
    "a little more filament everywhere": (
        lambda cut: replace(
            cut.rest, extrusion=cut.rest.extrusion + 9e-5 * (cut.rest.extrusion > 0.0)
        ),
        FaultKind.E_TOTAL,
    ),
    "a point elsewhere": (lambda cut: _changed(cut, "points", _beside), FaultKind.EXTRUSION),
    "slower": (lambda cut: _changed(cut, "feed", _slower), FaultKind.EXTRUSION),
    "another tool": (
        lambda cut: replace(cut.rest, tool=np.ones_like(cut.rest.tool)), FaultKind.INELIGIBLE
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_rest_of_a_cut_print_is_refused(cut: Cut, name: str) -> None:
    """Whatever is wrong with one of its stretches."""
    spoil, kind = SPOILT[name]
    assert kind in checked(cut, spoil(cut))


def test_one_way_of_a_bead_that_goes_there_and_back_is_left(made: Made) -> None:
    """Nobody knows which of its two segments it is, so none is said to run the wrong way."""
    whole = made.document.contours
    there = np.array([[0.0, 0.0, 0.2], [10.0, 0.0, 0.2], [0.0, 0.0, 0.2]])
    pushed, feed = np.array([0.0, 0.4, 0.4]), np.array([0.0, 20.0, 20.0])
    one = replace(
        taken(whole, np.array([0])), points=there, offsets=np.array([0, 3]), extrusion=pushed,
        feed=feed, reversible=np.array([False]),
    )  # fmt: skip
    document = replace(made.document, contours=one)
    halves = [
        replace(one, points=there[k : k + 2], extrusion=pushed[:2], feed=feed[:2],
                offsets=np.array([0, 2])) for k in (0, 1)
    ]  # fmt: skip
    for printed, rest in (halves, halves[::-1]):
        assert not check_rest(rest, printed, document, {}, taken(one, np.empty(0, int))).faults
    assert check_rest(halves[1], None, document, {}).missing


def test_what_is_left_out_is_not_missing(cut: Cut) -> None:
    """And what is missing is told where nobody says what is left out."""
    gone = np.array([a_stretch(cut)])
    rest = _missing(cut)
    found = check_rest(rest, cut.printed, cut.document, {}, taken(cut.rest, gone))
    assert not found.faults and not found.missing
    found = check_rest(rest, cut.printed, cut.document, {})
    assert not found.faults and "are neither printed nor left" in found.missing


def test_what_was_printed_twice_is_counted(cut: Cut) -> None:
    """Also where contours were cut elsewhere the second time."""
    whole = cut.document.contours
    assert laid_twice(joined(cut.rest, cut.printed), whole) == 0
    stretch = taken(cut.rest, np.array([a_stretch(cut)]))
    parts = len(stretch.points) - 1
    assert laid_twice(joined(joined(cut.rest, cut.printed), stretch), whole) == parts
    again = joined(cut.rest, taken(whole, np.arange(len(whole))))
    assert laid_twice(again, whole) >= len(contour_segments(cut.rest).ends)
