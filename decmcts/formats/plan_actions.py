"""The actions of one head in plan.json as rows, and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from decmcts.formats.bounds import LARGEST_MM, LARGEST_SECONDS
from decmcts.formats.fields import Fields, points, shown
from decmcts.print.plan import ACTION_END, NO_CONTOUR, ActionKind, HeadActions

_KEYS = ("kind", "contour", "reversed", "entry", "path", "begin_s", "end_s", "after")
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
            "after": [[heads[h], a] for h, a in actions.after(i)],
        }


def actions_from_dicts(
    table: Fields, heads: Sequence[str], counts: Sequence[int], sizes: Sequence[int]
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
    after = [_after(row, table.text("name"), heads, counts) for row in rows]
    flat = [pair for pairs in after for pair in pairs]
    return HeadActions(
        head=table.text("name"),
        kind=np.array(kinds, np.int8),
        contour=np.array(contours, np.int32),
        reversed=np.array([row.flag("reversed") for row in rows], np.bool_),
        entry=np.array(
            [_entry(r, c, sizes) for r, c in zip(rows, contours, strict=True)], np.int32
        ),
        path_offsets=_offsets([len(p) for p in paths]),
        path=np.concatenate([np.empty((0, 3)), *paths]),
        begin_s=np.array(
            [row.number("begin_s", least=0.0, most=LARGEST_SECONDS) for row in rows], np.float64
        ),
        end_s=np.array([_end(row) for row in rows], np.float64),
        after_offsets=_offsets([len(pairs) for pairs in after]),
        after_head=np.array([head for head, _ in flat], np.int32),
        after_action=np.array([action for _, action in flat], np.int32),
        after_point=np.full(len(flat), ACTION_END, np.int32),
        after_lag_s=np.zeros(len(flat)),
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


def _entry(row: Fields, contour: int, sizes: Sequence[int]) -> int:
    return row.integer("entry", least=0, below=1 if contour == NO_CONTOUR else sizes[contour])


def _end(row: Fields) -> float:
    end = row.number("end_s", most=LARGEST_SECONDS)
    if end < row.number("begin_s"):
        row.fail("end_s", f"{end:g} is before begin_s {row.number('begin_s'):g}")
    return end


def _after(
    row: Fields, own: str, heads: Sequence[str], counts: Sequence[int]
) -> list[tuple[int, int]]:
    found = []
    for number, pair in enumerate(row.items("after")):
        key = f"after[{number}]"
        if type(pair) is not list or len(pair) != 2:
            row.fail(key, f"expected [head, action], found {shown(pair)}")
        name, action = pair
        if name not in heads or name == own:
            row.fail(key, f"{shown(name)} is not another head of the plan")
        head = heads.index(name)
        if type(action) is not int or not 0 <= action < counts[head]:
            row.fail(key, f"{name!r} has no action {shown(action)}, it has {counts[head]}")
        found.append((head, action))
    return found
