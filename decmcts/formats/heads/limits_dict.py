"""Motion limits as a mapping, of a machine or of one of its heads."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

import numpy as np

from decmcts.formats.files.fields import Fields
from decmcts.print.machine import MotionLimits

_MAY_BE_ZERO = ("jerk", "junction_deviation")


def limits_to_dict(limits: MotionLimits) -> dict[str, Any]:
    """Return plain numbers and lists that `limits_from` reads back equal."""
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in asdict(limits).items()
    }


def limits_from(given: Fields, usual: MotionLimits) -> MotionLimits:
    """Return what a table `limits` says, and for what it leaves out what is usual."""
    if "limits" not in given.values:
        return usual
    table = given.table("limits")
    names = [f.name for f in fields(MotionLimits)]
    table.only(*names)
    read = {name: _limit(table, name, getattr(usual, name)) for name in names}
    return MotionLimits(**read)


def _limit(table: Fields, name: str, usual: Any) -> Any:
    """Return one limit; those of axes are four numbers, x, y, z and e."""
    if name not in table.values:
        return usual
    value: Any = table.point(name, 4) if isinstance(usual, tuple) else table.number(name)
    least = float(np.min(value))
    if least < 0.0:
        table.fail(name, f"{least:g} is below 0")
    if least == 0.0 and name not in _MAY_BE_ZERO:
        table.fail(name, "0 would never arrive")
    return value
