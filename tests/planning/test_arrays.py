"""A print made of arrays is the print they say; what is wrong with one is said by its name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.formats.mesh import SliceOptions
from decmcts.planning.arrays import from_arrays
from decmcts.print.contours import Role

BARS: dict[str, Any] = {
    "points": np.array(
        [[20, 20, 0.2], [40, 20, 0.2], [80, 20, 0.2], [60, 20, 0.2], [20, 21, 0.5], [40, 21, 0.5]]
    ),
    "offsets": np.array([0, 2, 4, 6]),
    "layer": np.array([0, 0, 1]),
    "machine": "mk4s",
}


@pytest.mark.slow
def test_the_print_is_that_of_the_arrays() -> None:
    """Nothing is lost on the way through G-code, but for what is finer than it."""
    sizes = {"width": np.array([0.4, 0.5, 0.5]), "height": np.array([0.2, 0.2, 0.3])}
    extrusion = np.array([9.0, 0.5, 9.0, 0.6, 9.0, 0.7])
    role = np.array([Role.PERIMETER, Role.INFILL, Role.INFILL])
    feed = np.array([20.0, 30.0, 40.0])
    made = from_arrays(**BARS, **sizes, role=role, extrusion=extrusion, feed=feed).job.contours
    assert np.array_equal(made.points, BARS["points"])
    assert np.array_equal(made.offsets, BARS["offsets"])
    assert np.array_equal(made.layer, BARS["layer"])
    assert np.array_equal(made.role, role)
    assert made.extrusion == pytest.approx(np.array([0, 0.5, 0, 0.6, 0, 0.7]))
    assert made.feed[1::2] == pytest.approx(feed)
    for name, size in sizes.items():
        assert getattr(made, name) == pytest.approx(size)


@pytest.mark.slow
def test_filament_is_what_a_bead_of_this_size_takes() -> None:
    """Who knows widths and heights need not count filament."""
    thin, thick = (from_arrays(**BARS, width=w).job.contours.extrusion[1] for w in (0.4, 0.8))
    spared = 0.2 * (1.0 - np.pi / 4.0)  # of the round sides, of a height of 0.2 mm
    assert thick / thin == pytest.approx((0.8 - spared) / (0.4 - spared), rel=1e-4)


@pytest.mark.slow
def test_the_head_lifts_within_the_machine_and_parks() -> None:
    """On the tallest prints there is no space for the whole lift."""
    source = from_arrays(**BARS, options=SliceOptions(fan_percent=100.0))
    text = source.path.read_text()
    end = text[text.rindex(";TYPE:Custom") :].splitlines()
    assert end[1:4] == ["G1 E-1 F2400", "G1 Z10.500 F600 ; up", "G1 X5.000 Y205.000 F9000 ; park"]
    assert "M104 S0 ; nozzle off" in end
    assert text.index(";Z:0.5") < text.index("M106 S255 ; fan")  # from the second layer on
    tall = {**BARS, "points": BARS["points"] + [0.0, 0.0, 195.0]}
    source = from_arrays(**tall)
    assert "G1 Z200.000 F600 ; up" in source.path.read_text()


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("points", np.zeros((6, 2))),
        ("points", np.full((6, 3), np.nan)),
        ("offsets", np.array([0, 1, 4, 6])),
        ("offsets", np.array([0, 2, 4, 7])),
        ("offsets", np.array([0.0, 2.0, 4.0, 6.0])),
        ("offsets", np.array([0])),
        ("layer", np.array([0, 0])),
        ("layer", np.array([1, 0, 0])),
        ("layer", np.array([-1, 0, 0])),
        ("role", np.array([0, 1, 99])),
        ("extrusion", np.zeros(3)),
        ("extrusion", np.full(6, -1.0)),
        ("feed", 0.0),
        ("feed", 0.001),  # F0 in a file
        ("width", np.array([0.4, 0.0, 0.4])),
        ("height", np.array([0.4, np.inf, 0.4])),
        ("height", np.zeros((3, 1))),
        ("machine", "mk44s"),
    ],
)
def test_what_is_wrong_is_named(name: str, wrong: object) -> None:
    """A shape that is off by one is found at once, and not as a fault of some contour."""
    with pytest.raises(InputError, match=name):
        from_arrays(**{**BARS, name: wrong})
