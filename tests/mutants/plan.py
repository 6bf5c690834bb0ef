"""Mutants of a plan.json, as the JSON object it holds (docs/plan-format.md).

Changes of actions are in `actions`, changes of what they wait for in `waits`,
all others here.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from tests.mutants.actions import (
    acceleration_raised,
    across_a_barrier,
    barrier_denied,
    below_the_bed,
    drop_a_print,
    entry_elsewhere,
    heads_exchanged,
    jump,
    longest_actions,
    no_time,
    off_the_bed,
    park_away,
    print_twice,
    process_order_swapped,
    reversed_unsaid,
    shift_contour,
    shift_path,
    skirt_last,
    some_print,
    sooner,
    start_away,
    time_backwards,
    travel_at,
    upper_layer_first,
    wait_that_moves,
)
from tests.mutants.catalogue import Mutant, NotHereError
from tests.mutants.waits import STOP_MUTANTS, TIME_MUTANTS, WAIT_MUTANTS

Plan = dict[str, Any]
Rng = np.random.Generator
HUGE = "@huge"  # stands for an integer of 5000 digits, which Python does not write


def _contour_field(name: str, change: Any) -> Any:
    def spoil(plan: Plan, rng: Rng) -> None:
        contour = plan["contours"][int(rng.integers(len(plan["contours"])))]
        contour[name] = change(contour[name])

    return spoil


def no_feed(plan: Plan, rng: Rng) -> None:
    """Print a contour at no speed at all."""
    plan["contours"][int(rng.integers(len(plan["contours"])))]["feed"] = 0


def no_precedence(plan: Plan, rng: Rng) -> None:
    """Say nothing of what comes before what."""
    plan["precedence"] = []


def swapped_precedence(plan: Plan, rng: Rng) -> None:
    """Exchange the two contours of every pair of the precedence."""
    plan["precedence"] = [[b, a] for a, b in plan["precedence"]]


def foreign_precedence(plan: Plan, rng: Rng) -> None:
    """Name a contour in the precedence that does not exist."""
    plan["precedence"].append([0, len(plan["contours"])])


def slim_head(plan: Plan, rng: Rng) -> None:
    """Make the machine's head smaller than the real one."""
    for head in plan["machine"]["heads"]:
        for one in head["slices"]:
            one["polygons"] = [[[x / 20, y / 20] for x, y in p] for p in one["polygons"]]


def _machine_field(name: str, value: Any) -> Any:
    def spoil(plan: Plan, rng: Rng) -> None:
        plan["machine"][name] = value

    return spoil


def park_elsewhere(plan: Plan, rng: Rng) -> None:
    """Move the machine's park, and the plan with it."""
    for head in plan["machine"]["heads"]:
        head["park"][1] += 7.0
    for head in plan["heads"]:
        if head["actions"]:
            head["actions"][0]["path"][0][1] += 7.0
            head["actions"][-1]["path"][-1][1] += 7.0


def lost_contour(plan: Plan, rng: Rng) -> None:
    """Take a contour out of the list and of the actions alike."""
    drop_a_print(plan, rng)
    printed = {a["contour"] for head in plan["heads"] for a in head["actions"]}
    gone = next(c["id"] for c in plan["contours"] if c["id"] not in printed)
    del plan["contours"][gone]
    for contour in plan["contours"][gone:]:
        contour["id"] -= 1
    for head in plan["heads"]:
        for action in head["actions"]:
            if action["contour"] is not None and action["contour"] > gone:
                action["contour"] -= 1
    pairs = [p for p in plan["precedence"] if gone not in p]
    plan["precedence"] = [[a - (a > gone), b - (b > gone)] for a, b in pairs]


def _number(value: Any) -> Any:
    """Return a mutant that puts a value where a coordinate stands."""

    def spoil(plan: Plan, rng: Rng) -> None:
        longest_actions(plan)[some_print(plan, rng)]["path"][0][0] = value

    return spoil


def far_bead(plan: Plan, rng: Rng) -> None:
    """Put one bead a hundred metres away."""
    actions, k = longest_actions(plan), some_print(plan, rng)
    plan["contours"][actions[k]["contour"]]["points"][1][0] = 1e5
    row = 1 if not actions[k]["reversed"] else len(actions[k]["path"]) - 2
    actions[k]["path"][row][0] = 1e5


def huge_integer(plan: Plan, rng: Rng) -> None:
    """Write an integer of thousands of digits."""
    plan["contours"][0]["line"] = HUGE


def unknown_key(plan: Plan, rng: Rng) -> None:
    """Misspell a key."""
    plan["contours"][0]["feeed"] = 1


def two_of_one_id(plan: Plan, rng: Rng) -> None:
    """Give two contours one number."""
    plan["contours"][1]["id"] = 0


def another_digest(plan: Plan, rng: Rng) -> None:
    """Say that the plan is for another problem."""
    plan["problem"] = "0" * 64


def other_metrics(plan: Plan, rng: Rng) -> None:
    """Put another figure of the search into the metrics."""
    plan["metrics"]["iterations"] = 1


def off_the_walls(plan: Plan, rng: Rng) -> None:
    """Say that no travel leads over outer walls."""
    if plan["metrics"].get("travel_over_walls_mm", 0.0) < 50.0:
        raise NotHereError
    plan["metrics"]["travel_over_walls_mm"] = 0.0


def as_text(plan: Plan) -> str:
    """Return a plan as the JSON text it is kept as."""
    return json.dumps(plan).replace(f'"{HUGE}"', "9" * 5000)


SAME_ORDER = "the order is the same and still keeps every rule, rebuilt from the source"

PLAN_MUTANTS: tuple[Mutant[Plan], ...] = (
    Mutant("a contour dropped", drop_a_print),
    Mutant("a contour printed twice", print_twice),
    Mutant("an upper layer first", upper_layer_first),
    Mutant("infill before its perimeter, precedence emptied", process_order_swapped, sealed=True),
    Mutant("across a change of temperature", across_a_barrier),
    Mutant("across a change of temperature that is denied", barrier_denied, sealed=True),
    Mutant("the skirt last, precedence emptied", skirt_last, sealed=True),
    Mutant("a contour elsewhere", shift_contour, sealed=True),
    Mutant("a path beside its contour", shift_path),
    Mutant("an open contour backwards unsaid", reversed_unsaid),
    Mutant("another entry than said", entry_elsewhere),
    Mutant("a jump", jump),
    Mutant("a travel through the print", travel_at(0.15)),
    Mutant("a travel at the height of the bed", travel_at(0.0)),
    Mutant("a travel below the bed", below_the_bed),
    Mutant("a travel off the machine", off_the_bed),
    Mutant("a wait that moves", wait_that_moves),
    Mutant("not parked at the end", park_away),
    Mutant("not parked at the start", start_away),
    Mutant("a travel in no time", no_time),
    Mutant("an end before its begin", time_backwards),
    Mutant("times before the start", sooner),
    Mutant("another acceleration", acceleration_raised),
    Mutant("feed 0", no_feed, sealed=True),
    Mutant(
        "less filament", _contour_field("extrusion", lambda v: [0.5 * e for e in v]), sealed=True
    ),
    Mutant("another feed", _contour_field("feed", lambda v: 7.0), sealed=True),
    Mutant("another bead width", _contour_field("width", lambda v: 0.1), sealed=True),
    Mutant("another bead height", _contour_field("height", lambda v: 0.1), sealed=True),
    Mutant("another role", _contour_field("role", lambda v: "ironing"), sealed=True),
    Mutant("another layer", _contour_field("layer", lambda v: v + 1), sealed=True),
    Mutant("another tool", _contour_field("tool", lambda v: v + 1), sealed=True),
    Mutant("open said closed", _contour_field("closed", lambda v: not v), sealed=True),
    Mutant(
        "may turn, or may not",
        _contour_field("reversible", lambda v: not v),
        harmless="a plan may let fewer contours be reversed than its source; more is a fault",
        sealed=True,
    ),
    Mutant("another source line", _contour_field("line", lambda v: v + 1)),
    Mutant("another epoch", _contour_field("epoch", lambda v: v + 3), sealed=True),
    Mutant("precedence emptied", no_precedence, harmless=SAME_ORDER, sealed=True),
    Mutant("precedence turned", swapped_precedence),
    Mutant("precedence of no contour", foreign_precedence),
    Mutant("a slim head", slim_head, sealed=True),
    Mutant("a clearance below none", _machine_field("clearance_mm", -1.0)),
    Mutant("another clearance", _machine_field("clearance_mm", 0.01), sealed=True),
    Mutant(
        "another bed", _machine_field("bed", {"min": [-500, -500], "max": [500, 500]}), sealed=True
    ),
    Mutant("parks elsewhere", park_elsewhere, sealed=True),
    Mutant("a contour lost everywhere", lost_contour, sealed=True),
    Mutant("a bead a hundred metres away", far_bead),
    Mutant("no number", _number(float("nan"))),
    Mutant("an infinite number", _number(float("inf"))),
    Mutant("a text for a number", _number("10")),
    Mutant("an integer of 5000 digits", huge_integer),
    Mutant("a key nobody knows", unknown_key),
    Mutant("two contours of one number", two_of_one_id),
    Mutant("another digest", another_digest),
    *WAIT_MUTANTS,
    *TIME_MUTANTS,
    *STOP_MUTANTS,
    Mutant("no time to start again", _machine_field("rest_s", 0.0), sealed=True),
    Mutant("signals told apart at once", _machine_field("signal_interval_s", 0.0), sealed=True),
    Mutant("the heads exchanged", heads_exchanged),
    Mutant("travel over outer walls denied", off_the_walls),
    Mutant("other metrics", other_metrics, harmless="nobody can see in a plan how it was found"),
)
