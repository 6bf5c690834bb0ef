"""What is left of a print, held against the plan that was broken off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.contours import Contours, taken
from decmcts.print.plan import PlanDocument
from sim.content.rest import check_rest
from sim.faults import FaultKind
from tests.planning.replanning.conftest import Made, made

__all__ = ["made"]


def parted(document: PlanDocument) -> tuple[Contours, Contours]:
    """Return what is left behind the second layer, and what is printed."""
    contours = document.contours
    left = contours.layer > 1
    return taken(contours, np.flatnonzero(left)), taken(contours, np.flatnonzero(~left))


def kinds(rest: Contours, printed: Contours | None, whole: PlanDocument) -> set[FaultKind]:
    return {fault.kind for fault in check_rest(rest, printed, whole, {})}


def test_a_rest_that_is_one_is_sound(made: Made) -> None:
    """However its contours run."""
    rest, printed = parted(made.document)
    assert not check_rest(rest, printed, made.document, {})
    assert not check_rest(rest, None, made.document, {})


def test_what_is_printed_already_is_found(made: Made) -> None:
    """A contour of the rest that stands on the bed."""
    rest, printed = parted(made.document)
    whole = made.document.contours
    assert kinds(whole, printed, made.document) == {FaultKind.DOUBLED}
    twice = taken(whole, np.concatenate([np.flatnonzero(whole.layer > 1), [len(whole) - 1]]))
    assert kinds(twice, printed, made.document) == {FaultKind.EXTRUSION}
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
    assert not check_rest(other, printed, made.document, {0: 1})
    assert check_rest(other, printed, made.document, {1: 0})
    assert check_rest(rest, printed, made.document, {0: 1})  # allowed is meant: it is said so


@pytest.mark.parametrize("end", [0, 1])
def test_a_part_of_a_bead_is_left(made: Made, end: int) -> None:
    """Of one that was broken off, with its share of the filament."""
    rest, printed = parted(made.document)
    points, extrusion = rest.points.copy(), rest.extrusion.copy()
    a, b = (0, 1) if end == 0 else (int(rest.offsets[1]) - 1, int(rest.offsets[1]) - 2)
    points[a] = (points[a] + points[b]) / 2.0
    extrusion[max(a, b)] /= 2.0
    part = replace(rest, points=points, extrusion=extrusion)
    assert not check_rest(part, printed, made.document, {})
    extrusion = extrusion.copy()
    extrusion[max(a, b)] *= 1.5
    assert kinds(replace(part, extrusion=extrusion), printed, made.document) == {
        FaultKind.EXTRUSION
    }
