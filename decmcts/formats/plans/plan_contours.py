"""The contours of plan.json as rows, and back.

A planar contour has its nozzle height in `z` and points [x, y]; one that
climbs has z null and points [x, y, z].
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.files.bounds import (
    LARGEST_ACCELERATION_MM_S2,
    LARGEST_BEAD_MM,
    LARGEST_FILAMENT_MM,
    LARGEST_MM,
    LARGEST_SPEED_MM_S,
)
from decmcts.formats.files.fields import Fields, numbers, points, shown
from decmcts.print.contours import Contours, Role
from decmcts.print.machine import Machine

_KEYS = (
    "id",
    "z",
    "height",
    "width",
    "closed",
    "role",
    "head",
    "layer",
    "tool",
    "reversible",
    "epoch",
    "line",
    "points",
    "extrusion",
    "feed",
)
_PIECE = ("of", "along")  # of pieces of a cut print alone
_ACCELERATION = "acceleration"  # may be left out, of all contours alike
_INT32_END = 2**31
LARGEST_PLACE = 2.0**31  # vertices of one contour
_INT16_END = 2**15
_ROLES = {role.name.lower(): role for role in Role}


def contours_to_dicts(
    contours: Contours, machine: Machine, acceleration: NDArray[np.float64] | None = None
) -> Iterator[dict[str, Any]]:
    """Yield one mapping a contour, in order of id; `acceleration` as in `PlanDocument`."""
    z_low, z_high = contours.bottom, contours.top
    for i in range(len(contours)):
        rows = slice(int(contours.offsets[i]), int(contours.offsets[i + 1]))
        planar = bool(z_low[i] == z_high[i])
        polyline = contours.points[rows]
        yield {
            "id": i,
            "z": float(z_high[i]) if planar else None,
            "height": float(contours.height[i]),
            "width": float(contours.width[i]),
            "closed": bool(contours.closed[i]),
            "role": Role(int(contours.role[i])).name.lower(),
            "head": only_head(machine, int(contours.tool[i])),
            "layer": int(contours.layer[i]),
            "tool": int(contours.tool[i]),
            "reversible": bool(contours.reversible[i]),
            "epoch": int(contours.epoch[i]),
            "line": int(contours.line[i]),
            "points": (polyline[:, :2] if planar else polyline).tolist(),
            "extrusion": contours.extrusion[rows][1:].tolist(),
            "feed": _alike(contours.feed[rows][1:]),
            **_piece(contours, i, rows),
            **({} if acceleration is None else {_ACCELERATION: _alike(acceleration[rows][1:])}),
        }


def _piece(contours: Contours, i: int, rows: slice) -> dict[str, Any]:
    """Return what a row says of a piece; nothing of a print that is not cut."""
    if contours.of is None or contours.along is None:
        return {}
    return {"of": int(contours.of[i]), "along": contours.along[rows].tolist()}


def only_head(machine: Machine, tool: int) -> str | None:
    """Return the one head that has `tool`, None when every head or several have it."""
    able = [head.name for head in machine.heads if not head.tools or tool in head.tools]
    return able[0] if len(able) == 1 < len(machine.heads) else None


def _alike(values: NDArray[np.float64]) -> float | list[float]:
    """Return one number where all segments have the same, the usual case."""
    if (values == values[0]).all():
        return float(values[0])
    return list(map(float, values))


def contours_from_dicts(tables: list[Fields], machine: Machine) -> Contours:
    """Return the contours of the rows; raises InputError naming the first wrong one."""
    polylines = [_polyline(table, i) for i, table in enumerate(tables)]
    sizes = [len(p) for p in polylines]
    cut = any(key in table.values for table in tables for key in _PIECE)
    tools = _integers(tables, "tool", _INT16_END).astype(np.int16)
    _check_heads(tables, tools, machine)
    return Contours(
        points=np.concatenate([np.empty((0, 3)), *polylines]),
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        extrusion=_per_segment(tables, sizes, "extrusion", LARGEST_FILAMENT_MM),
        feed=_per_segment(tables, sizes, "feed", LARGEST_SPEED_MM_S),
        width=_sizes(tables, "width"),
        height=_sizes(tables, "height"),
        role=np.array([_role(t) for t in tables], np.int8),
        closed=np.array([t.flag("closed") for t in tables], np.bool_),
        layer=_integers(tables, "layer", _INT32_END),
        tool=tools,
        reversible=np.array([t.flag("reversible") for t in tables], np.bool_),
        epoch=_integers(tables, "epoch", _INT32_END),
        line=_integers(tables, "line", _INT32_END),
        of=_integers(tables, "of", _INT32_END) if cut else None,
        along=_along(tables, sizes) if cut else None,
    )


def _along(tables: list[Fields], sizes: list[int]) -> NDArray[np.float64]:
    """Return the place of each point on the source's contour, (n_points,)."""
    values: list[float] = []
    for table, size in zip(tables, sizes, strict=True):
        given = table.need("along")
        if not isinstance(given, list) or len(given) != size:
            table.fail("along", f"expected {size} places, one a point")
        values.extend(numbers(given, table.at("along"), table.path, least=0.0, most=LARGEST_PLACE))
    return np.array(values, np.float64)


def acceleration_from_dicts(tables: list[Fields], contours: Contours) -> NDArray[np.float64] | None:
    """Return the accelerations of the rows as `PlanDocument` has them, None if none has any.

    Raises
    ------
    InputError
        When some contours state theirs and others do not, or a value is wrong.
    """
    stated = [_ACCELERATION in table.values for table in tables]
    if not any(stated):
        return None
    if not all(stated):
        tables[stated.index(False)].fail(_ACCELERATION, "is missing", "state it of all or of none")
    sizes = np.diff(contours.offsets).tolist()
    return _per_segment(tables, sizes, _ACCELERATION, LARGEST_ACCELERATION_MM_S2)


def _sizes(tables: list[Fields], key: str) -> NDArray[np.float64]:
    return np.array([t.number(key, least=0.0, most=LARGEST_BEAD_MM) for t in tables], np.float64)


def _integers(tables: list[Fields], key: str, end: int) -> NDArray[np.int32]:
    return np.array([t.integer(key, least=0, below=end) for t in tables], np.int32)


def _polyline(table: Fields, number: int) -> NDArray[np.float64]:
    """Return (k, 3) points of one row."""
    table.only(*_KEYS, *_PIECE, _ACCELERATION)
    if table.integer("id", least=0, below=_INT32_END) != number:
        table.fail("id", f"{table.need('id')} stands at place {number}", "number from 0 in order")
    planar = table.need("z") is not None
    rows = points(
        table.need("points"),
        (2 if planar else 3,),
        table.at("points"),
        table.path,
        most=LARGEST_MM,
    )
    if len(rows) < 2:
        table.fail("points", f"{len(rows)} points, a contour needs two")
    if not planar:
        return rows
    return np.column_stack([rows, np.full(len(rows), table.number("z", most=LARGEST_MM))])


def _per_segment(
    tables: list[Fields], sizes: list[int], key: str, most: float
) -> NDArray[np.float64]:
    """Return (n_points,) values of the segments, 0 at each contour's start."""
    lists = [
        _segments(table, size - 1, key, most) for table, size in zip(tables, sizes, strict=True)
    ]
    return np.array(list(chain.from_iterable([0.0, *values] for values in lists)), np.float64)


def _segments(table: Fields, count: int, key: str, most: float) -> list[float]:
    value = table.need(key)
    if not isinstance(value, list):
        return [table.number(key, least=0.0, most=most)] * count
    if len(value) != count:
        table.fail(key, f"{len(value)} values for {count} segments")
    return list(numbers(value, table.at(key), table.path, least=0.0, most=most))


def _role(table: Fields) -> int:
    name = table.text("role")
    if name not in _ROLES:
        table.fail("role", f"unknown role {shown(name)}", f"known: {', '.join(_ROLES)}")
    return int(_ROLES[name])


def _check_heads(tables: list[Fields], tools: NDArray[np.int16], machine: Machine) -> None:
    """Refuse a head that does not follow from the tool: nothing else is judged by it."""
    for table, tool in zip(tables, tools.tolist(), strict=True):
        head, only = table.need("head"), only_head(machine, tool)
        if head != only:
            what = f"{shown(head)}, expected {'null' if only is None else shown(only)}"
            table.fail("head", what, f"the name of the only head with tool {tool}, or null")
