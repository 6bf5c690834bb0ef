"""Mutants of what the heads of a plan.json do: order, paths, times and waits."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.mutants.catalogue import NotHereError, pick

Plan = dict[str, Any]
Rng = np.random.Generator


def longest_actions(plan: Plan) -> list[dict[str, Any]]:
    """Return the actions of the head that has most."""
    actions: list[dict[str, Any]] = max((h["actions"] for h in plan["heads"]), key=len)
    return actions


def of_kind(plan: Plan, kind: str, *, inner: bool = True) -> list[int]:
    """Return where actions of a kind stand on the busiest head, not at its ends if `inner`."""
    actions = longest_actions(plan)
    found = [k for k, action in enumerate(actions) if action["kind"] == kind]
    return [k for k in found if 2 <= k < len(actions) - 3] if inner else found


def some_print(plan: Plan, rng: Rng) -> int:
    """Return where one of the prints of the busiest head stands, away from its ends."""
    return pick(of_kind(plan, "print"), rng)


def bridge(actions: list[dict[str, Any]], k: int) -> None:
    """Let the travel at k lead from where the action before it ends to where the next begins."""
    start, goal = actions[k - 1]["path"][-1], actions[k + 1]["path"][0]
    top = max(point[2] for action in actions for point in action["path"])
    actions[k]["path"] = [start, [*start[:2], top], [*goal[:2], top], goal]


def exchange(plan: Plan, i: int, j: int) -> None:
    """Exchange what is printed at i and j, with travels that fit."""
    actions = longest_actions(plan)
    for name in ("contour", "path", "reversed", "entry"):
        actions[i][name], actions[j][name] = actions[j][name], actions[i][name]
    for k in {i - 1, i + 1, j - 1, j + 1}:
        if not 0 < k < len(actions) - 1 or actions[k]["kind"] != "travel":
            raise NotHereError
        bridge(actions, k)


def tied_pair(plan: Plan, rng: Rng, *, same_layer: bool) -> tuple[int, int]:
    """Return places of two prints of one head that the plan's precedence ties together."""
    place = {
        action["contour"]: k
        for k, action in enumerate(longest_actions(plan))
        if action["kind"] == "print"
    }
    contours = plan["contours"]
    inner = set(of_kind(plan, "print"))
    tied = [
        pair
        for pair in plan["precedence"]
        if all(place.get(c) in inner for c in pair)
        and (contours[pair[0]]["layer"] == contours[pair[1]]["layer"]) is same_layer
    ]
    a, b = tied[pick(list(range(len(tied))), rng)]
    return place[a], place[b]


def drop_a_print(plan: Plan, rng: Rng) -> None:
    """Leave a contour out."""
    actions, k = longest_actions(plan), some_print(plan, rng)
    del actions[k : k + 2]
    bridge(actions, k - 1)


def print_twice(plan: Plan, rng: Rng) -> None:
    """Print a contour a second time."""
    actions, k = longest_actions(plan), some_print(plan, rng)
    actions[k + 1 : k + 1] = [{**actions[k - 1]}, {**actions[k]}]
    bridge(actions, k + 1)
    bridge(actions, k + 3)


def upper_layer_first(plan: Plan, rng: Rng) -> None:
    """Exchange two contours on top of each other."""
    exchange(plan, *tied_pair(plan, rng, same_layer=False))


def process_order_swapped(plan: Plan, rng: Rng) -> None:
    """Print infill before the perimeter that anchors it, and say nothing against it."""
    exchange(plan, *tied_pair(plan, rng, same_layer=True))
    plan["precedence"] = []


def across_a_barrier(plan: Plan, rng: Rng) -> None:
    """Move a contour across a change of temperature."""
    actions = longest_actions(plan)
    at = of_kind(plan, "print")
    epoch = [plan["contours"][actions[k]["contour"]]["epoch"] for k in at]
    steps = [i for i in range(len(at) - 1) if epoch[i] != epoch[i + 1]]
    i = pick(steps, rng)
    exchange(plan, at[i], at[i + 1])


def barrier_denied(plan: Plan, rng: Rng) -> None:
    """Move a contour across a change of temperature and deny that there is one."""
    across_a_barrier(plan, rng)
    plan["precedence"] = []
    for contour in plan["contours"]:
        contour["epoch"] = 0


def skirt_last(plan: Plan, rng: Rng) -> None:
    """Print the skirt that primes the nozzle at the end."""
    actions, contours = longest_actions(plan), plan["contours"]
    skirts = [
        k for k, a in enumerate(actions)
        if a["kind"] == "print" and contours[a["contour"]]["role"] == "skirt_brim"
    ]  # fmt: skip
    first, last = pick(skirts[:1], rng), of_kind(plan, "print", inner=False)[-1]
    for name in ("contour", "path", "reversed", "entry"):
        actions[first][name], actions[last][name] = actions[last][name], actions[first][name]
    for k in (first - 1, first + 1, last - 1, last + 1):
        if 0 < k < len(actions) - 1:
            bridge(actions, k)
    actions[0]["path"][-1] = actions[first]["path"][0]
    actions[0]["path"][-2][:2] = actions[first]["path"][0][:2]
    actions[-1]["path"][0] = actions[last]["path"][-1]
    plan["precedence"] = []


def shift_contour(plan: Plan, rng: Rng) -> None:
    """Move a contour, in the list and in the action alike."""
    actions, k = longest_actions(plan), some_print(plan, rng)
    for point in plan["contours"][actions[k]["contour"]]["points"]:
        point[0] += 0.3
    for point in actions[k]["path"]:
        point[0] += 0.3
    actions[k - 1]["path"][-1] = actions[k]["path"][0]
    actions[k + 1]["path"][0] = actions[k]["path"][-1]


def shift_path(plan: Plan, rng: Rng) -> None:
    """Print beside the contour the action names."""
    longest_actions(plan)[some_print(plan, rng)]["path"][1][0] += 0.05


def reversed_unsaid(plan: Plan, rng: Rng) -> None:
    """Reverse an open contour without saying so."""
    actions = longest_actions(plan)
    opened = [
        k for k in of_kind(plan, "print") if not plan["contours"][actions[k]["contour"]]["closed"]
    ]
    k = pick(opened, rng)
    actions[k]["path"] = actions[k]["path"][::-1]
    bridge(actions, k - 1)
    bridge(actions, k + 1)


def entry_elsewhere(plan: Plan, rng: Rng) -> None:
    """Say that a loop begins at another vertex than its path does."""
    actions = longest_actions(plan)
    loops = [k for k in of_kind(plan, "print") if plan["contours"][actions[k]["contour"]]["closed"]]
    actions[pick(loops, rng)]["entry"] = 2


def jump(plan: Plan, rng: Rng) -> None:
    """Begin an action where the one before did not end."""
    longest_actions(plan)[pick(of_kind(plan, "travel"), rng)]["path"][0][0] += 0.5


def travel_at(height_mm: float) -> Any:
    """Return a mutant whose travel goes straight at one height."""

    def spoil(plan: Plan, rng: Rng) -> None:
        actions = longest_actions(plan)
        far = [
            k for k in of_kind(plan, "travel")
            if abs(actions[k]["path"][0][0] - actions[k]["path"][-1][0]) > 50.0
            and actions[k]["path"][0][2] > 0.5
        ]  # fmt: skip
        path = actions[pick(far[-1:], rng)]["path"]
        start, goal = path[0], path[-1]
        path[1:-1] = [[*start[:2], height_mm], [*goal[:2], height_mm]]

    return spoil


def below_the_bed(plan: Plan, rng: Rng) -> None:
    """Travel through the bed where it is bare."""
    actions = longest_actions(plan)
    x, y = actions[0]["path"][0][:2]
    actions[0]["path"][1:1] = [[x, y, -5.0], [x + 1.0, y, -5.0]]


def off_the_bed(plan: Plan, rng: Rng) -> None:
    """Travel a metre off the machine."""
    actions = longest_actions(plan)
    path = actions[pick(of_kind(plan, "travel"), rng)]["path"]
    path[1:1] = [[path[0][0], path[0][1], 30.0], [path[0][0] + 1000.0, path[0][1], 30.0]]


def wait_that_moves(plan: Plan, rng: Rng) -> None:
    """Call a travel a wait."""
    longest_actions(plan)[pick(of_kind(plan, "travel"), rng)]["kind"] = "wait"


def park_away(plan: Plan, rng: Rng) -> None:
    """End beside the park."""
    longest_actions(plan)[-1]["path"][-1][0] += 5.0


def start_away(plan: Plan, rng: Rng) -> None:
    """Begin beside the park."""
    longest_actions(plan)[0]["path"][0][0] += 5.0


def no_time(plan: Plan, rng: Rng) -> None:
    """Let a travel take no time."""
    action = longest_actions(plan)[pick(of_kind(plan, "travel"), rng)]
    action["end_s"] = action["begin_s"]


def time_backwards(plan: Plan, rng: Rng) -> None:
    """Let an action end before it begins."""
    action = longest_actions(plan)[some_print(plan, rng)]
    action["begin_s"], action["end_s"] = action["end_s"] + 1.0, action["begin_s"]


def heads_exchanged(plan: Plan, rng: Rng) -> None:
    """Give each head the other one's actions."""
    if len(plan["heads"]) < 2:
        raise NotHereError
    plan["heads"][0]["name"], plan["heads"][1]["name"] = (
        plan["heads"][1]["name"],
        plan["heads"][0]["name"],
    )


def sooner(plan: Plan, rng: Rng) -> None:
    """Move all times to before the print begins."""
    for head in plan["heads"]:
        for action in head["actions"]:
            action["begin_s"] -= 1000.0
            action["end_s"] -= 1000.0


def acceleration_raised(plan: Plan, rng: Rng) -> None:
    """State another acceleration for a contour than the source sets."""
    contour = plan["contours"][int(rng.integers(len(plan["contours"])))]
    contour["acceleration"] = 20_000.0
