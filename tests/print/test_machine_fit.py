"""Whether a print and a machine go together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.contours import Contours, Role
from decmcts.print.machine_fit import check_fits


def lines(*spans: tuple[float, float], role: int = Role.PERIMETER, tool: int = 0) -> Contours:
    """Contours along X at y 100, one for each span, on lines 10, 20, ... of the source."""
    n = len(spans)
    points = np.array([[x, 100.0, 0.2] for span in spans for x in span])
    return Contours(
        points=points.reshape(-1, 3),
        offsets=np.arange(n + 1) * 2,
        extrusion=np.zeros(2 * n),
        feed=np.zeros(2 * n),
        width=np.full(n, 0.5),
        height=np.full(n, 0.2),
        role=np.full(n, role, np.int8),
        closed=np.zeros(n, np.bool_),
        layer=np.zeros(n, np.int32),
        tool=np.full(n, tool, np.int16),
        reversible=np.ones(n, np.bool_),
        epoch=np.zeros(n, np.int32),
        line=(np.arange(n, dtype=np.int32) + 1) * 10,
    )


def test_a_print_that_just_fits_is_let_through():
    """The bed's full width is there to be used: 299.5 mm and a bead of 0.5 mm."""
    check_fits(lines((0.25, 299.75)), load_machine("coreonel"))


def test_a_print_larger_than_the_bed_is_refused():
    """Half a bead too much runs into the frame."""
    with pytest.raises(InputError, match=r"300\.5 x 0\.5 mm, larger than the bed of 'coreonel'"):
        check_fits(lines((0.0, 300.0)), load_machine("coreonel"))


def test_place_on_the_bed_is_the_sources_business():
    """Beds differ in their origin; a delta's is in the middle."""
    check_fits(lines((-100.0, 100.0)), load_machine("coreonel"))


def test_purge_lines_may_lie_beside_the_bed():
    """Prusa's start G-code draws one at y -4."""
    check_fits(lines((-200.0, 400.0), role=Role.CUSTOM), load_machine("mk4s"))


def test_contours_beyond_all_heads_are_named():
    """A contour no head reaches would be missing from every plan."""
    dual = load_machine("dual-gantry")
    left_only = replace(dual, heads=dual.heads[:1], rails=())
    with pytest.raises(
        InputError, match=r"line 20: no head .* contour 1 .*x 250\.00\.\.280\.00.*, 1 "
    ):
        check_fits(lines((10.0, 20.0), (250.0, 280.0)), left_only)


def test_each_contour_needs_one_head_for_itself():
    """No head of the dual gantry reaches the whole bed; a contour across it cannot be split."""
    dual = load_machine("dual-gantry")
    check_fits(lines((5.0, 20.0), (250.0, 290.0)), dual)
    with pytest.raises(InputError, match="no head reaches it; move the print"):
        check_fits(lines((5.0, 290.0)), dual)
    with pytest.raises(InputError, match="into reach, or slice it without skirt"):
        check_fits(lines((5.0, 290.0), role=Role.SKIRT_BRIM), dual)


def test_what_only_a_head_with_another_tool_reaches_is_said_so():
    """Of the heads, those with the tool count; and each contour has its own reason."""
    dual = load_machine("dual-gantry")
    heads = replace(dual.heads[0], tools=(0,)), replace(dual.heads[1], tools=(1,))
    machine = replace(dual, heads=heads)
    with pytest.raises(InputError, match=r"no head with tool 0 reaches it; move .*reach"):
        check_fits(lines((5.0, 20.0), (280.0, 290.0)), machine)
    with pytest.raises(InputError, match=r"1 such contours in all: no head with tool 1"):
        check_fits(lines((5.0, 290.0), tool=1), machine)


def test_tools_no_head_has_are_refused():
    """A second material needs a head that carries it."""
    paper = load_machine("coreonel")
    machine = replace(paper, heads=(replace(paper.heads[0], tools=(0,)),))
    check_fits(lines((0.0, 9.0)), machine)
    with pytest.raises(InputError, match=r"no head has tool 1; .*`tools`") as error:
        check_fits(lines((0.0, 9.0), tool=1), machine)
    assert "reach" not in str(error.value)


def test_nothing_fits_anywhere():
    """An empty print is refused by the reader, not here."""
    check_fits(lines(), load_machine("mini"))
