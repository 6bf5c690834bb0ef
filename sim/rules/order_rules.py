"""Checking the order of a plan by all rules, and stating which rules those were.

Composition only: each kind of edge is found anew in a module of its own.
"""

from __future__ import annotations

from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import OrderRules, PlanDocument
from sim.content.legs import Legs
from sim.faults import Fault
from sim.rules.order import PartialOrder
from sim.rules.precedence import (
    check_epochs,
    check_freedom,
    check_lead,
    check_precedence,
    check_touching,
    prints_of,
)
from sim.rules.priming import check_priming


def usual_rules(machine: Machine) -> OrderRules:
    """Return the rules a plan that states none is held to: the defaults of `decmcts plan`.

    But any freedom is allowed: whether seams moved rightly is judged in any case.
    """
    return OrderRules(quality=machine.bead_width)


def check_order(
    document: PlanDocument,
    source: PrintJob | None,
    legs: Legs,
    order: PartialOrder,
    rules: OrderRules,
) -> list[Fault]:
    """J2: what must come before what, by the plan's pairs and by the definitions.

    Roles, layers and epochs of contours are taken from the source, where one is given with as
    many contours.
    """
    contours: Contours = document.contours
    refills: tuple[int, ...] = ()
    if source is not None:
        refills = source.refills
        if len(source.contours) == len(contours):
            contours = source.contours
    all_actions = legs.all_actions
    prints = prints_of(len(contours), all_actions, order)
    faults = [
        *check_precedence(document.precedence, prints),
        *check_touching(contours, prints, rules),
        *check_epochs(contours, all_actions, order),
        *check_priming(contours, all_actions, order, refills=refills),
        *check_freedom(document.contours, legs.whole, rules),
    ]
    if rules.max_layers_ahead is not None:
        faults += check_lead(contours, all_actions, order, rules.max_layers_ahead)
    return faults


def statements(
    document: PlanDocument,
    source: PrintJob | None,
    machine: Machine | None,
    held: OrderRules,
    imposed: OrderRules | None,
) -> tuple[str, ...]:
    """Return one line each on the rules that counted, and on what was believed without a check."""
    if imposed is not None:
        by = "as asked"
    else:
        by = "as the plan says" if document.rules else "the defaults: no plan states others"
    ahead = held.max_layers_ahead
    rule = document.min_layer_time_s
    cooling = f"{rule:g} s" if rule else "none"
    own = f"{document.machine.name}, as the plan has it"
    limits = "" if source is not None else "; its limits were believed"
    return (
        f"order: process order {held.process_order}, quality {'on' if held.quality else 'off'}, "
        f"layers ahead {'unlimited' if ahead is None else ahead}, freedom {held.freedom} ({by})",
        f"time before a spot is printed over: {cooling}",
        f"machine: {own if machine is None else machine.name + limits}",
        "contours: as the plan has them, no source was given"
        if source is None
        else "contours: compared with the source in all fields",
    )
