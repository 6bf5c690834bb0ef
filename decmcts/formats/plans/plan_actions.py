"""The actions of one head in plan.json as rows, and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from decmcts.formats.files.bounds import LARGEST_MM, LARGEST_SECONDS
from decmcts.formats.files.fields import Fields, points, shown
from decmcts.print.plan import ACTION_END, NO_CONTOUR, ActionKind, After, HeadActions

_KEYS = ("kind", "contour", "reversed", "entry", "path", "begin_s", "end_s", "after")
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

    Parameters
    ----------
    table : Fields
        The head's mapping: name and actions.
    heads : Sequence[str]
        Names of the plan's heads, in its order.
    counts : Sequence[int]
        Number of actions of each head.
    sizes : Sequence[int]
        Number of points of each contour.
    version : int
        Of the format: in version 1 an action waits for ends only. Points are held against
        the other heads' paths by `check_points`, when these are read.

    Raises
    ------
    InputError
        Naming the first wrong place.
    """
    rows = table.tables("actions")
    for row in rows:
        row.only(*_KEYS)
    kinds = [_kind(row) for row in rows]
    contours = [_contour(row, kind, len(sizes)) for row, kind in zip(rows, kinds, strict=True)]
    paths = [_path(row) for row in rows]
    own = table.text("name")
    after = [_after(row, own, heads, counts, version) for row in rows]
    flat = [edge for edges in after for edge in edges]
    return HeadActions(
        head=own,
        kind=np.array(kinds, np.int8),
        contour=np.array(contours, np.int32),
        reversed=np.array([_reversed(r, c) for r, c in zip(rows, contours, strict=True)], np.bool_),
        entry=np.array(
            [_entry(r, c, sizes) for r, c in zip(rows, contours, strict=True)], np.int32
        ),
        path_offsets=_offsets([len(p) for p in paths]),
        path=np.concatenate([np.empty((0, 3)), *paths]),
        begin_s=np.array(
            [row.number("begin_s", least=0.0, most=LARGEST_SECONDS) for row in rows], np.float64
        ),
        end_s=np.array([_end(row) for row in rows], np.float64),
        after_offsets=_offsets([len(edges) for edges in after]),
        after_head=np.array([edge.head for edge in flat], np.int32),
        after_action=np.array([edge.action for edge in flat], np.int32),
        after_point=np.array([edge.point for edge in flat], np.int32),
        after_lag_s=np.array([edge.lag_s for edge in flat], np.float64),
    )


def _offsets(lengths: Sequence[int]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


def _kind(row: Fields) -> int:
    name = row.text("kind")
    if name not in _KINDS:
        row.fail("kind", f"unknown kind {shown(name)}", f"known: {', '.join(_KINDS)}")
    return int(_KINDS[name])


def _contour(row: Fields, kind: int, n: int) -> int:
    if kind == ActionKind.PRINT:
        return row.integer("contour", least=0, below=n)
    if row.need("contour") is not None:
        row.fail("contour", "only a print action has a contour", "write null")
    return NO_CONTOUR


def _path(row: Fields) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    path = points(row.need("path"), (3,), row.at("path"), row.path, most=LARGEST_MM)
    if not len(path):
        row.fail("path", "empty", "a head that rests has its place as the one point")
    return path


def _reversed(row: Fields, contour: int) -> bool:
    is_reversed = row.flag("reversed")
    if is_reversed and contour == NO_CONTOUR:
        row.fail("reversed", "true, but nothing is printed")
    return is_reversed


def _entry(row: Fields, contour: int, sizes: Sequence[int]) -> int:
    return row.integer("entry", least=0, below=1 if contour == NO_CONTOUR else sizes[contour])


def _end(row: Fields) -> float:
    end = row.number("end_s", most=LARGEST_SECONDS)
    if end < row.number("begin_s"):
        row.fail("end_s", f"{end:g} is before begin_s {row.number('begin_s'):g}")
    return end


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

    Raises
    ------
    InputError
        Naming the first wrong place.
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
