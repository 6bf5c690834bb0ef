"""Byte-level scanner of G-code lines, on plain arrays.

One pass over the bytes of a file gives, per line, the command letter, its
number and the values of the parameters that motion needs. What the commands
mean is not decided here.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.compiled import kernel

X, Y, Z, E, F, OFFSET_I, OFFSET_J, R, D, S, P = range(11)  # columns of `values`
N_PARAMETERS = 11
OTHER = 63  # '?': a line that is no G, M or T command (a macro)

FINE = 0
NO_NUMBER = 1  # a parameter without its number
BAD_NUMBER = 2  # 1.2.3
EXTRA_AXIS = 3  # A, B, C, U, V, W on a move
BAD_CHARACTER = 4
EXPONENT = 5  # 1e5: one number to some firmwares, 1 and a word E5 to others
TWICE = 6  # X1 X2: firmwares take the first or the last


@kernel
def parse_number(text: NDArray[np.uint8], at: int, end: int) -> Any:
    """Return (value, next position, decimals); next == at when there is no number.

    Exact to the last bit for up to 15 digits: one integer divided by a power of ten.
    """
    i = at
    negative = False
    if i < end and (text[i] == 45 or text[i] == 43):
        negative = text[i] == 45
        i += 1
    mantissa, digits, decimals, point = 0, 0, 0, False
    while i < end:
        c = text[i]
        if 48 <= c <= 57:
            if digits < 18:
                mantissa = mantissa * 10 + (int(c) - 48)  # text is of bytes, which overflow
                decimals += 1 if point else 0
            elif not point:
                decimals -= 1
            digits += 1
        elif c == 46 and not point:
            point = True
        else:
            break
        i += 1
    if digits == 0:
        return 0.0, at, 0
    value = mantissa / 10.0**decimals if decimals > 0 else mantissa * 10.0 ** (-decimals)
    return (-value if negative else value), i, max(0, decimals)


@kernel
def has_exponent(text: NDArray[np.uint8], at: int, end: int) -> bool:
    """Tell whether an `e` and a number stand right behind a number that ends at `at`.

    Only the small letter: `X1E5` is two words, as files without blanks have them.
    """
    if at >= end or text[at] != 101:
        return False
    i = at + 1
    if i < end and (text[i] == 45 or text[i] == 43):
        i += 1
    return bool(i < end and 48 <= text[i] <= 57)


@kernel
def _column(letter: int) -> int:
    """Return the column of a parameter letter, -1 for one that is not kept, -2 for an axis."""
    if 88 <= letter <= 90:  # X Y Z
        return letter - 88
    if letter == 69:  # E
        return 3
    if letter == 70:  # F
        return 4
    if letter == 73 or letter == 74:  # I J
        return letter - 73 + 5
    if letter == 82:  # R
        return 7
    if letter == 68:  # D
        return 8
    if letter == 83:  # S
        return 9
    if letter == 80:  # P
        return 10
    if 65 <= letter <= 67 or 85 <= letter <= 87:  # A B C U V W
        return -2
    return -1


@kernel
def _skip_blank(text: NDArray[np.uint8], at: int, end: int) -> int:
    """Return the position after blanks and ( comments )."""
    i = at
    while i < end:
        if text[i] == 40:
            while i < end and text[i] != 41:
                i += 1
            i += 1
        elif text[i] == 32 or text[i] == 9 or text[i] == 13:
            i += 1
        else:
            break
    return min(i, end)


@kernel
def _parameters(
    text: NDArray[np.uint8],
    at: int,
    end: int,
    strict: bool,
    small: bool,
    values: Floats,
    decimals: Ints,
) -> int:
    """Write the parameters of one command into `values`; return the fault, or FINE.

    In a command in `small` letters `x1e5` is two words, but not `e1e5`.
    """
    i = _skip_blank(text, at, end)
    while i < end and text[i] != 42:
        letter = text[i] & 0xDF
        if not 65 <= letter <= 90:
            return BAD_CHARACTER
        i = _skip_blank(text, i + 1, end)
        value, after, places = parse_number(text, i, end)
        if after == i and strict:
            return NO_NUMBER
        if after > i and not (small and letter != 69) and has_exponent(text, after, end):
            return EXPONENT
        i = after
        if i < end and text[i] == 46:
            return BAD_NUMBER
        column = _column(letter)
        if column == -2 and strict:
            return EXTRA_AXIS
        if column >= 0:
            if strict and not math.isnan(values[column]):
                return TWICE
            values[column] = value
            if places > decimals[column]:
                decimals[column] = places
        i = _skip_blank(text, i, end)
    return FINE


@kernel
def _after_line_number(text: NDArray[np.uint8], at: int, end: int) -> int:
    """Return the position after an N line number, if there is one."""
    i = _skip_blank(text, at, end)
    if i < end and (text[i] & 0xDF) == 78:
        j = _skip_blank(text, i + 1, end)
        _, after, _ = parse_number(text, j, end)
        if after > j:
            return _skip_blank(text, after, end)
    return i


@kernel
def _wants_values(letter: int, code: int) -> bool:
    """Tell whether motion needs the parameters of this command."""
    if letter == 71:  # G0-G3, G10, G11, G28, G92
        return code <= 30 or code == 100 or code == 110 or code == 280 or code == 920
    return letter == 77 and code == 2000  # M200


@kernel
def scan_lines(
    text: NDArray[np.uint8],
    starts: Ints,
    ends: Ints,
    letter: NDArray[np.uint8],
    code: Int32s,
    values: Floats,
    fault: NDArray[np.uint8],
    decimals: Ints,
    comment: Ints,
) -> None:
    """Fill letter, code (number times ten), values, fault and comment start, in place.

    A comment starts at ``;``, or where the line ends.
    """
    for n in range(len(starts)):
        end = starts[n]
        while end < ends[n] and text[end] != 59:
            end += 1
        comment[n] = end
        i = _after_line_number(text, starts[n], end)
        if i >= end or text[i] == 42 or text[i] == 37:  # nothing, a checksum, or %
            continue
        first = text[i] & 0xDF
        letter[n] = OTHER
        number, after, places = parse_number(text, i + 1, end)
        known = first == 71 or first == 77 or first == 84
        if not known or after == i + 1 or places > 1 or number < 0 or number > 1e6:
            continue
        letter[n] = first
        code[n] = int(number * 10 + 0.5)
        if _wants_values(first, code[n]):
            motion = first == 71 and code[n] <= 30
            fault[n] = _parameters(text, after, end, motion, text[i] != first, values[n], decimals)
