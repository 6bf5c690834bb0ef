"""How the nozzles of a machine keep apart, whatever their bodies: all that planners know of it.

Each head is moved by itself. Today only rails keep nozzles apart; a machine without them is a
gantry for each head, where bodies alone count. The judge has rules of its own for the same
(`sim.replay.shapes.separations_between`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decmcts.print.machine import Machine


@dataclass(frozen=True, slots=True)
class Separation:
    """Of two heads a and b: (nozzle of b - nozzle of a) * `side` is at least `least_mm`."""

    axis: int  # 0: X, 1: Y
    side: int  # 1: b is higher along the axis, -1: lower
    least_mm: float


@dataclass(frozen=True, slots=True)
class FixedOrder:
    """All heads of a machine stand in one order along an axis, which none can leave."""

    axis: int  # 0: X, 1: Y
    apart_mm: float  # between the nozzles of neighbours, at least


def separations(machine: Machine, a: str, b: str) -> tuple[Separation, ...]:
    """Return what the nozzles of the heads of these names keep at all times."""
    found = []
    for rail in machine.rails:
        if a != b and {a, b} <= set(rail.order):
            steps = rail.order.index(b) - rail.order.index(a)
            side = 1 if steps > 0 else -1
            found.append(Separation(rail.axis, side, abs(steps) * rail.separation_mm))
    return tuple(found)


def fixed_order(machine: Machine) -> FixedOrder | None:
    """Return the order in which all heads stand; None where there is none."""
    names = {head.name for head in machine.heads}
    rails = (rail for rail in machine.rails if set(rail.order) == names)
    return next((FixedOrder(rail.axis, rail.separation_mm) for rail in rails), None)


def widest(machine: Machine) -> Separation | None:
    """Return the largest separation of two neighbouring heads; None where bodies alone count."""
    rail = max(machine.rails, key=lambda rail: rail.separation_mm, default=None)
    return Separation(rail.axis, 1, rail.separation_mm) if rail else None


def line_up(machine: Machine) -> tuple[int, tuple[int, ...]]:
    """Return the axis the heads stand along, and the heads in that order, the lowest first.

    That is the axis along which they keep apart, else the one along which parks lie farthest
    apart. Heads park in the order in which they stand.
    """
    parks = np.array([head.park[:2] for head in machine.heads], np.float64)
    kept = widest(machine)
    axis = int(np.argmax(np.ptp(parks, axis=0))) if kept is None else kept.axis
    return axis, tuple(np.argsort(parks[:, axis], kind="stable").tolist())
