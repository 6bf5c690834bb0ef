"""Heat of several heads, as the judge finds it."""

from __future__ import annotations

import pytest

from sim.heads.heat import Due, Heat, heat_of, unheated


@pytest.mark.parametrize(
    ("code", "heat"),
    [
        (b"M104 S210", Heat(False, True, None)),
        (b"m109 R180 T1", Heat(True, True, 1)),
        (b"M104 T0 S0", Heat(False, False, 0)),
        (b"M109", Heat(True, True, None)),
        (b"M104 S{temperature}", Heat(False, True, None)),
        (b"M104 S", Heat(False, True, None)),
        (b"M109S.0T1", Heat(True, False, None)),
        (b"M140 S60", None),
        (b"M1040 S60", None),
    ],
)
def test_what_a_command_says_to_a_hot_end(code: bytes, heat: Heat | None) -> None:
    """Which tool, how hot, and whether to wait."""
    assert heat_of(code) == heat


@pytest.mark.parametrize(
    ("codes", "wrong"),
    [
        ([b"M104 S210", b"M109 S210", b"G1 X1 E1", b"M104 S0"], None),
        ([b"G28", b"G28", b"G1 X1 E1", b"M104 S0"], "was not heated"),
        ([b"M109 S210", b"M104 S0", b"G1 X1 E1", b"M104 S0"], "was not heated"),
        ([b"M104 S210", b"G28", b"G1 X1 E1", b"M104 S0"], "has not waited"),
        ([b"M104 S210", b"M109 S210", b"G1 X1 E1", b"M104 S200"], "stays hot"),
    ],
)
def test_a_head_that_prints_is_hot_before_and_off_afterwards(
    codes: list[bytes], wrong: str | None
) -> None:
    """The first bead stands in line 3."""
    found = unheated(list(enumerate(codes, 1)), 3, Due(False, True, True, True))
    assert (wrong is None and not found) or (len(found) == 1 and str(wrong) in found[0])
