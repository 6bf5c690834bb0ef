"""How old the welds of a cut print are: what the plan says of them, and the limit it states.

A contour's stretches are put in a row by where on it they lie. Where one ends and the next begins
is a cut; what passes between the printing of both ends is the weld's age.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import pairwise
from statistics import median

import numpy as np

from decmcts.print.contours import Contours, Role
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.content.pieces import OUTSIDE
from sim.faults import Fault, FaultKind, listed

IN_ONE_GO_S = 1e-3  # between two ends that are one bead again
TOLERANCE_S = 2e-3  # of ages and of what is stated
TimedStretch = tuple[float, float, float, float]  # from and to which place, and when it is at each


def welds_of(document: PlanDocument, all_actions: Sequence[HeadActions]) -> dict[int, list[float]]:
    """Return the age of the weld at each cut of each contour that is cut, s; 0: in one go."""
    stretches: dict[int, list[TimedStretch]] = defaultdict(list)
    contours = document.contours
    if contours.of is None:
        return {}
    for actions in all_actions:
        for action in np.flatnonzero(actions.kind == ActionKind.PRINT).tolist():
            of = int(contours.of[actions.contour[action]])
            stretches[of] += _stretches(contours, actions, action)
    return {
        of: [_age(a, b) for a, b in pairwise(sorted(each))]
        for of, each in sorted(stretches.items())
        if len(each) > 1
    }


def _age(a: TimedStretch, b: TimedStretch) -> float:
    age = abs(b[2] - a[3])
    return age if age > IN_ONE_GO_S else 0.0


def _stretches(contours: Contours, actions: HeadActions, action: int) -> Iterator[TimedStretch]:
    """Yield the stretches that an action prints."""
    piece = int(actions.contour[action])
    first, end = int(contours.offsets[piece]), int(contours.offsets[piece + 1])
    assert contours.along is not None  # as `of`
    along, pushed = contours.along[first:end].tolist(), contours.extrusion[first:end].tolist()
    path = actions.action_path(action)
    if len(path) != len(along):  # a loop entered elsewhere; none that is cut is one
        return
    way = [0.0]
    for a, b in pairwise(path):
        way.append(way[-1] + float(np.linalg.norm(b - a)))
    begin = float(actions.begin_s[action])
    takes = float(actions.end_s[action]) - begin
    when = [begin + takes * passed / (way[-1] or 1.0) for passed in way]
    if actions.reversed[action]:
        when.reverse()
    hops = [0, *(k for k in range(1, len(along)) if pushed[k] == 0.0), len(along)]
    for low, high in pairwise(hops):
        yield along[low], along[high - 1], when[low], when[high - 1]


def check_welds(
    document: PlanDocument, all_actions: Sequence[HeadActions], limit_s: float | None
) -> list[Fault]:
    """Check the ages of welds against a limit, and all that the plan says of its cuts."""
    welds = welds_of(document, all_actions)
    late = [
        f"a weld of contour {of} is {max(ages):.1f} s old, {limit_s:g} s are allowed"
        for of, ages in welds.items()
        if limit_s is not None and max(ages) > limit_s + TOLERANCE_S
    ]
    return listed(FaultKind.WELD, late) + _misstated(document, welds)


def _misstated(document: PlanDocument, welds: dict[int, list[float]]) -> list[Fault]:
    """Return a fault for each figure of the metrics that the plan does not have."""
    stated: object = document.metrics.get("cut")
    if stated is None:
        return []
    contours, ages = document.contours, sorted(a for each in welds.values() for a in each if a)
    of = contours.sources.tolist()
    roles = {c: int(contours.role[bisect_left(of, c)]) for c in welds}
    due: dict[str, float | dict[str, int]] = {
        "contours": len(welds),
        "cuts": sum(map(len, welds.values())),
        "outside": sum(len(each) for c, each in welds.items() if roles[c] in OUTSIDE),
        "roles": _by_role(welds, roles),
        "welds": len(ages),
        "weld_median_s": median(ages) if ages else 0.0,
        "weld_most_s": max(ages, default=0.0),
    }
    figures = dict(stated) if isinstance(stated, dict) else {"cut": stated}
    lines = [
        f"cut.{name} is stated as {value}, the plan has {due.get(name, 'no such figure')}"
        for name, value in figures.items()
        if not _alike(value, due.get(name))
    ]
    return listed(FaultKind.WELD, lines)


def _by_role(welds: dict[int, list[float]], roles: dict[int, int]) -> dict[str, int]:
    """Return how many cuts are in what, by the name of the role."""
    found = Counter[str]()
    for c, ages in welds.items():
        found[Role(roles[c]).name.lower()] += len(ages)
    return dict(found)


def _alike(stated: object, due: float | dict[str, int] | None) -> bool:
    """Tell whether a figure is stated as it is due."""
    if isinstance(due, dict):
        return stated == due
    if due is None or isinstance(stated, bool) or not isinstance(stated, int | float):
        return False
    return due - TOLERANCE_S <= stated <= due + TOLERANCE_S  # not subtracted: an int may be huge
