"""Machines as nested mappings: the common ground of machine files and plan.json.

Everything a file may get wrong about a machine is refused here, with the place
named. Reading files lives in `machine_file`, slicing shapes elsewhere.
"""

from __future__ import annotations

from dataclasses import asdict, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.bounds import LARGEST_MM
from decmcts.formats.clearances import LARGEST_MM as LARGEST_CLEARANCE_MM
from decmcts.formats.clearances import TALLEST_NOZZLE_MM, clearance_head
from decmcts.formats.fields import Fields, points, shown
from decmcts.formats.head_name import head_name
from decmcts.formats.head_polygon import check_polygon, covers_nozzle
from decmcts.formats.machine_relations import AXES, check_relations
from decmcts.print.machine import Body, Head, Machine, MotionLimits, Rail, Release, Slice

_RELEASES = ("point", "action")
_MAY_BE_ZERO = ("jerk", "junction_deviation")
_UNREACHED = 1e6  # the types' "no limit"
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
    "rail",
    "rails",
    "heads",
)
_HEAD_KEYS = (
    "name",
    "slices",
    "clearance",
    "bodies",
    "park",
    "reach",
    "reach_min",
    "reach_max",
    "tools",
    "limits",
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
        "limits": _limits_to_dict(machine.limits),
        "release": machine.release,
        "rails": [_rail_to_dict(rail) for rail in machine.rails],
        "heads": [_head_to_dict(head) for head in machine.heads],
    }


def _rail_to_dict(rail: Rail) -> dict[str, Any]:
    return {
        "axis": AXES[rail.axis],
        "order": list(rail.order),
        "separation_mm": rail.separation_mm,
    }


def _limits_to_dict(limits: MotionLimits) -> dict[str, Any]:
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in asdict(limits).items()
    }


def _head_to_dict(head: Head) -> dict[str, Any]:
    own = {} if head.limits is None else {"limits": _limits_to_dict(head.limits)}
    return {
        "name": head.name,
        "slices": [
            {"height": s.height_mm, "polygons": [p.tolist() for p in s.polygons]}
            for s in head.slices
        ],
        "bodies": [
            {"name": b.name, "min": list(b.minimum), "max": list(b.maximum)} for b in head.bodies
        ],
        "park": list(head.park),
        "reach": {"min": list(head.reach_min), "max": list(head.reach_max)},
        "tools": list(head.tools),
        **own,
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
    limits = _limits(given, MotionLimits())
    machine = Machine(
        name=given.text("name"),
        source=given.text("source", ""),
        bed_min=_pair(bed, "min"),
        bed_max=_pair(bed, "max"),
        clearance_mm=_size(given, "clearance_mm", defaults.clearance_mm),
        bead_width=given.flag("bead_width", defaults.bead_width),
        head_clearance_mm=_size(given, "head_clearance_mm", defaults.head_clearance_mm),
        lift_mm=_size(given, "lift_mm", defaults.lift_mm),
        limits=limits,
        rails=_rails(given),
        release=_release(given),
        heads=tuple(_head(head, _across(bed), limits) for head in given.tables("heads")),
    )
    check_relations(machine, given)
    return machine


def _limits(given: Fields, usual: MotionLimits) -> MotionLimits:
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


def _release(given: Fields) -> Release:
    value = given.text("release", "action")
    if value not in _RELEASES:
        given.fail("release", f"expected 'point' or 'action', found {shown(value)}")
    return "point" if value == "point" else "action"


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
    return Rail(AXES.index(axis), tuple(map(str, order)), _size(table, "separation_mm"))


def _across(bed: Fields) -> float:
    """Return how far a nozzle gets along either axis, mm."""
    return float(np.subtract(_pair(bed, "max"), _pair(bed, "min")).max())


def _clearance(table: Fields, across_mm: float) -> list[Slice]:
    """Return the slices of a head given by three lengths, as slicers know it."""
    table.only("radius", "nozzle_height", "rod_height")
    radius = table.number("radius", least=0.0)
    nozzle = table.number("nozzle_height", 0.0, least=0.0)
    rod = table.number("rod_height", least=0.0)
    for key, value in (("radius", radius), ("rod_height", rod)):
        if not 0.0 < value <= LARGEST_CLEARANCE_MM:
            table.fail(key, f"{value:g} is not above 0 and up to {LARGEST_CLEARANCE_MM:g} mm")
    if nozzle > TALLEST_NOZZLE_MM:
        table.fail("nozzle_height", f"{nozzle:g} is above {TALLEST_NOZZLE_MM:g} mm")
    return list(clearance_head(radius, nozzle, rod, across_mm))


def _slices(table: Fields, across_mm: float) -> list[Slice]:
    if "clearance" in table.values:
        if "slices" in table.values:
            table.fail("clearance", "stands beside slices", "give one of the two")
        return _clearance(table.table("clearance"), across_mm)
    return sorted((_slice(s) for s in table.tables("slices")), key=lambda s: s.height_mm)


def _head(table: Fields, across_mm: float, usual: MotionLimits) -> Head:
    table.only(*_HEAD_KEYS)
    slices = _slices(table, across_mm)
    _check_slices(slices, table)
    bodies = tuple(_body(b) for b in table.tables("bodies")) if "bodies" in table.values else ()
    low, high = _reach(table)
    tools = table.items("tools") if "tools" in table.values else []
    if any(type(tool) is not int or tool < 0 for tool in tools):
        table.fail("tools", f"expected tool numbers from 0, found {shown(tools)}")
    return Head(
        name=head_name(table),
        slices=tuple(slices),
        bodies=bodies,
        park=_park(table) if "park" in table.values else (0.0, 0.0, 0.0),
        reach_min=low,
        reach_max=high,
        tools=tuple(tools),
        limits=_limits(table, usual) if "limits" in table.values else None,
    )


def _slice(table: Fields) -> Slice:
    table.only("height", "height_mm", "polygons")
    height = _size(table, "height_mm" if "height_mm" in table.values else "height")
    polygons: list[NDArray[np.float64]] = []
    for number, rows in enumerate(table.items("polygons"), 1):
        place = f"{table.where} (height {height:g}), polygon {number}"
        polygon = points(rows, (2,), place, table.path, most=LARGEST_MM)
        check_polygon(polygon, place, table.path)
        polygon.setflags(write=False)
        polygons.append(polygon)
    if not polygons:
        table.fail("polygons", "no polygon")
    return Slice(height, tuple(polygons))


def _check_slices(slices: list[Slice], table: Fields) -> None:
    if not slices or slices[0].height_mm != 0.0:
        table.fail(
            "slices", "no slice at height 0", "add the nozzle's tip as a polygon at height 0"
        )
    if not any(covers_nozzle(p) for p in slices[0].polygons):
        table.fail(
            "slices",
            "no polygon of the slice at height 0 contains the nozzle (0, 0)",
            "coordinates are relative to the nozzle",
        )
    heights = [s.height_mm for s in slices]
    for low, high in pairwise(heights):
        if low == high:
            table.fail("slices", f"two slices at height {low:g}", "put their polygons in one slice")


def _body(table: Fields) -> Body:
    table.only("name", "min", "max")
    low, high = _triple(table, "min"), _triple(table, "max")
    if not all(a < b for a, b in zip(low, high, strict=True)):
        table.fail("min", f"{list(low)} is not below max {list(high)} on every axis")
    return Body(table.text("name", "body"), low, high)


def _park(table: Fields) -> tuple[float, float, float]:
    park = _triple(table, "park")
    if park[2] < 0.0:
        table.fail("park", f"z is {park[2]:g}, below the bed", "park at 0 or above")
    return park


def _reach(
    table: Fields,
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    low = (-_UNREACHED,) * 3
    high = (_UNREACHED,) * 3
    if "reach" in table.values:
        reach = table.table("reach")
        reach.only("min", "max")
        low = _triple(reach, "min", most=_UNREACHED)
        high = _triple(reach, "max", most=_UNREACHED)
    if "reach_min" in table.values:
        low = _triple(table, "reach_min", most=_UNREACHED)
    if "reach_max" in table.values:
        high = _triple(table, "reach_max", most=_UNREACHED)
    if not all(a <= b for a, b in zip(low, high, strict=True)):
        table.fail("reach", f"min {list(low)} is above max {list(high)}")
    return low, high


def _size(table: Fields, key: str, usual: float | None = None) -> float:
    return table.number(key, usual, least=0.0, most=LARGEST_MM)


def _pair(table: Fields, key: str) -> tuple[float, float]:
    x, y = table.point(key, 2, most=LARGEST_MM)
    return x, y


def _triple(table: Fields, key: str, *, most: float = LARGEST_MM) -> tuple[float, float, float]:
    x, y, z = table.point(key, 3, most=most)
    return x, y, z
