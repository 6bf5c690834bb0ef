"""Heat of several heads, as the judge finds it."""

from __future__ import annotations

from math import inf

import pytest

from sim.heads.heat import Due, Heat, heat_of, heats_early, unheated


@pytest.mark.parametrize(
    ("code", "heat"),
    [
        (b"M104 S210", Heat(False, 210.0, None)),
        (b"m109 R180 T1", Heat(True, 180.0, 1)),
        (b"M104 T0 S0", Heat(False, 0.0, 0)),
        (b"M109", Heat(True, inf, None)),
        (b"M104 S{temperature}", Heat(False, inf, None)),
        (b"M104 S", Heat(False, inf, None)),
        (b"M109S.0T1", Heat(True, 0.0, 1)),
        (b"M140 S60", None),
        (b"M1040 S60", None),
    ],
)
def test_what_a_command_says_to_a_hot_end(code: bytes, heat: Heat | None) -> None:
    """Which tool, how hot, and whether to wait."""
    assert heat_of(code) == heat


@pytest.mark.parametrize(
    ("early", "count"),
    [
        ([], 0),
        ([b"M140 S60", b"M104 S150"], 2),
        ([b"M104 S150"], 1),
        ([b"M104 S215"], 0),  # hotter than the source is at first
        ([b"M104 S150", b"M104 S150"], 0),  # twice
        ([b"M109 S150"], 0),  # waits, so the others would too
        ([b"M140 S60", b"G28"], 0),  # more than heat
    ],
)
def test_a_head_may_heat_while_it_waits_its_turn(early: list[bytes], count: int) -> None:
    """As hot as its start code makes it first, and nothing else above its first wait."""
    start = [b"M104 S0", b"M190 S60", b"M109 R150", b"G28", b"M109 S215", b"M140 S70"]
    assert heats_early(list(enumerate(early, 1)), 9, start) == count
    assert heats_early(list(enumerate(early, 9)), 9, start) == 0


def test_a_start_code_that_begins_with_heat_is_not_taken_for_early_heat() -> None:
    """The first head waits for nobody; its first sync point stands below its whole start code."""
    start = [b"M104 S215", b"G28"]
    assert heats_early([(1, b"M104 S215"), (2, b"G28"), (3, b"G90")], 9, start) == 0
    assert heats_early([(1, b"M104 S215"), (3, b"M104 S215"), (4, b"G28")], 2, start) == 1


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
    rows = list(enumerate(codes, 1))
    found = unheated(rows, rows, 3, Due(False, True, True, True))
    assert (wrong is None and not found) or (len(found) == 1 and str(wrong) in found[0])
