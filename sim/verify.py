"""The judge: checks a plan with logic of its own.

Composition only; each rule is checked in a module of its own. Nothing of the
planner's algorithms is imported here, only its data types.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import HeadActions, OrderRules, PlanDocument, end_edges
from sim.content.inventory import compare, contour_segments, match_segments
from sim.content.paths import Legs, check_head, check_once, check_release, check_structure, legs_of
from sim.content.pieces import check_welds, parted_source
from sim.content.same_print import (
    check_accelerations,
    check_contours,
    check_living,
    check_machine,
    check_print,
    is_other_print,
)
from sim.faults import LIMIT, Fault, FaultKind, Gap, Nearest, Verdict, listed
from sim.files.extent import check_extent
from sim.replay.bodies import check_heads, check_rail, count_pairs
from sim.replay.contacts import (
    Meetings,
    allowed_in_plan,
    asked_near,
    check_meetings,
    source_meetings,
)
from sim.replay.execution import check_replays
from sim.replay.fenced import beads_for, check_fenced, moves_of
from sim.replay.heads_near import nearest_heads
from sim.replay.least import least_arrivals, with_waits
from sim.replay.material import find_contacts, or_undecided, place_of
from sim.replay.nominal import check_least, check_metrics, check_signals, check_times
from sim.replay.shapes import as_material, beads_there
from sim.rules.cooling import check_cooling
from sim.rules.order import PartialOrder, order_of
from sim.rules.order_rules import check_order, statements, usual_rules
from sim.rules.precedence import prints_of

PLAN_TOLERANCE_MM = 1e-4  # overlap of head and bead that counts as touching


def verify_plan(
    document: PlanDocument,
    *,
    source: PrintJob | None = None,
    machine: Machine | None = None,
    rules: OrderRules | None = None,
    digest: str | None = None,
    trials: int = 3,
    seed: int = 0,
) -> Verdict:
    """Check a joint plan for every execution its partial order allows.

    What must come before what is found anew: the plan's own pairs are checked, not believed.

    Parameters
    ----------
    document : PlanDocument
        The plan with its machine and contours.
    source : PrintJob | None
        The print it was made from; when given, every contour is compared in all its fields.
    machine : Machine | None
        The machine it must be for; None: the plan's own is believed.
    rules : OrderRules | None
        What the order is held to; None: what the plan says, else `usual_rules`.
    digest : str | None
        Digest of the problem the plan should be for; compared when given.
    trials : int
        Number of random timings in the replay, besides the nominal and the adversarial ones.
    seed : int
        Seeds the random trials.

    Returns
    -------
    Verdict
        All faults found, of each kind a few dozen at most, and what was checked.
    """
    faults = check_structure(document)
    if faults:
        return Verdict(tuple(faults))
    held = rules or document.rules or usual_rules(document.machine)
    if source is not None:
        feed = document.machine.limits.travel_feed
        parted = parted_source(document.contours, source, held.cut, travel_feed=feed)
        if parted.faults:
            return Verdict(parted.faults)
        source = parted.job
    if digest is not None and digest != document.problem:
        text = f"the plan is for problem {document.problem!r}, expected {digest!r}"
        faults.append(Fault(FaultKind.DIGEST, text))
    all_actions = all_actions_of(document)
    meetings, unsure = _meetings(document)
    faults += unsure + _check_content(document, all_actions, source, machine)
    if is_other_print(faults):
        return Verdict(tuple(faults))
    legs = legs_of(all_actions)
    order = order_of(legs.all_actions)
    counts: dict[str, float] = {
        "contours": len(document.contours),
        "actions": sum(map(len, legs.whole)),
        "heads": len(document.machine.heads),
        "trials": trials,
    }
    nearest = Nearest()
    if isinstance(order, list):
        lines = [f"{legs.describe(h, leg)} can never begin" for h, leg in order]
        faults += listed(FaultKind.DEADLOCK, lines)
    else:
        faults += check_order(document, source, legs, order, held)
        rests = len(legs.whole) > 1  # each may have to wait for another
        least = [least_arrivals(document, each, source, rests=rests) for each in legs.whole]
        faults += check_least(legs.whole, least) + check_metrics(document, legs.whole)
        faults += check_welds(document, legs.whole, held.weld_limit_s)
        prints = prints_of(len(document.contours), legs.all_actions, order)
        faults += check_meetings(meetings, legs.all_actions, prints)
        executions = _Executions(document, legs, order, meetings, counts)
        more, nearest = executions.check(least, trials, seed)
        faults += more
    checked = statements(document, source, machine, held, rules)
    return Verdict(tuple(faults), counts, checked, nearest=nearest)


def _check_content(
    document: PlanDocument,
    all_actions: tuple[HeadActions, ...],
    source: PrintJob | None,
    machine: Machine | None,
) -> list[Fault]:
    """Check what is printed where, in any order: J1, and the source and machine where given.

    If the source is another print, that is the only fault returned.
    """
    faults = check_once(document) + check_release(document)
    for actions, head in zip(all_actions, document.machine.heads, strict=True):
        faults += check_head(document.contours, actions, head)
    known = None if source is None else source.contours
    faults += check_extent(document.contours, known, all_actions, document.machine)
    if source is not None and source.contours is not document.contours:
        ours, theirs = contour_segments(document.contours), contour_segments(source.contours)
        match = match_segments(ours, theirs)
        if other := check_print(ours, theirs, match, theirs.place):
            return other
        faults += compare(ours, theirs, match)
        faults += check_contours(document.contours, source.contours)
    if source is not None and source.printed is not None and document.printed is None:
        text = "the plan does not say what is printed before it begins"
        faults.append(Fault(FaultKind.CONTOUR, text))
    if source is not None:
        faults += check_accelerations(document.acceleration, source)
    if document.fenced is not None:
        faults += check_living(document.machine, document.fenced)
    if machine is not None:
        whole = document.machine if document.fenced is None else document.fenced.machine
        faults += check_machine(whole, machine, source)
    return faults


def _meetings(document: PlanDocument) -> tuple[list[Meetings], list[Fault]]:
    """Return of each head the contacts that the source makes, or a fault where that is unsure."""
    found, machine = list[Meetings](), document.machine

    def find() -> list[Fault]:
        for head in machine.heads:
            found.append(source_meetings(document.contours, machine, head, PLAN_TOLERANCE_MM))
        return []

    return found, or_undecided(find)


def all_actions_of(document: PlanDocument) -> tuple[HeadActions, ...]:
    """Return one action list per head of the machine, empty for a head without work."""
    given = {h.head: h for h in document.plan.heads}
    machine_order = [h.name for h in document.machine.heads]
    renumber = np.array([machine_order.index(h.head) for h in document.plan.heads] or [0], np.int32)
    ints, none, empty = np.zeros(1, np.int64), np.empty(0, np.int32), np.empty(0)
    all_actions = []
    for name in machine_order:
        if name in given:  # its `after` counts heads as the plan does
            actions = replace(given[name], after_head=renumber[given[name].after_head])
        else:
            actions = HeadActions(
                name, none.astype(np.int8), none, none.astype(bool), none, ints, np.empty((0, 3)),
                empty, empty, ints, none, none, *end_edges(0),
            )  # fmt: skip
        all_actions.append(actions)
    return tuple(all_actions)


class _Executions:
    """All executions that the order of a plan allows; adds what it has looked at to `counts`."""

    def __init__(
        self, document: PlanDocument, legs: Legs, order: PartialOrder, meetings: Sequence[Meetings],
        counts: dict[str, float],
    ) -> None:  # fmt: skip
        self.document, self.legs, self.order, self.counts = document, legs, order, counts
        self.machine, self.meetings = document.machine, meetings
        self.gaps = list[Gap]()  # how near each head comes to the print

    def check(self, least: list[Floats], trials: int, seed: int) -> tuple[list[Fault], Nearest]:
        """Check times, contacts and cooling; `least` are the seconds to each point of all paths."""
        document, legs, order = self.document, self.legs, self.order
        met = or_undecided(self._material)
        beside = None if met else min(self.gaps, key=lambda gap: gap.mm, default=None)
        self.counts["pairs"] = count_pairs(legs, order)
        arrivals = [with_waits(each, times) for each, times in zip(legs.whole, least, strict=True)]
        faults = [
            *check_times(document, legs.whole),
            *check_signals(document, legs.whole),
            *met,
            *check_heads(document, legs, order),
            *check_fenced(document),
            *check_rail(document, legs, order),
            *check_cooling(document, legs, order, arrivals),
            *check_replays(document, legs, order, arrivals, self.counts, trials, seed),
        ]
        return faults, Nearest(nearest_heads(document, legs, order), beside)

    def _material(self) -> list[Fault]:
        """J2 and J5 by geometry: no head touches anything not ordered later.

        But for what it touches in the source too, no less deep.
        """
        machine, lines = self.machine, list[str]()
        for h, actions in enumerate(self.legs.all_actions[: len(self.meetings)]):
            moves, owner = moves_of(actions, machine.heads[h].park)
            lines += self._into_printed(h, moves, owner)
            beads = beads_for(self.document.contours, self.legs, self.order, h)
            beads = as_material(beads, machine, PLAN_TOLERANCE_MM)
            self.counts["moves"] = self.counts.get("moves", 0) + len(moves)
            near = asked_near(self.meetings[h], actions, owner)
            contacts = find_contacts(
                moves, beads, machine.heads[h], clearance_mm=machine.clearance_mm,
                tolerance_mm=PLAN_TOLERANCE_MM, limit=10 * LIMIT,
                allowed=allowed_in_plan(self.meetings[h], actions, moves, owner, beads), near=near,
            )  # fmt: skip
            does = self.legs.station(h, int(owner[near.move]))
            self.gaps.append(near.gap(machine, h, does, "contour", beads.label))
            lines += [
                f"{self.legs.station(h, int(owner[c.move]))}: {c.part} meets contour "
                f"{beads.label[c.bead]}, which is {c.depth_mm:.3f} mm too high, near "
                f"{place_of(moves[c.move])}"
                for c in contacts
            ]
        return listed(FaultKind.HEAD_MATERIAL, lines)

    def _into_printed(self, head: int, moves: Floats, owner: Ints) -> list[str]:
        """Say where a head touches what stands on the bed before the plan begins."""
        if self.document.printed is None:
            return []
        machine = self.machine
        beads = as_material(beads_there(self.document.printed), machine, PLAN_TOLERANCE_MM)
        contacts = find_contacts(
            moves, beads, machine.heads[head], clearance_mm=machine.clearance_mm,
            tolerance_mm=PLAN_TOLERANCE_MM, limit=LIMIT,
        )  # fmt: skip
        return [
            f"{self.legs.station(head, int(owner[c.move]))}: {c.part} meets what was printed "
            f"before, which is {c.depth_mm:.3f} mm too high, near {place_of(moves[c.move])}"
            for c in contacts
        ]
