"""Reading numbers, with and without the compiler."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.formats.gcode.text.scan_kernels import parse_number


@pytest.mark.parametrize("read", [parse_number, parse_number.py_func], ids=["compiled", "python"])
@pytest.mark.parametrize(
    ("text", "value"),
    [("300", 300.0), ("-12.34567", -12.34567), ("123456789012.5", 123456789012.5)],
)
def test_numbers_of_more_than_a_byte(read, text, value):
    """Text is of bytes: without the compiler its sums are too, and `300` overflows."""
    raw = np.frombuffer(text.encode(), np.uint8)
    found, behind, _ = read(raw, 0, len(raw))
    assert (found, behind) == (value, len(raw))
