"""A head as nested mappings: its shape, bodies, park, reach, tools, limits and idling.

A new kind of head shape gets its keys here, for machine files and plan.json at once. The motion
limits of a machine are read here too; of what idle heads do, what is left out is the source's.

A polygon of a slice must be convex, counter-clockwise and simple: the tests for clearance rely on
it (Minkowski sums of convex polygons). A file that breaks it is refused rather than repaired: a
hull would make the head larger than the user meant, a reversed ring may hide swapped axes.

A head's name becomes part of a file's name and of that file's header, `STEM_NAME.gcode`, and
`; head NAME, file 1 of 2: to be run together`. So what no file system takes, or no line of comment
holds, is refused.
"""

from __future__ import annotations

from dataclasses import asdict, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from decmcts.arrays import Floats
from decmcts.formats.files.bounds import LARGEST_MM, LAST_TOOL
from decmcts.formats.files.fields import Fields, fail, points, shown
from decmcts.formats.heads.clearances import LARGEST_MM as LARGEST_CLEARANCE_MM
from decmcts.formats.heads.clearances import TALLEST_NOZZLE_MM, clearance_head
from decmcts.print.machine import Body, Head, Idle, MotionLimits, Slice

_UNREACHED = 1e6  # the types' "no limit"
_HEAD_KEYS = (
    "name", "slices", "clearance", "bodies", "park", "reach", "reach_min", "reach_max", "tools",
    "limits", "pace", "idle",
)  # fmt: skip
_SLOWEST = 100.0
HOTTEST_C = 600.0
FASTEST_C_S = 100.0
MOST_MM = 20.0  # of filament; more pulls it out of the hot end
_LEAST_S = 1.0
_LEAST_C_S = 0.01
_LEAST = 1e-6  # of a limit that is not 0; with less, times are no numbers any more
_MAY_BE_ZERO = ("jerk", "junction_deviation")
MOST_BYTES = 64  # in UTF-8; file systems take 255 for the whole name
_FORBIDDEN = frozenset('/\\:*?"<>|')
_RULE = (
    f"a name is 1 to {MOST_BYTES} bytes, no blank at its ends, no control characters"
    f" and none of {' '.join(sorted(_FORBIDDEN))}: it becomes part of a file's name"
)


def head_to_dict(head: Head) -> dict[str, Any]:
    """Return plain lists, numbers and texts that `head_from` reads back equal."""
    idle = {name: value for name, value in asdict(head.idle).items() if value is not None}
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
        **({} if head.limits is None else {"limits": limits_to_dict(head.limits)}),
        **({} if head.pace == 1.0 else {"pace": head.pace}),
        **({} if head.idle == Idle() else {"idle": idle}),
    }


def head_from(table: Fields, across_mm: float, usual: MotionLimits) -> Head:
    """Return the head a table describes.

    Parameters
    ----------
    across_mm : float
        How far a nozzle gets along either axis of the bed.
    usual : MotionLimits
        The machine's own, for limits the head does not state.

    Raises
    ------
    InputError
        For anything missing, unknown, of the wrong type or impossible.
    """
    table.only(*_HEAD_KEYS)
    slices = _slices(table, across_mm)
    _check_slices(slices, table)
    bodies = tuple(map(_body, table.tables("bodies", [])))
    low, high = _reach(table)
    tools = table.items("tools", [])
    if any(type(tool) is not int or not 0 <= tool <= LAST_TOOL for tool in tools):
        table.fail("tools", f"expected tool numbers from 0 to {LAST_TOOL}, found {shown(tools)}")
    return Head(
        name=head_name(table),
        slices=tuple(slices),
        bodies=bodies,
        park=_park(table) if "park" in table.values else (0.0, 0.0, 0.0),
        reach_min=low,
        reach_max=high,
        tools=tuple(tools),
        limits=limits_from(table, usual) if "limits" in table.values else None,
        pace=table.number("pace", 1.0, least=1.0, most=_SLOWEST),
        idle=idle_from(table),
    )


def _slices(table: Fields, across_mm: float) -> list[Slice]:
    if "clearance" in table.values:
        if "slices" in table.values:
            table.fail("clearance", "stands beside slices", "give one of the two")
        return _clearance(table.table("clearance"), across_mm)
    return sorted((_slice(s) for s in table.tables("slices")), key=lambda s: s.height_mm)


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


def _slice(table: Fields) -> Slice:
    table.only("height", "height_mm", "polygons")
    height = table.size("height_mm" if "height_mm" in table.values else "height")
    polygons: list[Floats] = []
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
    low, high = table.triple("min"), table.triple("max")
    if not all(a < b for a, b in zip(low, high, strict=True)):
        table.fail("min", f"{list(low)} is not below max {list(high)} on every axis")
    return Body(table.text("name", "body"), low, high)


def _park(table: Fields) -> tuple[float, float, float]:
    park = table.triple("park")
    if park[2] < 0.0:
        table.fail("park", f"z is {park[2]:g}, below the bed", "park at 0 or above")
    return park


def _reach(table: Fields) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    low, high = (-_UNREACHED,) * 3, (_UNREACHED,) * 3
    if "reach" in table.values:
        reach = table.table("reach")
        reach.only("min", "max")
        low, high = reach.triple("min", most=_UNREACHED), reach.triple("max", most=_UNREACHED)
    if "reach_min" in table.values:
        low = table.triple("reach_min", most=_UNREACHED)
    if "reach_max" in table.values:
        high = table.triple("reach_max", most=_UNREACHED)
    if not all(a <= b for a, b in zip(low, high, strict=True)):
        table.fail("reach", f"min {list(low)} is above max {list(high)}")
    return low, high


def idle_from(given: Fields) -> Idle:
    """Return what a head's table `idle` says."""
    usual = Idle()
    if "idle" not in given.values:
        return usual
    table = given.table("idle")
    table.only(*(field.name for field in fields(Idle)))
    standby_c = _stated_size(table, "standby_c", HOTTEST_C)
    return Idle(
        after_s=table.number("after_s", usual.after_s, least=_LEAST_S),
        standby_c=None if standby_c is None else round(standby_c, 1),  # as files state it
        heat_c_s=table.number("heat_c_s", usual.heat_c_s, least=_LEAST_C_S, most=FASTEST_C_S),
        retract_mm=_stated_size(table, "retract_mm", MOST_MM),
        prime_mm=_stated_size(table, "prime_mm", MOST_MM),
    )


def _stated_size(table: Fields, key: str, most: float) -> float | None:
    return table.number(key, least=0.0, most=most) if key in table.values else None


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
    if least < _LEAST and name not in _MAY_BE_ZERO:
        table.fail(name, f"{least:g} would never arrive; {_LEAST:g} is the least")
    return value


def check_polygon(polygon: Floats, where: str, path: Path | str | None = None) -> None:
    """Raise InputError unless (k, 2) `polygon` is convex, counter-clockwise and simple."""
    if len(polygon) < 3:
        fail(where, f"{len(polygon)} points are no polygon, 3 are needed", path)
    repeated = np.flatnonzero((polygon == np.roll(polygon, -1, axis=0)).all(axis=1))
    if len(repeated):
        k, n = int(repeated[0]), len(polygon)
        fail(where, f"point {(k + 1) % n + 1} repeats point {k + 1}", path, "name each corner once")
    ring = shapely.LinearRing(polygon)
    if not ring.is_simple:
        fail(where, "it crosses or touches itself", path)
    if not ring.is_ccw:
        fail(where, "it runs clockwise (inside out)", path, "list its corners counter-clockwise")
    into, out = polygon - np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0) - polygon
    turns = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]  # at the corners, positive: left
    if (turns < 0.0).any():
        corner = int(np.argmax(turns < 0.0))
        x, y = polygon[corner]
        advice = "split it into convex polygons"
        fail(where, f"it is concave at corner {corner + 1} ({x:g}, {y:g})", path, advice)


def covers_nozzle(polygon: Floats) -> bool:
    """Tell whether the origin lies in a convex counter-clockwise polygon, edges included."""
    ahead = np.roll(polygon, -1, axis=0)
    return bool((polygon[:, 0] * ahead[:, 1] >= polygon[:, 1] * ahead[:, 0]).all())


def head_name(table: Fields) -> str:
    """Return the name of a head; raises InputError for one that no file can have."""
    name = table.text("name")
    bad = next((c for c in name if c in _FORBIDDEN or not c.isprintable()), None)
    if bad is not None:
        table.fail("name", f"{bad!r} cannot be in a head's name", _RULE)
    if not name or name != name.strip():
        table.fail("name", f"{shown(name)} is empty or has a blank at an end", _RULE)
    size = len(name.encode())
    if size > MOST_BYTES:
        table.fail("name", f"{shown(name)} is {size} bytes long", _RULE)
    return name
