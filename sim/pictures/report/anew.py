"""What a failure changed: each plan that took another's place, beside the one that was left."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from decmcts.arrays import Flags, Ints
from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions, JointPlan, PlanDocument
from decmcts.print.print_events import EventLog
from decmcts.print.print_state import happened
from sim.pictures.report.blobs import Blobs
from sim.pictures.report.toolpaths import times_of

SAME_MM = 3e-3  # both files round
NOBODY = -1


@dataclass(frozen=True, slots=True)
class Anew:
    """A plan that was carried out."""

    document: PlanDocument
    log: EventLog


def changes_by(plans: Sequence[Anew], blobs: Blobs) -> list[dict[str, Any]]:
    """Return for each plan but the first what it changed, and what its heads did.

    Times are seconds of the print: when a plan began by its first event, when it would have ended
    by its own times from then on, and when it did.
    """
    found, begin_s = list[dict[str, Any]](), 0.0
    for old, new in pairwise(plans):
        old_end_s = begin_s + old.document.plan.makespan_s
        begin_s = min(event.time_s for event in new.log.events)
        left = np.ones(len(old.document.contours), np.bool_)  # what it left unprinted
        for actions in happened(old.document, old.log).plan.heads:
            left[_printed(actions)] = False
        carried = happened(new.document, new.log).plan
        found.append(
            {
                "begin_s": begin_s,
                "old_end_s": old_end_s,
                "new_end_s": begin_s + new.document.plan.makespan_s,
                "ended_s": carried.makespan_s,
                "left": int(left.sum()),
                "heads": _of_heads(old.document.plan, new.document.plan, left),
                "moved": _moved(old.document, new.document, left),
                "rows": [
                    {
                        "name": actions.head,
                        "n": len(actions),
                        "kind": blobs.add(actions.kind),
                        **times_of(actions, blobs),
                    }
                    for actions in carried.heads
                ],
            }
        )
    return found


def _of_heads(old: JointPlan, new: JointPlan, left: Flags) -> list[dict[str, Any]]:
    """Return how many beads each head had left to print, and has by the new plan."""
    now = {actions.head: len(_printed(actions)) for actions in new.heads}
    return [
        {
            "name": actions.head, "left": int(left[_printed(actions)].sum()),
            "now": now.get(actions.head, 0),
        }
        for actions in old.heads
    ]  # fmt: skip


def _printed(actions: HeadActions) -> Ints:
    return np.asarray(actions.contour[actions.kind == ActionKind.PRINT], np.int64)


def _moved(old: PlanDocument, new: PlanDocument, left: Flags) -> list[dict[str, Any]]:
    """Return how many beads of a new plan heads print that others should have printed."""
    was, now = (_head_of(plan.plan, len(plan.contours)) for plan in (old, new))
    of = _old_of(old.contours, new.contours, left)
    pairs = Counter(
        (int(was[of[c]]), int(now[c])) for c in np.flatnonzero((of >= 0) & (now >= 0)).tolist()
    )
    names = [[actions.head for actions in plan.plan.heads] for plan in (old, new)]
    return [
        {"was": names[0][h], "now": names[1][k], "beads": count}
        for (h, k), count in sorted(pairs.items())
        if h != NOBODY and names[0][h] != names[1][k]
    ]


def _head_of(plan: JointPlan, n: int) -> Ints:
    head = np.full(n, NOBODY, np.int64)
    for h, actions in enumerate(plan.heads):
        head[_printed(actions)] = h
    return head


def _old_of(old: Contours, new: Contours, left: Flags) -> Ints:
    """Return the bead of the old plan that each of the new one is of, (n,); NOBODY: none is found.

    Both ends of what was cut anew, taken together, are points of it; of a bead that was broken off
    one end.
    """
    owner = np.repeat(np.arange(len(old)), np.diff(old.offsets))
    rows = np.flatnonzero(left[owner])
    found = np.full(len(new), NOBODY, np.int64)
    if not len(rows) or not len(new):
        return found
    tree = cKDTree(old.points[rows])
    whole, first, back = np.unique(new.sources, return_index=True, return_inverse=True)
    last = np.append(first[1:], len(new)) - 1
    of_whole = np.full(len(whole), NOBODY, np.int64)
    for k, ends in enumerate(zip(new.start[first], new.end[last], strict=True)):
        at_begin, at_end = (
            set(owner[rows[tree.query_ball_point(place, SAME_MM)]].tolist()) for place in ends
        )
        of_whole[k] = min(at_begin & at_end or at_end or at_begin, default=NOBODY)
    return np.asarray(of_whole[back.ravel()])
