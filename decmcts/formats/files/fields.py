"""Strict reading of nested mappings that came from a file.

Each check names the place in the file ("heads[1].park: ..."). What the fields
mean lives with the format that reads them, not here.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from decmcts.arrays import Floats
from decmcts.errors import InputError
from decmcts.formats.files.bounds import LARGEST_MM

_NUMBERS = frozenset({int, float})
_LARGEST = 1e9  # beyond any machine; its square is far from overflow


@dataclass(frozen=True, slots=True)
class Fields:
    """One mapping of a file and where it stands there."""

    values: Mapping[str, Any]
    where: str = ""  # e.g. ``heads[1]``; empty for the top level
    path: Path | str | None = None  # for messages

    @staticmethod
    def of(value: Any, where: str, path: Path | str | None) -> Fields:
        """Wrap `value`; raises InputError unless it is a mapping."""
        if not isinstance(value, Mapping):
            fail(where, f"expected a table, found {shown(value)}", path)
        return Fields(value, where, path)

    def at(self, key: str) -> str:
        """Return the full place of one key."""
        return f"{self.where}.{key}" if self.where else key

    def fail(self, key: str, what: str, advice: str = "") -> NoReturn:
        """Raise InputError about one key."""
        fail(self.at(key), what, self.path, advice)

    def only(self, *known: str) -> None:
        """Refuse keys other than `known`, most likely typing errors."""
        for key in self.values:
            if key not in known:
                self.fail(str(key), "unknown key", f"known here: {', '.join(known)}")

    def need(self, key: str) -> Any:
        """Return a value that must be there."""
        if key not in self.values:
            self.fail(key, "missing")
        return self.values[key]

    def table(self, key: str) -> Fields:
        """Return a nested mapping."""
        return Fields.of(self.need(key), self.at(key), self.path)

    def tables(self, key: str, default: list[Any] | None = None) -> list[Fields]:
        """Return a list of mappings."""
        return [
            Fields.of(item, f"{self.at(key)}[{i}]", self.path)
            for i, item in enumerate(self.items(key, default))
        ]

    def items(self, key: str, default: list[Any] | None = None) -> list[Any]:
        """Return a list."""
        value = self.need(key) if default is None else self.values.get(key, default)
        if not isinstance(value, list):
            self.fail(key, f"expected a list, found {shown(value)}")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string that can be written: no half of a surrogate pair, as JSON may hold."""
        value = self.need(key) if default is None else self.values.get(key, default)
        if not isinstance(value, str):
            self.fail(key, f"expected a text, found {shown(value)}")
        if not value.isascii() and any("\ud800" <= c <= "\udfff" for c in value):
            self.fail(key, f"{shown(value)} is no text: it holds half of a surrogate pair")
        return value

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        least: float = -math.inf,
        most: float = _LARGEST,
    ) -> float:
        """Return a finite number not below `least`, its size at most `most`."""
        value = self.need(key) if default is None else self.values.get(key, default)
        if type(value) not in _NUMBERS or not abs(value) <= most:
            self.fail(key, f"expected a finite number up to {most:g}, found {shown(value)}")
        if value < least:
            self.fail(key, f"{value:g} is below {least:g}")
        return float(value)

    def size(self, key: str, default: float | None = None) -> float:
        """Return a length in mm, from 0, no larger than any printer has."""
        return self.number(key, default, least=0.0, most=LARGEST_MM)

    def integer(self, key: str, *, least: int, below: int) -> int:
        """Return an integer in least..below-1."""
        value = self.need(key)
        if type(value) is not int or not least <= value < below:
            self.fail(key, f"expected an integer in {least}..{below - 1}, found {shown(value)}")
        return int(value)

    def flag(self, key: str, default: bool | None = None) -> bool:
        """Return true or false."""
        value = self.need(key) if default is None else self.values.get(key, default)
        if type(value) is not bool:
            self.fail(key, f"expected true or false, found {shown(value)}")
        return bool(value)

    def point(self, key: str, size: int, *, most: float = _LARGEST) -> tuple[float, ...]:
        """Return `size` finite numbers."""
        row = points([self.need(key)], (size,), self.at(key), self.path, most=most)[0]
        return tuple(row.tolist())

    def pair(self, key: str) -> tuple[float, float]:
        """Return a place on the bed, mm."""
        x, y = self.point(key, 2, most=LARGEST_MM)
        return x, y

    def triple(self, key: str, *, most: float = LARGEST_MM) -> tuple[float, float, float]:
        """Return a place in space, mm, each coordinate up to `most` either way."""
        x, y, z = self.point(key, 3, most=most)
        return x, y, z


def points(
    value: Any,
    sizes: Sequence[int],
    where: str,
    path: Path | str | None = None,
    *,
    most: float = _LARGEST,
) -> Floats:
    """Return (k, d) float64 from a list of rows of finite numbers, d one of `sizes`.

    Raises InputError naming the first row that is no such thing.
    """
    if not isinstance(value, list) or any(type(row) is not list for row in value):
        fail(where, f"expected lists of {' or '.join(map(str, sizes))} numbers", path)
    lengths = set(map(len, value))
    if value and (len(lengths) != 1 or not lengths <= set(sizes)):
        bad = next(
            i for i, row in enumerate(value) if len(row) not in sizes or len(row) != len(value[0])
        )
        fail(where, f"row {bad} has {len(value[bad])} numbers, expected {sizes[0]}", path)
    flat = list(chain.from_iterable(value))
    table = numbers(flat, where, path, most=most)
    return table.reshape(len(value), -1 if value else sizes[0])


def numbers(
    flat: Any,
    where: str,
    path: Path | str | None = None,
    *,
    least: float = -math.inf,
    most: float = _LARGEST,
) -> Floats:
    """Return (k,) float64 from a list of finite numbers, or raise InputError."""
    if not isinstance(flat, list):
        fail(where, f"expected numbers, found {shown(flat)}", path)
    if not set(map(type, flat)) <= _NUMBERS:
        bad = next(v for v in flat if type(v) not in _NUMBERS)
        fail(where, f"expected numbers, found {shown(bad)}", path)
    try:
        table = np.array(flat, np.float64)
    except OverflowError:
        fail(where, "a number is too large", path)
    sound = np.abs(table) <= most
    if not sound.all():
        bad = int(np.flatnonzero(~sound)[0])
        fail(where, f"number {bad} is {table[bad]:g}, not finite or beyond ±{most:g}", path)
    if (table < least).any():
        bad = int(np.flatnonzero(table < least)[0])
        fail(where, f"number {bad} is {table[bad]:g}, below {least:g}", path)
    return table


def shown(value: Any) -> str:
    """Return a value short enough for an error line."""
    text = reprlib.repr(value)  # a file may hold lists of millions, nested deeply
    return text if len(text) <= 40 else f"{text[:37]}..."


def fail(where: str, what: str, path: Path | str | None = None, advice: str = "") -> NoReturn:
    """Raise InputError about one place of a file."""
    raise InputError(f"{where}: {what}" if where else what, path=path, advice=advice)
