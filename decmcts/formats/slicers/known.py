"""All dialects, found in this folder, and their words together."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from itertools import chain
from pathlib import Path
from pkgutil import iter_modules
from typing import cast

from decmcts.formats.slicers.dialect import Dialect

_NO_SLICER = ("dialect", "known")


_MODULES = sorted(module.name for module in iter_modules([str(Path(__file__).parent)]))
DIALECTS = tuple(
    cast(Dialect, import_module(f"{__package__}.{name}").DIALECT)
    for name in _MODULES
    if name not in _NO_SLICER
)


@cache
def every(field: str) -> tuple[str, ...]:
    """Return what any dialect has in a field, each word or key once.

    Examples
    --------
    >>> every("bare_inside")
    ('only_retract_when_crossing_perimeters',)
    """
    return tuple(dict.fromkeys(chain.from_iterable(getattr(each, field) for each in DIALECTS)))


@cache
def together(field: str) -> dict[str, str]:
    """Return the mappings of a field as one."""
    return {key: value for each in DIALECTS for key, value in getattr(each, field).items()}


def either(field: str) -> bytes:
    """Return a pattern of any word of a field, the longest first where one begins another."""
    return "|".join(map(re.escape, sorted(every(field), key=len, reverse=True))).encode()
