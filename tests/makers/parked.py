"""A machine for a plan made by hand: its heads, and where they park."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from decmcts.print.machine import Head, Machine, Point
from decmcts.print.plan import JointPlan


def parked(plan: JointPlan, parks: Sequence[Point], **values: Any) -> Machine:
    """Return a machine with the heads of a plan, parked there; `values` are its own."""
    heads = tuple(
        Head(actions.head, (), park=park) for actions, park in zip(plan.heads, parks, strict=True)
    )
    return Machine("made", (0.0, 0.0), (200.0, 200.0), heads, **values)
