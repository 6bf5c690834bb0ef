"""Arguments of public functions and fields of options, held to what their annotations say.

Numbers are finite and at least 0; those within a tuple or mapping may be below.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import fields
from enum import StrEnum
from functools import cache, wraps
from inspect import isclass, signature
from itertools import cycle, repeat
from numbers import Real
from types import NoneType, UnionType
from typing import Any, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from decmcts.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")
_WORDS = {
    bool: "True or False", int: "at least 0 and whole", float: "at least 0 and finite",
    NoneType: "None",
}  # fmt: skip
_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function with a check of its arguments: InputError names what does not fit."""
    expected = signature(function)

    @wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        given, hints = expected.bind(*args, **kwargs), _hints(function)
        for name in [name for name in given.arguments if name in hints]:
            given.arguments[name] = _held(name, given.arguments[name], hints[name])
        return function(*given.args, **given.kwargs)

    return called


def check_fields(options: Any) -> None:
    """Raise InputError for a field of a new dataclass that does not fit; make enums of names."""
    hints = _hints(type(options))
    for field in fields(options):
        held = _held(field.name, getattr(options, field.name), hints[field.name])
        object.__setattr__(options, field.name, held)  # the dataclass is frozen


def _held(name: str, value: Any, hint: Any) -> Any:
    if not _fits(value, hint):
        raise InputError(f"{name} is {reprlib.repr(value)}, must be {_words(hint)}")
    enums = [one for one in _choices(hint) if isclass(one) and issubclass(one, StrEnum)]
    return enums[0](value) if enums and isinstance(value, str) else value


def _fits(value: Any, hint: Any, least: float = 0.0) -> bool:
    """Tell whether a value is what a type says; a number must be at least `least`."""
    kind, parts = _origin(hint), get_args(hint)
    if len(choices := _choices(hint)) > 1:
        return any(_fits(value, one, least) for one in choices)
    if hint in (int, float):
        number = isinstance(value, int | np.integer if hint is int else Real)
        return number and not isinstance(value, bool) and least <= value < math.inf
    if kind is np.ndarray:
        return _is_numbers(value)
    if kind is None and issubclass(hint, StrEnum):
        return isinstance(value, str) and value in tuple(hint)
    if kind is None:
        return isinstance(value, hint)
    if not issubclass(kind, Collection):
        return callable(value)
    if not isinstance(value, kind) or isinstance(value, str | bytes):
        return False
    if issubclass(kind, Mapping):
        return _all_fit(value, parts[:1]) and _all_fit(value.values(), parts[1:])
    if kind is tuple and ... not in parts:
        return len(value) == len(parts) and _all_fit(value, parts)
    return _all_fit(value, parts[:1])


def _all_fit(values: Iterable[Any], parts: tuple[Any, ...]) -> bool:
    """Tell whether values are what their types say, in turn."""
    return all(map(_fits, values, cycle(parts), repeat(-math.inf)))


def _is_numbers(value: Any) -> bool:
    try:
        return np.asarray(value).dtype.kind in "iuf"
    except ValueError:  # rows of unlike lengths
        return False


def _origin(hint: Any) -> Any:
    """Return the class that a hint gives parameters to, or None: also of an alias.

    numpy 2.5 states `NDArray` as an alias of `ndarray` where Python knows such (3.12).
    """
    kind = get_origin(hint)
    stands_for = getattr(kind, "__value__", None)
    return kind if stands_for is None else get_origin(stands_for)


def _choices(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _words(hint: Any) -> str:
    """Return in words what may be given."""
    if len(choices := _choices(hint)) > 1:
        return " or ".join(map(_words, choices))
    kind = _origin(hint)
    if kind is np.ndarray:
        return "an array of numbers"
    if kind is not None and not issubclass(kind, Collection):
        return "a function"
    if kind is not None:
        return f"a {kind.__name__.lower()} of {_words(get_args(hint)[-1])}"
    if issubclass(hint, StrEnum):
        return f"one of {', '.join(hint)}"
    return _WORDS.get(hint, f"a {hint.__name__}")
