"""Machines as nested mappings: the common ground of machine files and plan.json.

Everything a file may get wrong about a machine is refused here, with the place
named; its heads are read in `formats.heads`, files in `machine_file`.
"""

from __future__ import annotations

from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from decmcts.formats.files.fields import Fields, shown
from decmcts.formats.files.names import in_one_line
from decmcts.formats.heads.head_dict import head_from, head_to_dict
from decmcts.formats.heads.lengths import pair, size
from decmcts.formats.heads.limits_dict import limits_from, limits_to_dict
from decmcts.formats.machines.machine_relations import AXES, check_relations
from decmcts.print.machine import Machine, MotionLimits, Rail, Release
from decmcts.print.sync_words import USUAL_WORDS, SyncWords

_LONGEST_NAME = 200
_RELEASES = ("point", "action")
_MACHINE_KEYS = (
    "name",
    "source",
    "bed",
    "clearance_mm",
    "bead_width",
    "head_clearance_mm",
    "lift_mm",
    "limits",
    "release",
    "signal_interval_s",
    "rest_s",
    "words",
    "rail",
    "rails",
    "heads",
)


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
        "rails": [_rail_to_dict(rail) for rail in machine.rails],
        "heads": [head_to_dict(head) for head in machine.heads],
    }


def _rail_to_dict(rail: Rail) -> dict[str, Any]:
    return {
        "axis": AXES[rail.axis],
        "order": list(rail.order),
        "separation_mm": rail.separation_mm,
    }


def machine_from_dict(values: Any, *, where: str = "", path: Path | str | None = None) -> Machine:
    """Return the machine a mapping describes.

    Parameters
    ----------
    values : Any
        The mapping, keys as in docs/machine-format.md.
    where : str
        Its place in the file, put before each key in messages.
    path : Path | str | None
        The file, for messages.

    Raises
    ------
    InputError
        For anything missing, unknown, of the wrong type or impossible.
    """
    given = Fields.of(values, where, path)
    given.only(*_MACHINE_KEYS)
    bed = given.table("bed")
    bed.only("min", "max")
    defaults = Machine("", (0.0, 0.0), (0.0, 0.0), ())
    limits = limits_from(given, MotionLimits())
    machine = Machine(
        name=_name(given),
        source=given.text("source", ""),
        bed_min=pair(bed, "min"),
        bed_max=pair(bed, "max"),
        clearance_mm=size(given, "clearance_mm", defaults.clearance_mm),
        bead_width=given.flag("bead_width", defaults.bead_width),
        head_clearance_mm=size(given, "head_clearance_mm", defaults.head_clearance_mm),
        lift_mm=size(given, "lift_mm", defaults.lift_mm),
        limits=limits,
        rails=_rails(given),
        release=_release(given),
        signal_interval_s=size(given, "signal_interval_s", defaults.signal_interval_s),
        rest_s=size(given, "rest_s", defaults.rest_s),
        words=_words(given),
        heads=tuple(head_from(head, _across(bed), limits) for head in given.tables("heads")),
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
    words = SyncWords(
        signal=table.text("signal", usual.signal),
        passed=table.text("passed", usual.passed),
        wait=table.text("wait", usual.wait),
    )
    for name, why in words.faults():
        table.fail(name, f"{shown(getattr(words, name))} {why}")
    return words


def _rails(given: Fields) -> tuple[Rail, ...]:
    if "rail" not in given.values:
        tables = given.tables("rails") if "rails" in given.values else []
        return tuple(_rail(table) for table in tables)
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
    return Rail(AXES.index(axis), tuple(map(str, order)), size(table, "separation_mm"))


def _across(bed: Fields) -> float:
    """Return how far a nozzle gets along either axis, mm."""
    return float(np.subtract(pair(bed, "max"), pair(bed, "min")).max())
