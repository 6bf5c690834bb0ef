"""Numbers for the places where one head waits for another, the same in every file.

The heads of a plan start one after the other (numbers 1 to H: head i is homed
and parked), then every action that another head waits for has a number, in the
order of nominal ends. Last come H numbers for heads that have printed all they
have to, and H for heads whose end code has run: it turns off the bed and the
motors, so it must wait for the others, and it may move, so one head goes after
the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from decmcts.print.plan import JointPlan


@dataclass(frozen=True, slots=True)
class SyncPoints:
    """Which action signals which number, and which numbers each action waits for."""

    signals: Mapping[tuple[int, int], int]  # (head, action) -> number, given after it ends
    waits: Mapping[tuple[int, int], tuple[int, ...]]  # (head, action) -> numbers, ascending
    done: tuple[int, ...]  # (heads,) given when a head has nothing left to print and is parked
    ended: tuple[int, ...]  # (heads,) given when a head's end code has run


def number_sync_points(plan: JointPlan) -> SyncPoints:
    """Return the synchronisation points of a joint plan."""
    waited: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for h, head in enumerate(plan.heads):
        for k in range(len(head)):
            if others := [pair for pair in head.after(k) if pair[0] != h]:
                waited[h, k] = others
    given = {pair for pairs in waited.values() for pair in pairs}
    ordered = sorted(given, key=lambda p: (float(plan.heads[p[0]].end_s[p[1]]), p))
    first = len(plan.heads) + 1
    signals = {pair: first + n for n, pair in enumerate(ordered)}
    last = first + len(ordered)
    return SyncPoints(
        signals,
        {at: tuple(sorted({signals[p] for p in pairs})) for at, pairs in waited.items()},
        tuple(range(last, last + len(plan.heads))),
        tuple(range(last + len(plan.heads), last + 2 * len(plan.heads))),
    )
