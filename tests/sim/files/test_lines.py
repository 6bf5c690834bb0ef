"""Lines that may be passed over are passed over by the patterns too, whatever they look like."""

from __future__ import annotations

import random
import re

import pytest

from sim.files.commands import _PLAIN, PLAIN_MOVE, command_in, commands_of, not_plain

MOVE = re.compile(rb"G[0-3](?![\d.])", re.I)
NAMES = (b"G1", b"G12", b"G2", b"G01", b"g1", b"G1.", b"M104", b"", b";", b"(", b" ")
NUMBERS = (b"1", b"12", b".5", b"0.50", b"1.", b"00", b"0.0", b"1.2.3", b"", b"-7")


def line_of(rng: random.Random) -> bytes:
    """Return a line that is nearly a move, or one of any characters."""
    if rng.random() < 0.3:
        return bytes(rng.choices(b"G0123X Y.Z-EFIJ;\r (gM1", k=rng.randrange(12)))
    line = rng.choice(NAMES)
    for _ in range(rng.randrange(5)):
        line += rng.choice((b" ", b" ", b"  ", b"")) + bytes([rng.choice(b"XYZEFIJ")])
        line += rng.choice(NUMBERS)
    return line + rng.choice((b"", b"\r", b" "))


@pytest.mark.parametrize("seed", range(20))
def test_what_is_passed_over_is_a_move_or_a_comment(seed: int):
    """No line is taken for plain that the pattern of a move refuses."""
    rng = random.Random(seed)
    for _ in range(100):
        rows = [line_of(rng) for _ in range(rng.randrange(5))]
        text = b"\n".join(rows)
        left = set(not_plain(text, _PLAIN))
        passed = [row for k, row in enumerate(text.split(b"\n")) if k not in left]
        assert all(row[:1] == b";" or PLAIN_MOVE.match(row) for row in passed)


def test_plain_moves_are_passed_over():
    """Else each line of a file would be looked at one by one."""
    assert not_plain(b"G1 X1.25 Y-3 E.02\n; G1\nG1 Z0.2 F600\nG2 X1 Y1 I0 J2 E1\n", _PLAIN) == [4]
    assert not_plain(b"G1 X1 F0\nG12 X1\nG1 X1.2.3\nM106 S255", _PLAIN) == [0, 1, 2, 3]


@pytest.mark.parametrize("seed", range(20))
def test_what_is_passed_over_commands_nothing_but_moves(seed: int):
    """Lines that are looked at one by one are all others."""
    rng = random.Random(seed)
    for _ in range(100):
        text = b"\n".join(line_of(rng) for _ in range(rng.randrange(5))).replace(b"\r", b"")
        each = enumerate(map(command_in, text.split(b"\n")), 1)
        due = [(k, code) for k, code in each if code and not MOVE.match(code)]
        assert [(k, code) for k, code in commands_of(text) if not MOVE.match(code)] == due
