"""Why heads wait: what each wait ends with, the rule behind it, and the critical path.

A wait ends when the last of what its action waits for has happened. That is an action of
another head (`after` in plan.json), or time that must pass after it. Where all of that has
happened before the head stops, it stops only to be heard: heads signal one another at rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from decmcts.arrays import Floats
from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.print.plan import ACTION_END, ActionKind, HeadActions, PlanDocument

SHORT_S = 0.05  # a shorter pause is no wait
COOLING_S = 0.5  # a lag of so much is there for plastic to cool; signals take less
FAR = 20_000  # contours looked through for a chain of rules from one to another

CAUSES: Mapping[EdgeKind, str] = {
    EdgeKind.GEOMETRY: "support",
    EdgeKind.CONTACT: "support",
    EdgeKind.PROCESS: "order",
    EdgeKind.QUALITY: "order",
    EdgeKind.STATE: "tool",
    EdgeKind.PRIMING: "priming",
    EdgeKind.LEAD: "layers",
}


@dataclass(frozen=True, slots=True)
class Wait:
    """A time in which a head does nothing, and what for."""

    head: int
    begin_s: float
    end_s: float
    cause: str  # a value of `CAUSES`, "space", "cooling", "signal", "end" or "unused"
    action: int | None = None  # of this head, which begins when the wait ends
    other_head: int | None = None
    other_action: int | None = None  # what is waited for
    lag_s: float = 0.0  # and what must pass after it


def waits_of(document: PlanDocument, graph: DependencyGraph | None) -> list[Wait]:
    """Return every wait of every head, by begin.

    Without the graph of the planner, which knows the kind of each rule, the plan's own pairs
    tell that there is one; then it is called "support".
    """
    rules = graph or DependencyGraph.from_pairs(len(document.contours), document.precedence)
    found: list[Wait] = []
    for head in range(len(document.plan.heads)):
        found += _of_head(document, head, rules)
    return sorted(found, key=lambda wait: (wait.begin_s, wait.head))


def _of_head(document: PlanDocument, head: int, rules: DependencyGraph) -> list[Wait]:
    heads, end_s = document.plan.heads, document.plan.makespan_s
    actions, found = heads[head], list[Wait]()
    free_s = free_before(actions)
    idle = actions.begin_s - free_s >= SHORT_S
    for k in np.flatnonzero(idle | (actions.kind == ActionKind.WAIT)).tolist():
        begin, end = float(free_s[k]), float(actions.begin_s[k])
        if end - begin >= SHORT_S:
            found.append(_explained(heads, head, k, begin, rules))
        if actions.kind[k] == ActionKind.WAIT and actions.end_s[k] - end >= SHORT_S:
            following = k + 1 if k + 1 < len(actions) else None
            found.append(Wait(head, end, float(actions.end_s[k]), "cooling", following))
    at = float(actions.end_s[-1]) if len(actions) else 0.0
    if end_s - at >= SHORT_S:
        prints = (actions.kind == ActionKind.PRINT).any()
        found.append(Wait(head, at, end_s, "end" if prints else "unused"))
    return found


def free_before(actions: HeadActions) -> Floats:
    """Return when the action before each one ended, (k,) s; 0 where there is none."""
    return np.append(0.0, actions.end_s)[: len(actions)]


def _explained(
    heads: tuple[HeadActions, ...], head: int, k: int, begin: float, rules: DependencyGraph
) -> Wait:
    actions = heads[head]
    end = float(actions.begin_s[k])
    last = last_released(heads, head, k, by_s=begin)
    if last is None:
        return Wait(head, begin, end, "cooling" if len(heads) == 1 else "signal", k)
    other, action, lag = last
    cause = "cooling"
    if lag < COOLING_S or lag < end - begin - SHORT_S:
        cause = _rule(heads[other], action, actions, k, rules)
    return Wait(head, begin, end, cause, k, other, action, lag)


def last_released(
    heads: tuple[HeadActions, ...], head: int, k: int, *, by_s: float
) -> tuple[int, int, float] | None:
    """Return the head and action that released action k last, and the lag after it.

    None where all of it had happened by `by_s`, s: then action k waits for none of it.
    """
    latest, found = by_s + SHORT_S, None
    for edge in heads[head].after_edges(k):
        when = passed_s(heads[edge.head], edge.action, edge.point) + edge.lag_s
        if when > latest:
            latest, found = when, (edge.head, edge.action, edge.lag_s)
    return found


def passed_s(actions: HeadActions, action: int, point: int) -> float:
    """Return about when an action's nozzle passes a point of its path, s."""
    begin, end = float(actions.begin_s[action]), float(actions.end_s[action])
    if point == ACTION_END:
        return end
    steps = np.linalg.norm(np.diff(actions.action_path(action), axis=0), axis=1)
    return begin + (end - begin) * float(steps[:point].sum()) / max(float(steps.sum()), 1e-9)


def _rule(
    other: HeadActions, action: int, actions: HeadActions, k: int, rules: DependencyGraph
) -> str:
    """Return why an action of another head comes before what is printed next, from action k on."""
    soon = k + np.flatnonzero(actions.kind[k : k + 8] == ActionKind.PRINT)
    if other.kind[action] != ActionKind.PRINT or not len(soon):
        return "space"
    first, last = int(other.contour[action]), int(actions.contour[soon[0]])
    return chain_cause(rules, first, last) or "space"


def chain_cause(rules: DependencyGraph, first: int, last: int) -> str | None:
    """Return the cause by which contour `first` comes before `last`, or None if none does.

    That of the last rule of a chain; chains through more than `FAR` contours are not looked for.
    """
    seen, waiting = {last: ""}, [last]
    while waiting and len(seen) < FAR:
        contour = waiting.pop()
        rows = slice(int(rules.pred_offsets[contour]), int(rules.pred_offsets[contour + 1]))
        for pred, kind in zip(rules.preds[rows].tolist(), rules.kinds[rows].tolist(), strict=True):
            if pred < first or pred in seen:
                continue
            seen[pred] = seen[contour] or CAUSES[EdgeKind(kind)]
            if pred == first:
                return seen[pred]
            waiting.append(pred)
    return None


def sums_of(waits: list[Wait]) -> list[dict[str, Any]]:
    """Return how long and how often heads wait, by cause, the longest first."""
    seconds: dict[str, list[float]] = {}
    for wait in waits:
        seconds.setdefault(wait.cause, []).append(wait.end_s - wait.begin_s)
    rows = [
        {"cause": cause, "seconds": round(sum(each), 3), "count": len(each)}
        for cause, each in seconds.items()
    ]
    return sorted(rows, key=lambda row: -float(row["seconds"]))


def critical_path(document: PlanDocument) -> list[tuple[int, int]]:
    """Return the actions the makespan hangs on as (head, action), first to last."""
    heads = document.plan.heads
    ends = [float(actions.end_s[-1]) if len(actions) else -1.0 for actions in heads]
    if not ends or max(ends) < 0.0:
        return []
    head = int(np.argmax(ends))
    k = len(heads[head]) - 1
    free_s = [free_before(actions) for actions in heads]
    path = [(head, k)]
    while True:
        last = last_released(heads, head, k, by_s=float(free_s[head][k]))
        if last is not None and heads[last[0]].begin_s[last[1]] < heads[head].begin_s[k]:
            head, k = last[0], last[1]
        elif k == 0:
            return path[::-1]
        else:
            k -= 1
        path.append((head, k))


def aside_s(actions: HeadActions) -> float:
    """Return the time a head spends on stepping aside: travels that lead to no contour, s.

    The last way to the park is not among them.
    """
    moving = (actions.kind == ActionKind.TRAVEL) | (actions.kind == ActionKind.PARK)
    leads = np.concatenate([actions.kind[1:] == ActionKind.PRINT, [True]])[: len(actions)]
    away = moving & ~leads
    return float((actions.end_s - actions.begin_s)[away].sum())
