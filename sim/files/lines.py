"""Which lines of a file have to be looked at one by one: all the others are found at once.

Nearly all lines of a file are plain moves or comments. Neither of these functions decides what a
line commands. They only name the lines that whoever asks would pass over, so that the rest alone
is read with regular expressions.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sim.arrays import Flags, Ints

_ONE_DIGIT = bytes.maketrans(b"23456789", b"11111111")
_ZERO, _NINE, _DOT, _END = 48, 57, 46, 10

T = TypeVar("T", bound=Hashable)
Bytes = NDArray[np.uint8]


def not_plain(text: bytes, plain: re.Pattern[bytes]) -> list[int]:
    """Return the lines, from 0, whose shape `plain` does not match.

    The shape of a line has each number's run of digits cut to its first, 1 for all but 0. Only
    the second byte of a line, the number of its command, stays what it is. A pattern that asks
    of numbers only whether there are digits, or one above 0, so matches no shape of a line that
    it does not match.
    """
    shapes = _shapes(text).split(b"\n")
    passed = {shape for shape in set(shapes) if plain.match(shape)}
    return [k for k, shape in enumerate(shapes) if shape not in passed]


def _shapes(text: bytes) -> bytes:
    raw = np.frombuffer(text, np.uint8)
    if not len(raw):
        return b""
    shape = np.frombuffer(text.translate(_ONE_DIGIT), np.uint8).copy()
    digit = _digits(raw)
    kept = np.ones(len(raw), np.bool_)
    np.logical_and(digit[1:], digit[:-1], out=kept[1:])
    np.logical_not(kept[1:], out=kept[1:])
    second = np.concatenate([[0], np.flatnonzero(raw == _END) + 1]) + 1
    shape[second[second < len(raw)]] = raw[second[second < len(raw)]]
    kept[second[second + 1 < len(raw)] + 1] = True  # so that 12 is not 1
    return shape[kept].tobytes()


def _digits(raw: Bytes) -> Flags:
    return np.asarray((raw >= _ZERO) & (raw <= _NINE))


def no_comment_no_move(text: bytes) -> Iterator[tuple[int, int]]:
    """Yield number, from 1, and first byte of each line that may be neither comment nor G0 to G3.

    Empty lines and those that begin with a semicolon are left out, and moves written with one
    digit; others may be among what is yielded. What begins with a comment in brackets is, as a
    command may stand behind it.
    """
    raw = np.frombuffer(text + b"\n\n\n", np.uint8)
    starts = np.concatenate([[0], np.flatnonzero(raw[: len(text)] == _END) + 1])
    first, second, third = (raw[starts + k] for k in range(3))
    move = ((first == ord("G")) | (first == ord("g"))) & (second >= _ZERO) & (second <= _ZERO + 3)
    move &= ~(_digits(third) | (third == _DOT))
    left = np.flatnonzero(~move & ~np.isin(first, (ord(";"), ord("\r"), _END)))
    return zip((left + 1).tolist(), starts[left].tolist(), strict=True)


def in_force(changes: Sequence[tuple[int, T]], number: Mapping[T, int], line: Ints) -> Ints:
    """Return the number of what holds at each line, (n,).

    `changes` are lines, from 1, and what holds behind each; first of all in line 0.
    """
    rows = np.array([row for row, _ in changes], np.int64)
    held = np.array([number[value] for _, value in changes], np.int64)
    return np.asarray(held[np.searchsorted(rows, line, side="left") - 1])
