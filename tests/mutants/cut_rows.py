"""Changes of the plan.json of a cut print that keep it whole.

What is done to one piece is done to its action too, to the travels beside it and to the times of
all that comes later. Mutants of cut prints are made of these, so that a judge has to find the
fault itself and not what a careless change leaves behind.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from tests.mutants.catalogue import NotHereError

Plan = dict[str, Any]
Row = dict[str, Any]
LIFT_MM = 0.4
PER_SEGMENT = ("extrusion", "feed", "acceleration")


def brothers(plan: Plan) -> dict[int, list[int]]:
    """Return the pieces of each contour of the source that is cut into several."""
    found: dict[int, list[int]] = defaultdict(list)
    for row in plan["contours"]:
        found[row["of"]].append(row["id"])
    return {of: pieces for of, pieces in found.items() if len(pieces) > 1}


def place_of(plan: Plan, contour: int) -> tuple[list[Row], int]:
    """Return the actions of the head that prints a contour, and where it does."""
    for head in plan["heads"]:
        for k, action in enumerate(head["actions"]):
            if action["contour"] == contour and action["kind"] == "print":
                return head["actions"], k
    raise NotHereError


def per_segment(row: Row, name: str) -> list[float]:
    """Return a value for each segment of a row, where it has one for all too."""
    value = row[name]
    return list(value) if isinstance(value, list) else [value] * (len(row["points"]) - 1)


def segments(row: Row, first: int, last: int) -> Row:
    """Return a row of some segments of another: what lies between two of its points."""
    part = {**row, "closed": False}
    for name in ("points", "along"):
        part[name] = row[name][first : last + 1]
    for name in PER_SEGMENT:
        if name in row:
            part[name] = per_segment(row, name)[first:last]
    return part


def later(plan: Plan, at_s: float, by_s: float) -> None:
    """Let all that begins or ends at a time, or after it, do so later."""
    for head in plan["heads"]:
        for action in head["actions"]:
            action["begin_s"] += by_s if action["begin_s"] >= at_s else 0.0
            action["end_s"] += by_s if action["end_s"] >= at_s else 0.0


def lifted(start: list[float], goal: list[float]) -> list[list[float]]:
    """Return the path of a travel above the print."""
    z = max(start[2], goal[2]) + LIFT_MM
    return [start, [*start[:2], z], [*goal[:2], z], goal]


def follow(plan: Plan, contour: int, *, reverse: bool = False) -> None:
    """Let the action of a contour run where the contour now runs, and the travels fit it.

    With `reverse` it runs from the other end than before.
    """
    actions, k = place_of(plan, contour)
    row, action = plan["contours"][contour], actions[k]
    z = row["z"] if row["z"] is not None else action["path"][0][2]
    path = [[*point[:2], z] for point in row["points"]]
    action["reversed"] ^= reverse
    action["path"] = path[::-1] if action["reversed"] else path
    for near, end, mine in ((actions[k - 1], -1, 0), (actions[k + 1], 0, -1)):
        if near["path"][end] == action["path"][mine]:
            continue
        if near["kind"] == "print":
            raise NotHereError
        near["path"] = [*near["path"][:end], action["path"][mine]] if end else [
            action["path"][mine], *near["path"][1:]
        ]  # fmt: skip
        if end and len(near["path"]) > 2:
            near["path"][-2] = [*action["path"][mine][:2], near["path"][-2][2]]
        elif len(near["path"]) > 2:
            near["path"][1] = [*action["path"][mine][:2], near["path"][1][2]]
    for each in actions[k - 1 : k + 2]:
        later(plan, each["end_s"], 5.0)


def travel_only(plan: Plan, contour: int) -> None:
    """Let the head run along a contour without printing it."""
    actions, k = place_of(plan, contour)
    actions[k] |= {"kind": "travel", "contour": None, "reversed": False, "entry": 0}
    later(plan, actions[k]["end_s"], 5.0)


def drop_row(plan: Plan, gone: int) -> None:
    """Take a contour that is not printed out of the list; the others get other numbers."""
    del plan["contours"][gone]
    _renumber(plan, {c: c - (c > gone) for c in range(len(plan["contours"]) + 1) if c != gone})


def add_row(plan: Plan, row: Row, at: int) -> None:
    """Put a contour into the list; those behind it get other numbers."""
    plan["contours"].insert(at, row)
    _renumber(plan, {c: c + (c >= at) for c in range(len(plan["contours"]) - 1)})


def _renumber(plan: Plan, number: dict[int, int]) -> None:
    for k, row in enumerate(plan["contours"]):
        row["id"] = k
    pairs = [p for p in plan["precedence"] if p[0] in number and p[1] in number]
    plan["precedence"] = [[number[a], number[b]] for a, b in pairs]
    for head in plan["heads"]:
        for action in head["actions"]:
            if action["contour"] is not None:
                action["contour"] = number[action["contour"]]


def add_actions(plan: Plan, actions: list[Row], at: int, more: list[Row]) -> None:
    """Put actions, each with the seconds it takes as `takes_s`, into those of a head.

    They begin when the action before them ends; what waits for that waits for the last of them.
    """
    mine = next(k for k, head in enumerate(plan["heads"]) if head["actions"] is actions)
    name, ended = plan["heads"][mine]["name"], actions[at - 1]["end_s"]
    takes = [each.pop("takes_s") for each in more]
    later(plan, ended, sum(takes))
    actions[at - 1]["end_s"] = ended
    for each, seconds in zip(more, takes, strict=True):
        each |= {"begin_s": ended, "end_s": ended + seconds, "after": []}
        ended += seconds
    actions[at:at] = more
    for head in plan["heads"]:
        for action in head["actions"]:
            for edge in action["after"]:
                if edge[0] == name and (edge[1] >= at or (edge[1] == at - 1 and edge[2] is None)):
                    edge[1] += len(more)


def split(plan: Plan, contour: int, vertex: int) -> None:
    """Cut a contour of the list in two at one of its points, printed one after the other."""
    actions, k = place_of(plan, contour)
    row, action = plan["contours"][contour], actions[k]
    if action["entry"] or not 0 < vertex < len(row["points"]) - 1:
        raise NotHereError
    first, second = segments(row, 0, vertex), segments(row, vertex, len(row["points"]) - 1)
    at = contour + 1
    while at < len(plan["contours"]) and plan["contours"][at]["of"] == row["of"] and (
        plan["contours"][at]["along"][0] < second["along"][0]
    ):  # fmt: skip
        at += 1
    plan["contours"][contour] = first
    add_row(plan, second, at)
    turn = len(row["points"]) - 1 - vertex if action["reversed"] else vertex
    begin, end = (at, contour) if action["reversed"] else (contour, at)
    if any(edge[2] is not None and edge[:2] == [head["name"], k]
           for head in plan["heads"] for other in plan["heads"] for a in other["actions"]
           for edge in a["after"] if head["actions"] is actions):  # fmt: skip
        raise NotHereError  # a point of it is waited for: points have other numbers then
    rest = {**action, "contour": end, "path": action["path"][turn:]}
    action |= {"contour": begin, "path": action["path"][: turn + 1]}
    takes = action["end_s"] - action["begin_s"]
    add_actions(plan, actions, k + 1, [rest | {"takes_s": takes + 1.0}])
