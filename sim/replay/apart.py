"""Heads that may move or rest at the same time keep their distance: J3, and the rails.

Composition only: what may happen together is found in `bodies`, how near the heads come at the
least in `heads_near`.
"""

from __future__ import annotations

from itertools import combinations, permutations

from decmcts.print.machine import Rail
from decmcts.print.plan import PlanDocument
from sim.content.legs import Legs
from sim.faults import LIMIT, Fault, FaultKind, Gap, listed
from sim.replay.bodies import concurrent, find_clashes, find_rail_breaks
from sim.replay.heads_near import least_gap
from sim.rules.order import PartialOrder


def check_heads(document: PlanDocument, legs: Legs, order: PartialOrder) -> list[Fault]:
    """J3: heads that may move or rest at the same time keep their distance."""
    lines: list[str] = []
    for r, s in permutations(range(len(legs.all_actions)), 2):
        for stations, others in concurrent(document.machine.heads, legs.all_actions, order, r, s):
            clashes = find_clashes(
                stations,
                document.machine.heads[r],
                others,
                document.machine.heads[s],
                clearance_mm=document.machine.head_clearance_mm,
                limit=2 * LIMIT,
            )
            lines += [
                f"{legs.station(r, c.action, c.rest)} and "
                f"{legs.station(s, c.other_action, others.rest)} may happen together "
                f"and come within {c.gap_mm:.3f} mm ({c.part}, {c.other_part})"
                for c in clashes
            ]
    return listed(FaultKind.HEAD_HEAD, lines)


def check_rail(document: PlanDocument, legs: Legs, order: PartialOrder) -> list[Fault]:
    """Heads on one rail keep their order and their separation, whatever the timing."""
    rails = document.machine.rails
    lines = [line for rail in rails for line in _rail_lines(document, legs, order, rail)]
    return listed(FaultKind.RAIL, lines)


def _rail_lines(document: PlanDocument, legs: Legs, order: PartialOrder, rail: Rail) -> list[str]:
    names = [head.name for head in document.machine.heads]
    place = {name: i for i, name in enumerate(rail.order)}
    lines: list[str] = []
    for r, s in permutations(range(len(legs.all_actions)), 2):
        if names[r] not in place or names[s] not in place:
            continue
        steps = place[names[s]] - place[names[r]]
        least = rail.separation_mm * abs(steps)
        for stations, others in concurrent(document.machine.heads, legs.all_actions, order, r, s):
            lines += [
                f"{legs.station(r, a, stations.rest)} and {legs.station(s, b, others.rest)} "
                f"may happen together and be {gap:.3f} mm apart along {'xy'[rail.axis]}, "
                f"less than {least:g} mm"
                for a, b, gap in find_rail_breaks(
                    stations,
                    others,
                    axis=rail.axis,
                    separation_mm=least,
                    below=steps > 0,
                    limit=2 * LIMIT,
                )
            ]
    return lines


def count_pairs(legs: Legs, order: PartialOrder) -> int:
    """Return how many pairs of actions of different heads may run at the same time.

    Actions that others wait for midway count leg by leg.
    """
    pairs = combinations(range(len(legs.all_actions)), 2)
    return sum(int((order.following(r, s) - order.preceding(r, s)).sum()) for r, s in pairs)


def nearest_heads(document: PlanDocument, legs: Legs, order: PartialOrder) -> Gap | None:
    """Return how near any two heads may come, over all that they may do at the same time."""
    machine = document.machine
    near = least_gap(machine.heads, legs.all_actions, order)
    if near.heads[0] < 0:
        return None
    r, s = near.heads
    return Gap(
        near.gap_mm,
        machine.head_clearance_mm,
        (machine.heads[r].name, machine.heads[s].name),
        (
            legs.station(r, near.action, near.rest),
            legs.station(s, near.other_action, near.other_rest),
        ),
        near.at_least,
    )
