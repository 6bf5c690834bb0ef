"""Whether a print and a machine go together, before anything is planned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats
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
    able = [_reaches(head, low, high) & _has_tool(head, contours.tool) for head in machine.heads]
    require_printable(contours, machine, np.stack(able, axis=1))


def refuse_unknown_head(option: str, text: str, name: str, machine: Machine) -> None:
    """Raise InputError where a machine has no head of a name that an option states."""
    names = [head.name for head in machine.heads]
    if name not in names:
        raise InputError(
            f"{option} {text}: the machine has no head {name!r}",
            advice=f"its heads are {', '.join(names)}",
        )


def _check_size(contours: Contours, low: Floats, high: Floats, machine: Machine) -> None:
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


def require_printable(
    contours: Contours,
    machine: Machine,
    able: Flags,
    *,
    live: Sequence[int] | None = None,
) -> None:
    """Raise InputError naming the first contour that no head is `able` to print, and why.

    Parameters
    ----------
    able : (n, heads) which head can print which contour
    live : heads that are there; None: not known
    """
    missing = np.flatnonzero(~able.any(axis=1))
    if not len(missing):
        return
    c = int(missing[0])
    low, high = contours.polyline(c).min(axis=0), contours.polyline(c).max(axis=0)
    spans = ", ".join(
        f"{axis} {a:.2f}..{b:.2f}" for axis, a, b in zip(_AXES, low, high, strict=True)
    )
    why, advice = _reason(contours, machine, c, live)
    raise InputError(
        f"no head of {machine.name!r} can print contour {c} (tool {contours.tool[c]}, {spans} mm),"
        f" {len(missing)} such contours in all: {why}",
        line=int(contours.line[c]) or None,
        advice=advice,
    )


def _reason(
    contours: Contours, machine: Machine, c: int, live: Sequence[int] | None
) -> tuple[str, str]:
    """Return why no head prints a contour, and what to do: tool, reach, lost, no way to it."""
    points, tool = contours.polyline(c), contours.tool[c : c + 1]
    low, high = points.min(axis=0)[None], points.max(axis=0)[None]
    armed = [r for r, head in enumerate(machine.heads) if _has_tool(head, tool)[0]]
    if not armed:
        return (
            f"no head has tool {tool[0]}",
            "give it to a head (`tools` of the machine file), or choose a machine that has it",
        )
    near = [r for r in armed if _reaches(machine.heads[r], low, high)[0]]
    if not near:
        those = "no head" if len(armed) == len(machine.heads) else f"no head with tool {tool[0]}"
        around = ""
        if contours.role[c] == Role.SKIRT_BRIM:
            around = "slice it without skirt or brim, or "
        return (
            f"{those} reaches it",
            f"move the print into reach, or {around}choose another machine",
        )
    there = near if live is None else [r for r in near if r in live]
    names = " and ".join(machine.heads[r].name for r in there or near)
    if not there:
        return f"only {names} could print it, which is lost", ""
    lost = " (or what could print it is lost)" if live is None else ""
    return (
        f"the others cannot make way for {names}, which reach{'es' * (len(there) == 1)} it{lost}",
        "give `slices` no larger than the heads are, which count as going up for ever (`clearance`"
        " fills the bed), lessen head_clearance_mm or a rail's separation_mm, or move parks",
    )


def _reaches(head: Head, low: Floats, high: Floats) -> Flags:
    inside = (low >= np.array(head.reach_min) - _TOLERANCE_MM) & (
        high <= np.array(head.reach_max) + _TOLERANCE_MM
    )
    return np.asarray(inside.all(axis=1))


def _has_tool(head: Head, tool: NDArray[np.int16]) -> Flags:
    if not head.tools:
        return np.ones(len(tool), np.bool_)
    return np.isin(tool, head.tools)
