"""What all tests share."""

from __future__ import annotations

from functools import wraps
from typing import Any

from decmcts.print.machine import Machine, Rail

_made = Machine.__init__


@wraps(_made)
def _with_one_rail(
    self: Machine, *args: Any, rail: Rail | str | None = "not given", **named: Any
) -> None:
    """Take `rail=`, which `Machine` had before `rails`: tests of `team` still say it."""
    if rail != "not given":
        named["rails"] = () if rail is None else (rail,)
    _made(self, *args, **named)


Machine.__init__ = _with_one_rail  # type: ignore[method-assign]  # see above
