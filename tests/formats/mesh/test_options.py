"""What a slicer can be told, and what cannot be printed."""

from __future__ import annotations

import math

import pytest

from decmcts.errors import InputError
from decmcts.formats.mesh import SliceOptions


@pytest.mark.parametrize(
    "wrong",
    [{"layer_height": 0.5}, {"layer_height": math.nan}, {"density": 1.5}, {"perimeters": -1},
     {"nozzle": 0.0}, {"travel_feed": 0.0}, {"skirts": -1}, {"width": 5.0}],
)  # fmt: skip
def test_options_that_cannot_be_printed_are_refused(wrong):
    """A layer higher than the nozzle is wide does not stick; say so before slicing."""
    with pytest.raises(InputError, match=next(iter(wrong)).replace("_", "[_ ]")):
        SliceOptions(**wrong)


def test_temperatures_nothing_flows_at_are_refused():
    """A cold nozzle grinds the filament and prints nothing."""
    with pytest.raises(InputError, match="temperature 20 is out of bounds; give 150 to 500"):
        SliceOptions(temperature=20.0)
