"""Is this the print and the machine that were meant: contours and machine, field by field.

Prints that share hardly a segment are different prints. That is one fault: a fault for each
segment would tell nobody what is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.print.contours import PER_CONTOUR, Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Fenced, Head, Machine, MotionLimits
from sim.content.inventory import NO_MATCH, Segments
from sim.faults import Fault, FaultKind, listed

SAME = 1e-6  # mm or mm/s; plan.json keeps every bit, so nothing is rounded off

LITTLE = 0.1  # share of the smaller print's segments; with fewer in common they are two prints
FEW = 20  # segments; a smaller print has so few faults that all can be listed

PER_POINT = ("points", "extrusion", "feed")
_Whole = Machine | Head | MotionLimits


def check_print(ours: Segments, source: Segments, match: Ints, contour: Ints) -> list[Fault]:
    """Return one fault where ours and the source have hardly a segment in common.

    `match` says which segment of the source each of ours is, `contour` which contour each
    of the source's is of (below 0: of none).
    """
    there = match[match != NO_MATCH]
    sizes = (len(ours.ends), len(source.ends))
    if min(sizes) < FEW or len(there) >= LITTLE * min(sizes):
        return []
    found = np.zeros(len(source.ends), np.bool_)
    found[there] = True
    known = np.unique(contour[contour >= 0])
    whole = len(np.setdiff1d(known, contour[~found]))
    text = (
        f"{whole} of the source's {len(known)} contours and {len(there)} of its {sizes[1]} "
        "segments are in it; nothing else was compared"
    )
    return [Fault(FaultKind.OTHER_PRINT, text)]


def is_other_print(faults: Sequence[Fault]) -> bool:
    """Tell whether the fault found is that this is another print."""
    return any(fault.kind is FaultKind.OTHER_PRINT for fault in faults)


def check_contours(ours: Contours, source: Contours) -> list[Fault]:
    """Compare the contours of a plan with the source's, number by number.

    A plan may say of a contour that it must not be reversed where the source lets it be.
    """
    if len(ours) != len(source):
        text = f"the plan has {len(ours)} contours, the source {len(source)}"
        return [Fault(FaultKind.CONTOUR, text)]
    sizes, due = np.diff(ours.offsets), np.diff(source.offsets)
    odd = np.flatnonzero(sizes != due)
    if len(odd):
        lines = [f"contour {c} has {sizes[c]} points, in the source {due[c]}" for c in odd]
        return listed(FaultKind.CONTOUR, lines)
    source = replace(source, reversible=source.reversible & ours.reversible)
    owner = np.repeat(np.arange(len(ours)), sizes)
    faults: list[Fault] = []
    for name in PER_POINT + PER_CONTOUR:
        a = np.asarray(getattr(ours, name), np.float64)
        b = np.asarray(getattr(source, name), np.float64)
        off = np.flatnonzero((np.abs(a - b) > SAME).reshape(len(a), -1).any(axis=1))
        contour = owner[off] if name in PER_POINT else off
        rows = np.unique(contour, return_index=True)[1]
        lines = [
            f"contour {contour[k]}: {name} is {a[off[k]].tolist()}, in the source "
            f"{b[off[k]].tolist()}"
            for k in rows
        ]
        faults += listed(FaultKind.CONTOUR, lines)
    return faults


def check_accelerations(ours: Floats | None, source: PrintJob) -> list[Fault]:
    """Compare the accelerations a plan states, where it states any, with the source's."""
    due = source.accelerations
    if ours is None or len(ours) != len(due):
        return []  # other numbers of points are reported elsewhere
    off = np.flatnonzero(np.abs(ours - due) > SAME)
    contour = np.searchsorted(source.contours.offsets, off, side="right") - 1
    rows = np.unique(contour, return_index=True)[1]
    lines = [
        f"contour {contour[k]}: acceleration is {ours[off[k]]:g}, in the source {due[off[k]]:g}"
        for k in rows
    ]
    return listed(FaultKind.CONTOUR, lines)


def check_machine(ours: Machine, named: Machine, source: PrintJob | None) -> list[Fault]:
    """Compare a plan's machine with the one that was named, but for names and remarks.

    A plan for one head of several has that head alone. Where one head prints, it may
    park above the named park: a plan must not rest inside its print. Limits
    may be those that the source states; without a source they are not compared.
    """
    if len(ours.heads) == 1 < len(named.heads):
        one = [head for head in named.heads if head.name == ours.heads[0].name]
        named = named.alone(one[0]) if one else replace(named, heads=())
    if ours.release == "action":  # such a plan asks for less than any controller can do
        named = replace(named, release="action")
    names = [head.name for head in named.heads]
    if [head.name for head in ours.heads] != names:
        had = ", ".join(head.name for head in ours.heads)
        return [_differs("heads", had, ", ".join(names) or "other heads")]
    faults = _differing("", ours, named, but=("name", "source", "heads", "limits"))
    for head, due in zip(ours.heads, named.heads, strict=True):
        if len(names) == 1 and head.park[:2] == due.park[:2] and head.park[2] > due.park[2]:
            due = replace(due, park=head.park)
        if not due.tools:  # as of presets; then `launch` was told
            due = replace(due, tools=head.tools)
        faults += _differing(f"head {head.name}: ", head, due)
    if source is not None and not _same(ours.limits, named.limits):
        faults += _differing("limits: ", ours.limits, named.limits.under(source.limits))
    return faults


def check_living(ours: Machine, fenced: Fenced) -> list[Fault]:
    """Compare a plan's machine with the one it had before heads of it were fenced.

    Those that live are as they were, but that they may reach less far.
    """
    names = {head.name for head in ours.heads}
    if names & set(fenced.at):
        return [_differs("heads", ", ".join(sorted(names)), "those that are not fenced")]
    known = {head.name: head for head in ours.heads}
    heads = [
        _lessened(head, known[head.name]) for head in fenced.machine.heads if head.name in known
    ]
    return check_machine(ours, fenced.machine.of_heads(heads), None)


def _lessened(head: Head, ours: Head) -> Head:
    """Return a head with our reach, where that is no larger, or is empty along an axis."""
    within = all(
        (a <= low and high <= b) or low == high
        for a, low, high, b in zip(
            head.reach_min, ours.reach_min, ours.reach_max, head.reach_max, strict=True
        )
    )
    return replace(head, reach_min=ours.reach_min, reach_max=ours.reach_max) if within else head


def _differing(what: str, ours: _Whole, named: _Whole, but: Sequence[str] = ()) -> list[Fault]:
    """Return a fault for each field in which two of a kind differ, `but` some."""
    names = (field.name for field in fields(ours) if field.name not in but)
    pairs = ((name, getattr(ours, name), getattr(named, name)) for name in names)
    return [_differs(what + name, a, b) for name, a, b in pairs if not _same(a, b)]


def _same(a: object, b: object) -> bool:
    """Tell whether two values of a machine are equal, arrays and tuples member by member."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.shape == b.shape and bool((np.abs(a - b) <= SAME).all())
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return abs(a - b) <= SAME
    names = getattr(type(a), "__dataclass_fields__", None)
    if names and type(a) is type(b):
        return all(_same(getattr(a, name), getattr(b, name)) for name in names)
    return a == b


def _differs(what: str, ours: object, named: object) -> Fault:
    short = [
        text if len(text := str(value)) <= 60 else text[:57] + "..." for value in (ours, named)
    ]
    return Fault(FaultKind.MACHINE, f"{what} is {short[0]}, the machine named has {short[1]}")
