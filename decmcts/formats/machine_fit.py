"""Whether a print and a machine go together, before anything is planned."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.print.contours import Contours, Role
from decmcts.print.machine import Head, Machine

_TOLERANCE_MM = 0.01  # slicers round coordinates
_AXES = "xyz"


def check_fits(contours: Contours, machine: Machine) -> None:
    """Raise InputError when the print is larger than the bed or no head reaches a contour.

    Where on the bed a print lies is the source's business: beds differ in their
    origin, and the order of a print does not depend on it. What is refused is a
    size no place on the bed can hold, and what lies beyond the reach of every
    head that may print it. Role CUSTOM is let through the size check: start
    G-code draws its purge line beside the bed on purpose.
    """
    if not len(contours):
        return
    at = contours.offsets[:-1]
    low = np.minimum.reduceat(contours.points, at)
    high = np.maximum.reduceat(contours.points, at)
    _check_size(contours, low, high, machine)
    _check_reach(contours, low, high, machine)


def _check_size(
    contours: Contours, low: NDArray[np.float64], high: NDArray[np.float64], machine: Machine
) -> None:
    printed = contours.role != Role.CUSTOM
    if not printed.any():
        return
    half = contours.width[printed, None] / 2.0
    first = (low[printed, :2] - half).min(axis=0)
    last = (high[printed, :2] + half).max(axis=0)
    bed = np.subtract(machine.bed_max, machine.bed_min)
    if (last - first > bed + _TOLERANCE_MM).any():
        width, depth = (last - first).tolist()
        raise InputError(
            f"the print is {width:.1f} x {depth:.1f} mm, larger than the bed of"
            f" {machine.name!r}, {bed[0]:g} x {bed[1]:g} mm",
            advice="choose a machine with a larger bed",
        )


def _check_reach(
    contours: Contours, low: NDArray[np.float64], high: NDArray[np.float64], machine: Machine
) -> None:
    reached = np.zeros(len(contours), np.bool_)
    for head in machine.heads:
        reached |= _reaches(head, low, high) & _has_tool(head, contours.tool)
    if reached.all():
        return
    first = int(np.flatnonzero(~reached)[0])
    spans = ", ".join(
        f"{axis} {a:.1f}..{b:.1f}"
        for axis, a, b in zip(_AXES, low[first], high[first], strict=True)
    )
    raise InputError(
        f"no head of {machine.name!r} can print contour {first} (tool {contours.tool[first]},"
        f" {spans}); {int((~reached).sum())} contours are beyond reach",
        line=int(contours.line[first]) or None,
        advice="move the print, or choose another machine",
    )


def _reaches(head: Head, low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.bool_]:
    inside = (low >= np.array(head.reach_min) - _TOLERANCE_MM) & (
        high <= np.array(head.reach_max) + _TOLERANCE_MM
    )
    return np.asarray(inside.all(axis=1))


def _has_tool(head: Head, tool: NDArray[np.int16]) -> NDArray[np.bool_]:
    if not head.tools:
        return np.ones(len(tool), np.bool_)
    return np.isin(tool, head.tools)
