"""Machines as nested mappings: the common ground of machine files and plan.json.

Everything a file may get wrong about a machine is refused here, with the place
named, and what no single value shows: names, rails and parks of several heads. Heads are read in
`formats.heads`, files in `machine_file`.
"""

from __future__ import annotations

from dataclasses import asdict, fields
from itertools import pairwise
from pathlib import Path
from typing import Any
from unicodedata import normalize

import numpy as np

from decmcts.formats.files.fields import Fields, fail, shown
from decmcts.formats.files.names import in_one_line
from decmcts.formats.heads.head_dict import head_from, head_to_dict, limits_from, limits_to_dict
from decmcts.print.machine import USUAL_WORDS, Body, Machine, MotionLimits, Rail, Release, SyncWords

_LONGEST_NAME = 200
_RELEASES = ("point", "action")
_SIZES = ("clearance_mm", "head_clearance_mm", "lift_mm", "signal_interval_s", "rest_s")
_MACHINE_KEYS = (
    "name", "source", "bed", "clearance_mm", "bead_width", "head_clearance_mm", "lift_mm",
    "limits", "release", "signal_interval_s", "rest_s", "words", "rail", "rails", "heads",
)  # fmt: skip
AXES = ("x", "y")
MOST_HEADS = 16
"""Each is a process, and finding who can be let in where takes the fourth power of them: 0.3 s of
processor time for 16 heads with 256 contours, 5 s for 32, 80 s for 64."""


def machine_to_dict(machine: Machine) -> dict[str, Any]:
    """Return plain lists, numbers and texts that `machine_from_dict` reads back equal."""
    return {
        "name": machine.name,
        "source": machine.source,
        "bed": {"min": list(machine.bed_min), "max": list(machine.bed_max)},
        "clearance_mm": machine.clearance_mm,
        "bead_width": machine.bead_width,
        "head_clearance_mm": machine.head_clearance_mm,
        "lift_mm": machine.lift_mm,
        "limits": limits_to_dict(machine.limits),
        "release": machine.release,
        "signal_interval_s": machine.signal_interval_s,
        "rest_s": machine.rest_s,
        "words": asdict(machine.words),
        "rails": [
            {**asdict(r), "axis": AXES[r.axis], "order": list(r.order)} for r in machine.rails
        ],
        "heads": [head_to_dict(head) for head in machine.heads],
    }


def machine_from_dict(values: Any, *, where: str = "", path: Path | str | None = None) -> Machine:
    """Return the machine a mapping describes.

    Its keys are those of docs/machine-format.md; `where` is its place in the file, for messages.

    Raises InputError for anything missing, unknown, of the wrong type or impossible.
    """
    given = Fields.of(values, where, path)
    given.only(*_MACHINE_KEYS)
    bed = given.table("bed")
    bed.only("min", "max")
    defaults = Machine("", (0.0, 0.0), (0.0, 0.0), ())
    limits = limits_from(given, MotionLimits())
    low, high = bed.pair("min"), bed.pair("max")
    across = float(np.subtract(high, low).max())  # that a nozzle gets along either axis
    machine = Machine(
        name=_name(given),
        source=given.text("source", ""),
        bed_min=low,
        bed_max=high,
        bead_width=given.flag("bead_width", defaults.bead_width),
        limits=limits,
        rails=_rails(given),
        release=_release(given),
        words=_words(given),
        **{key: given.size(key, getattr(defaults, key)) for key in _SIZES},
        heads=tuple(head_from(head, across, limits) for head in given.tables("heads")),
    )
    check_relations(machine, given)
    return machine


def _name(given: Fields) -> str:
    """Return the name of a machine, which stands in a comment of each file made for it."""
    name = given.text("name")
    if name != in_one_line(name) or len(name) > _LONGEST_NAME:
        given.fail(
            "name", f"{shown(name)} is no name",
            f"up to {_LONGEST_NAME} letters, single blanks, no line ends or controls",
        )  # fmt: skip
    return name


def _release(given: Fields) -> Release:
    value = given.text("release", "action")
    if value not in _RELEASES:
        given.fail("release", f"expected 'point' or 'action', found {shown(value)}")
    return "point" if value == "point" else "action"


def _words(given: Fields) -> SyncWords:
    usual = USUAL_WORDS
    if "words" not in given.values:
        return usual
    table = given.table("words")
    table.only(*(field.name for field in fields(SyncWords)))
    words = SyncWords(*(table.text(key, value) for key, value in asdict(usual).items()))
    for name, why in words.faults():
        table.fail(name, f"{shown(getattr(words, name))} {why}")
    return words


def _rails(given: Fields) -> tuple[Rail, ...]:
    if "rail" not in given.values:
        return tuple(map(_rail, given.tables("rails", [])))
    if "rails" in given.values:
        given.fail("rail", "stands beside rails", "give one of the two")
    return (_rail(given.table("rail")),)


def _rail(table: Fields) -> Rail:
    table.only("axis", "order", "separation_mm")
    axis = table.need("axis")
    if axis not in AXES:
        table.fail("axis", f"expected 'x' or 'y', found {shown(axis)}")
    order = table.items("order")
    if len(set(map(str, order))) != len(order) or len(order) < 2:
        table.fail("order", f"expected two or more different heads, found {shown(order)}")
    return Rail(AXES.index(axis), tuple(map(str, order)), table.size("separation_mm"))


def check_relations(machine: Machine, given: Fields) -> None:
    """Check what no single value shows: names, rail and parks."""
    if not machine.heads:
        given.fail("heads", "no head")
    if len(machine.heads) > MOST_HEADS:
        given.fail("heads", f"{len(machine.heads)} heads, at most {MOST_HEADS} are taken")
    if not all(a < b for a, b in zip(machine.bed_min, machine.bed_max, strict=True)):
        given.fail("bed", f"min {machine.bed_min} is not below max {machine.bed_max}")
    _check_names(machine, given)
    for i, rail in enumerate(machine.rails):
        _check_rail(machine, rail, given, "rail" if "rail" in given.values else f"rails[{i}]")
    _check_parks(machine, given)


def _check_names(machine: Machine, given: Fields) -> None:
    known: dict[str, str] = {}
    for i, head in enumerate(machine.heads):
        name = head.name
        seen = normalize("NFC", normalize("NFC", name).casefold())  # as file systems do
        if known.get(seen) == name:
            given.fail(f"heads[{i}].name", f"two heads are named {name!r}")
        if seen in known:
            given.fail(
                f"heads[{i}].name",
                f"two heads are named {known[seen]!r} and {name!r}",
                "their files would be one on macOS and Windows",
            )
        known[seen] = name


def _check_rail(machine: Machine, rail: Rail, given: Fields, where: str) -> None:
    parks = {head.name: head.park[rail.axis] for head in machine.heads}
    for name in rail.order:
        if name not in parks:
            given.fail(f"{where}.order", f"no head is named {name!r}", f"heads: {', '.join(parks)}")
    for before, after in pairwise(rail.order):
        gap = parks[after] - parks[before]
        if gap < rail.separation_mm:
            given.fail(
                where,
                f"parked heads {before!r} and {after!r} are {gap:g} mm apart along"
                f" {AXES[rail.axis]}, separation_mm is {rail.separation_mm:g}",
                "move the parks apart",
            )


def _check_parks(machine: Machine, given: Fields) -> None:
    for i, one in enumerate(machine.heads):
        for two in machine.heads[:i]:
            gap = min(
                (_gap(a, one.park, b, two.park) for a in one.bodies for b in two.bodies),
                default=np.inf,
            )
            if gap < machine.head_clearance_mm:
                fail(
                    given.at(f"heads[{i}].park"),
                    f"parked heads {two.name!r} and {one.name!r} have bodies {gap:g} mm apart,"
                    f" head_clearance_mm is {machine.head_clearance_mm:g}",
                    given.path,
                    "move the parks apart",
                )


def _gap(a: Body, at: tuple[float, float, float], b: Body, bt: tuple[float, float, float]) -> float:
    """Return the distance of two boxes that moved with their nozzles, in mm."""
    low_a, high_a = np.add(a.minimum, at), np.add(a.maximum, at)
    low_b, high_b = np.add(b.minimum, bt), np.add(b.maximum, bt)
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(low_a - high_b, low_b - high_a))))
