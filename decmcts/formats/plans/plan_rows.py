"""The contours and actions of plan.json as rows, and back.

A planar contour has its nozzle height in `z` and points [x, y]; one that
climbs has z null and points [x, y, z].
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats
from decmcts.formats.files.bounds import (
    LARGEST_ACCELERATION_MM_S2,
    LARGEST_BEAD_MM,
    LARGEST_FILAMENT_MM,
    LARGEST_MM,
    LARGEST_SECONDS,
    LARGEST_SPEED_MM_S,
)
from decmcts.formats.files.fields import Fields, numbers, points, shown
from decmcts.print.contours import PER_CONTOUR, Contours, Role
from decmcts.print.machine import Machine
from decmcts.print.plan import ACTION_END, NO_CONTOUR, ActionKind, After, HeadActions

_CONTOUR_KEYS = (
    "id", "z", "height", "width", "closed", "role", "head", "layer", "tool", "reversible", "epoch",
    "line", "points", "extrusion", "feed",
)  # fmt: skip
_PIECE = ("of", "along")  # of pieces of a cut print alone
_ACCELERATION = "acceleration"  # may be left out, of all contours alike
_INT32_END = 2**31
LARGEST_PLACE = 2.0**31  # vertices of one contour
_INT16_END = 2**15
_ROLES = {role.name.lower(): role for role in Role}


def contours_to_dicts(
    contours: Contours, machine: Machine, acceleration: Floats | None = None
) -> Iterator[dict[str, Any]]:
    """Yield one mapping a contour, in order of id; `acceleration` as in `PlanDocument`."""
    low, high = contours.bottom.tolist(), contours.top.tolist()
    columns = {name: getattr(contours, name).tolist() for name in PER_CONTOUR}
    for i in range(len(contours)):
        rows = slice(int(contours.offsets[i]), int(contours.offsets[i + 1]))
        planar = low[i] == high[i]
        row = {name: values[i] for name, values in columns.items()}
        row |= {
            "id": i,
            "z": high[i] if planar else None,
            "role": Role(row["role"]).name.lower(),
            "head": only_head(machine, row["tool"]),
            "points": contours.points[rows, : 2 if planar else 3].tolist(),
            "extrusion": contours.extrusion[rows][1:].tolist(),
            "feed": _alike(contours.feed[rows][1:]),
        }
        yield {
            **{key: row[key] for key in _CONTOUR_KEYS},
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


def _alike(values: Floats) -> float | list[float]:
    """Return one number where all segments have the same, the usual case."""
    if (values == values[0]).all():
        return float(values[0])
    return list(map(float, values))


def contours_from_dicts(tables: list[Fields], machine: Machine) -> Contours:
    """Return the contours of the rows; raises InputError naming the first wrong one."""
    polylines = [_polyline(table, i) for i, table in enumerate(tables)]
    sizes = [len(p) for p in polylines]
    cut = any(key in table.values for table in tables for key in _PIECE)
    tools = np.array([_count(table, "tool", _INT16_END) for table in tables], np.int16)
    _check_heads(tables, tools, machine)
    columns = {
        name: np.array([read(table, name) for table in tables], dtype)
        for name, (read, dtype) in _COLUMNS.items()
    }
    return Contours(
        points=np.concatenate([np.empty((0, 3)), *polylines]),
        offsets=_offsets(sizes),
        extrusion=_per_segment(tables, sizes, "extrusion", LARGEST_FILAMENT_MM),
        feed=_per_segment(tables, sizes, "feed", LARGEST_SPEED_MM_S),
        tool=tools,
        of=np.array([_count(table, "of") for table in tables], np.int32) if cut else None,
        along=_along(tables, sizes) if cut else None,
        **columns,
    )


def _along(tables: list[Fields], sizes: list[int]) -> Floats:
    """Return the place of each point on the source's contour, (n_points,)."""
    values: list[float] = []
    for table, size in zip(tables, sizes, strict=True):
        given = table.need("along")
        if not isinstance(given, list) or len(given) != size:
            table.fail("along", f"expected {size} places, one a point")
        values.extend(numbers(given, table.at("along"), table.path, least=0.0, most=LARGEST_PLACE))
    return np.array(values, np.float64)


def acceleration_from_dicts(tables: list[Fields], contours: Contours) -> Floats | None:
    """Return the accelerations of the rows as `PlanDocument` has them, None if none has any.

    Raises InputError when some contours state theirs and others do not, or a value is wrong.
    """
    stated = [_ACCELERATION in table.values for table in tables]
    if not any(stated):
        return None
    if not all(stated):
        tables[stated.index(False)].fail(_ACCELERATION, "is missing", "state it of all or of none")
    sizes = np.diff(contours.offsets).tolist()
    return _per_segment(tables, sizes, _ACCELERATION, LARGEST_ACCELERATION_MM_S2)


def _size(table: Fields, key: str) -> float:
    return table.number(key, least=0.0, most=LARGEST_BEAD_MM)


def _count(table: Fields, key: str, end: int = _INT32_END) -> int:
    return table.integer(key, least=0, below=end)


def _polyline(table: Fields, number: int) -> Floats:
    table.only(*_CONTOUR_KEYS, *_PIECE, _ACCELERATION)
    if _count(table, "id") != number:
        table.fail("id", f"{table.need('id')} stands at place {number}", "number from 0 in order")
    planar = table.need("z") is not None
    size = (2 if planar else 3,)
    rows = points(table.need("points"), size, table.at("points"), table.path, most=LARGEST_MM)
    if len(rows) < 2:
        table.fail("points", f"{len(rows)} points, a contour needs two")
    if not planar:
        return rows
    return np.column_stack([rows, np.full(len(rows), table.number("z", most=LARGEST_MM))])


def _per_segment(tables: list[Fields], sizes: list[int], key: str, most: float) -> Floats:
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


def _role(table: Fields, key: str) -> int:
    name = table.text(key)
    if name not in _ROLES:
        table.fail(key, f"unknown role {shown(name)}", f"known: {', '.join(_ROLES)}")
    return int(_ROLES[name])


_COLUMNS: Mapping[str, tuple[Callable[[Fields, str], Any], type[np.generic]]] = {
    "width": (_size, np.float64), "height": (_size, np.float64), "role": (_role, np.int8),
    "closed": (Fields.flag, np.bool_), "reversible": (Fields.flag, np.bool_),
    "layer": (_count, np.int32), "epoch": (_count, np.int32), "line": (_count, np.int32),
}  # fmt: skip


def _check_heads(tables: list[Fields], tools: NDArray[np.int16], machine: Machine) -> None:
    """Refuse a head that does not follow from the tool: nothing else is judged by it."""
    for table, tool in zip(tables, tools.tolist(), strict=True):
        head, only = table.need("head"), only_head(machine, tool)
        if head != only:
            what = f"{shown(head)}, expected {'null' if only is None else shown(only)}"
            table.fail("head", what, f"the name of the only head with tool {tool}, or null")


_ACTION_KEYS = ("kind", "contour", "reversed", "entry", "path", "begin_s", "end_s", "after")
_FORMS = {1: "[head, action]", 2: "[head, action, point, lag]"}  # of what is waited for
_MOST_POINTS = 2**31 - 1
_KINDS = {kind.name.lower(): kind for kind in ActionKind}


def actions_to_dicts(actions: HeadActions, heads: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Yield one mapping an action; `heads` are the names that `after_head` counts."""
    for i in range(len(actions)):
        contour = int(actions.contour[i])
        yield {
            "kind": ActionKind(int(actions.kind[i])).name.lower(),
            "contour": None if contour == NO_CONTOUR else contour,
            "reversed": bool(actions.reversed[i]),
            "entry": int(actions.entry[i]),
            "path": actions.action_path(i).tolist(),
            "begin_s": float(actions.begin_s[i]),
            "end_s": float(actions.end_s[i]),
            "after": [
                [heads[e.head], e.action, None if e.point == ACTION_END else e.point, e.lag_s]
                for e in actions.after_edges(i)
            ],
        }


def actions_from_dicts(
    table: Fields,
    heads: Sequence[str],
    counts: Sequence[int],
    sizes: Sequence[int],
    *,
    version: int,
) -> HeadActions:
    """Return the actions of one head.

    Points that it waits for are held against the other heads' paths by `check_points`, when these
    are read.

    Parameters
    ----------
    counts : Sequence[int]
        Number of actions of each head.
    sizes : Sequence[int]
        Number of points of each contour.
    version : int
        Of the format: in version 1 an action waits for ends only.

    Raises
    ------
    InputError
        Naming the first wrong place.
    """
    rows = table.tables("actions")
    own = table.text("name")
    read = [_action(row, sizes) for row in rows]
    paths = [_path(row) for row in rows]
    after = [_after(row, own, heads, counts, version) for row in rows]
    columns: list[Sequence[Any]] = list(zip(*read, strict=True)) or [()] * 6
    kind, contour, is_reversed, entry, begin_s, end_s = columns
    flat = [edge for edges in after for edge in edges]
    return HeadActions(
        head=own,
        kind=np.array(kind, np.int8),
        contour=np.array(contour, np.int32),
        reversed=np.array(is_reversed, np.bool_),
        entry=np.array(entry, np.int32),
        path_offsets=_offsets([len(path) for path in paths]),
        path=np.concatenate([np.empty((0, 3)), *paths]),
        begin_s=np.array(begin_s, np.float64),
        end_s=np.array(end_s, np.float64),
        after_offsets=_offsets([len(edges) for edges in after]),
        after_head=np.array([edge.head for edge in flat], np.int32),
        after_action=np.array([edge.action for edge in flat], np.int32),
        after_point=np.array([edge.point for edge in flat], np.int32),
        after_lag_s=np.array([edge.lag_s for edge in flat], np.float64),
    )


def _offsets(lengths: Sequence[int]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


def _action(row: Fields, sizes: Sequence[int]) -> tuple[int, int, bool, int, float, float]:
    """Return kind, contour, whether it is reversed, entry, begin and end of one action."""
    row.only(*_ACTION_KEYS)
    kind, contour = row.text("kind"), NO_CONTOUR
    if kind not in _KINDS:
        row.fail("kind", f"unknown kind {shown(kind)}", f"known: {', '.join(_KINDS)}")
    if _KINDS[kind] == ActionKind.PRINT:
        contour = row.integer("contour", least=0, below=len(sizes))
    elif row.need("contour") is not None:
        row.fail("contour", "only a print action has a contour", "write null")
    is_reversed = row.flag("reversed")
    if is_reversed and contour == NO_CONTOUR:
        row.fail("reversed", "true, but nothing is printed")
    entry = row.integer("entry", least=0, below=1 if contour == NO_CONTOUR else sizes[contour])
    begin_s = row.number("begin_s", least=0.0, most=LARGEST_SECONDS)
    end_s = row.number("end_s", most=LARGEST_SECONDS)
    if end_s < begin_s:
        row.fail("end_s", f"{end_s:g} is before begin_s {begin_s:g}")
    return int(_KINDS[kind]), contour, is_reversed, entry, begin_s, end_s


def _path(row: Fields) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    path = points(row.need("path"), (3,), row.at("path"), row.path, most=LARGEST_MM)
    if not len(path):
        row.fail("path", "empty", "a head that rests has its place as the one point")
    return path


def _after(
    row: Fields, own: str, heads: Sequence[str], counts: Sequence[int], version: int
) -> list[After]:
    found = []
    for number, given in enumerate(row.items("after")):
        key, form = f"after[{number}]", _FORMS[min(version, 2)]
        if type(given) is not list or len(given) != form.count(",") + 1:
            row.fail(key, f"expected {form}, found {shown(given)}")
        name, action, point, lag = given if version > 1 else (*given, None, 0.0)
        if name not in heads or name == own:
            row.fail(key, f"{shown(name)} is not another head of the plan")
        head = heads.index(name)
        if type(action) is not int or not 0 <= action < counts[head]:
            row.fail(key, f"{name!r} has no action {shown(action)}, it has {counts[head]}")
        if point is not None and (type(point) is not int or not 0 < point <= _MOST_POINTS):
            row.fail(key, f"no point {shown(point)}: a number from 1, or null for the end")
        if type(lag) not in (int, float) or not 0.0 <= lag <= LARGEST_SECONDS:
            row.fail(key, f"a lag of {shown(lag)}: 0 to {LARGEST_SECONDS:g} s")
        found.append(After(head, action, ACTION_END if point is None else point, float(lag)))
    return found


def check_points(tables: Sequence[Fields], all_actions: Sequence[HeadActions]) -> None:
    """Refuse waits for points that the other heads' paths do not have.

    Raises InputError naming the first wrong place.
    """
    for table, actions in zip(tables, all_actions, strict=True):
        for row in np.flatnonzero(actions.after_point != ACTION_END).tolist():
            other = all_actions[int(actions.after_head[row])]
            waited = int(actions.after_action[row])
            point, size = int(actions.after_point[row]), len(other.action_path(waited))
            moves = other.kind[waited] != ActionKind.WAIT and size > 1
            if not moves or point >= size:
                action = int(np.searchsorted(actions.after_offsets, row, side="right")) - 1
                table.fail(
                    f"actions[{action}].after[{row - int(actions.after_offsets[action])}]",
                    f"action {waited} of {other.head!r} has no point {point} to pass",
                    f"it has points 1 to {size - 1}" if moves else "it stands still",
                )
