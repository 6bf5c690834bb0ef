"""What a head does where it stands idle, as a mapping: what is left out is the source's."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

from decmcts.formats.files.fields import Fields
from decmcts.print.idle import Idle

HOTTEST_C = 600.0
FASTEST_C_S = 100.0
MOST_MM = 20.0  # of filament; more pulls it out of the hot end
_LEAST_S = 1.0
_LEAST_C_S = 0.01


def idle_to_dict(idle: Idle) -> dict[str, Any]:
    """Return plain numbers that `idle_from` reads back equal."""
    return {name: value for name, value in asdict(idle).items() if value is not None}


def idle_from(given: Fields) -> Idle:
    """Return what a head's table `idle` says."""
    usual = Idle()
    if "idle" not in given.values:
        return usual
    table = given.table("idle")
    table.only(*(field.name for field in fields(Idle)))
    standby_c = _said(table, "standby_c", HOTTEST_C)
    return Idle(
        after_s=table.number("after_s", usual.after_s, least=_LEAST_S),
        standby_c=None if standby_c is None else round(standby_c, 1),  # as files state it
        heat_c_s=table.number("heat_c_s", usual.heat_c_s, least=_LEAST_C_S, most=FASTEST_C_S),
        retract_mm=_said(table, "retract_mm", MOST_MM),
        prime_mm=_said(table, "prime_mm", MOST_MM),
    )


def _said(table: Fields, key: str, most: float) -> float | None:
    return table.number(key, least=0.0, most=most) if key in table.values else None
