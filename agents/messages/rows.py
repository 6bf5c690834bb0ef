"""Values of msgpack checked by the type of the field that they are for.

Every reader returns a value of its type or raises `MessageError`; nothing is converted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, TypeVar, get_type_hints

import msgpack

from agents.messages.kinds import MessageError, Stage

T = TypeVar("T")
Position = tuple[float, float, float]


def unpacker(size: int, *, items: int, text: int, binary: int = 0, pairs: int = 0) -> Any:
    """Return msgpack's reader for so many bytes, with limits for each array, text and map.

    Without them five bytes announce an array of 2^32 items, which is made at once.
    """
    return msgpack.Unpacker(
        max_buffer_size=size, max_array_len=items, max_str_len=text, max_bin_len=binary,
        max_map_len=pairs, max_ext_len=0, strict_map_key=True,
    )  # fmt: skip


def array(value: object, length: int | None = None) -> list[Any]:
    """Return an array, of so many items if that is known."""
    if not isinstance(value, list) or (length is not None and len(value) != length):
        raise MessageError(f"expected an array of {length if length is not None else 'items'}")
    return value


def _only(kind: type[T], name: str) -> Callable[[object], T]:
    """Return what reads values of exactly one type."""

    def read(value: object) -> T:
        if type(value) is not kind:
            raise MessageError(f"expected {name}, got {type(value).__name__}")
        return value

    return read


integer = _only(int, "an integer")
text = _only(str, "text")
_number = _only(float, "a number as a float")


def _place(value: object) -> Position:
    x, y, z = map(_number, array(value, 3))
    return x, y, z


PLAIN: Mapping[Any, Callable[[object], Any]] = {
    int: integer,
    str: text,
    bool: _only(bool, "true or false"),
    float: _number,
    Position: _place,
    Stage: lambda value: Stage(integer(value)),
    tuple[int, ...]: lambda value: tuple(map(integer, array(value))),
}
"""What reads a field, by its type."""


fields_of: Callable[[Any], Mapping[str, Any]] = cache(get_type_hints)
"""Types of a dataclass's fields by name, in their order; found once: it takes long."""


def read_row(kind: type[T], row: object) -> T:
    """Return the dataclass whose fields, all of them plain, a row holds in their order."""
    kinds = fields_of(kind).values()
    items = array(row, len(kinds))
    return kind(*(PLAIN[of](item) for of, item in zip(kinds, items, strict=True)))
