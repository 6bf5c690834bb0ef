"""Mutants of what the heads of a plan.json wait for (actions, points, lags), and of its times."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tests.mutants.actions import longest_actions, some_print
from tests.mutants.catalogue import Mutant, NotHereError

Plan = dict[str, Any]
Rng = np.random.Generator
OF_THE_WHOLE = ("makespan_s", "print_time_s")  # metrics
HEAD, ACTION, POINT, LAG = range(4)  # what an entry of `after` holds


def _all_actions(plan: Plan) -> dict[str, list[dict[str, Any]]]:
    return {head["name"]: head["actions"] for head in plan["heads"]}


def _some_wait(plan: Plan, rng: Rng, fits: Callable[[list[Any]], bool]) -> list[Any]:
    """Return one of the entries of `after` that fit; raises NotHereError where none does."""
    found = [
        edge for actions in _all_actions(plan).values() for a in actions for edge in a["after"]
    ]
    found = [edge for edge in found if fits(edge)]
    if not found:
        raise NotHereError
    chosen: list[Any] = found[int(rng.integers(len(found)))]
    return chosen


def _points(plan: Plan, edge: list[Any]) -> int:
    """Return how many points the path of a waited action has; 0 where it stands still."""
    action = _all_actions(plan)[edge[HEAD]][edge[ACTION]]
    return 0 if action["kind"] == "wait" else len(action["path"])


def waits_dropped(plan: Plan, rng: Rng) -> None:
    """Let no action wait for another head."""
    _some_wait(plan, rng, lambda edge: True)
    for actions in _all_actions(plan).values():
        for action in actions:
            action["after"] = []


def one_wait_dropped(plan: Plan, rng: Rng) -> None:
    """Let one action not wait for another head."""
    chosen = _some_wait(plan, rng, lambda edge: True)
    for actions in _all_actions(plan).values():
        for action in actions:
            action["after"] = [edge for edge in action["after"] if edge is not chosen]


def waits_for_itself(plan: Plan, rng: Rng) -> None:
    """Let an action wait for a later one of its own head."""
    name, actions = max(_all_actions(plan).items(), key=lambda item: len(item[1]))
    actions[0]["after"] = [[name, 1, None, 0.0]]


def waits_for_a_later_action(plan: Plan, rng: Rng) -> None:
    """Let what is waited for wait for a point of what waits for it, or of a later action."""
    all_actions = _all_actions(plan)
    edge = _some_wait(plan, rng, lambda edge: True)
    for name, actions in all_actions.items():
        for k, action in enumerate(actions):
            if any(one is edge for one in action["after"]):
                later = next(
                    (n for n in range(k, len(actions)) if len(actions[n]["path"]) > 1), None
                )
                if later is None:
                    raise NotHereError
                all_actions[edge[HEAD]][edge[ACTION]]["after"].append([name, later, 1, 0.0])
                return


def one_point_too_early(plan: Plan, rng: Rng) -> None:
    """Let one action wait for the point before the one it waits for."""
    _some_wait(plan, rng, lambda edge: (edge[POINT] or 0) > 1)[POINT] -= 1


def ends_to_points(plan: Plan, rng: Rng) -> None:
    """Let all that wait for the end of a way wait for its first point only."""
    all_actions = _all_actions(plan)
    _some_wait(plan, rng, lambda edge: _points(plan, edge) > 2)
    for action in [action for actions in all_actions.values() for action in actions]:
        for edge in action["after"]:
            if _points(plan, edge) > 2:
                edge[POINT] = 1


def action_before(plan: Plan, rng: Rng) -> None:
    """Let all that wait for an action wait for the one before it, wherever it is."""
    _some_wait(plan, rng, lambda edge: edge[ACTION] > 0)
    for action in [action for actions in _all_actions(plan).values() for action in actions]:
        for edge in action["after"]:
            edge[ACTION], edge[POINT] = max(0, edge[ACTION] - 1), None


def lags_dropped(plan: Plan, rng: Rng) -> None:
    """Keep every order and no lag."""
    _some_wait(plan, rng, lambda edge: edge[LAG] > 0.0)
    for action in [action for actions in _all_actions(plan).values() for action in actions]:
        for edge in action["after"]:
            edge[LAG] = 0.0


def _entry(at: int, value: Any) -> Callable[[Plan, Rng], None]:
    """Return a mutant that puts a value into an entry of `after`."""

    def spoil(plan: Plan, rng: Rng) -> None:
        _some_wait(plan, rng, lambda edge: True)[at] = value

    return spoil


WAIT_MUTANTS: tuple[Mutant[Plan], ...] = (
    Mutant("no head waits for the other", waits_dropped),
    Mutant("one wait dropped", one_wait_dropped),
    Mutant("an action waits for a later one", waits_for_itself),
    Mutant("two heads wait for each other", waits_for_a_later_action),
    Mutant("a wait for the point before", one_point_too_early),
    Mutant("waits for first points, not for ends", ends_to_points),
    Mutant("waits for the actions before", action_before),
    Mutant("lags dropped", lags_dropped),
    Mutant("a wait for point 0", _entry(POINT, 0)),
    Mutant("a wait for a point beyond the path", _entry(POINT, 10**6)),
    Mutant("a wait for no whole point", _entry(POINT, 1.5)),
    Mutant("a lag below none", _entry(LAG, -1.0)),
    Mutant("a lag of a year", _entry(LAG, 3.2e7)),
    Mutant("a lag that is no number", _entry(LAG, float("nan"))),
)


def _every_time(plan: Plan, factor: float) -> None:
    """Multiply all times and lags of a plan, and what it says of the whole."""
    for head in plan["heads"]:
        for action in head["actions"]:
            action["begin_s"] *= factor
            action["end_s"] *= factor
            for edge in action["after"]:
                edge[3] *= factor
    for name in (*OF_THE_WHOLE, "waits_s"):
        plan["metrics"][name] *= factor


def ten_times_as_fast(plan: Plan, rng: Rng) -> None:
    """Divide all times by ten."""
    _every_time(plan, 0.1)


def three_quarters(plan: Plan, rng: Rng) -> None:
    """Let everything take three quarters of its time."""
    _every_time(plan, 0.75)


def print_halved(plan: Plan, rng: Rng) -> None:
    """Let two contours be printed in half their time; the head then waits."""
    actions = longest_actions(plan)
    longest = max(
        (k for k, action in enumerate(actions) if action["kind"] == "print"),
        key=lambda k: actions[k]["end_s"] - actions[k]["begin_s"],
    )
    for k in (longest, some_print(plan, rng)):
        actions[k]["end_s"] = (actions[k]["begin_s"] + actions[k]["end_s"]) / 2.0


def makespan_denied(plan: Plan, rng: Rng) -> None:
    """Say that the whole takes a second less."""
    for name in OF_THE_WHOLE:
        plan["metrics"][name] -= 1.0


def travel_denied(plan: Plan, rng: Rng) -> None:
    """Say that travels are shorter than they are."""
    plan["metrics"]["emitted_travel_mm"] *= 0.9


TIME_MUTANTS: tuple[Mutant[Plan], ...] = (
    Mutant("all times a tenth", ten_times_as_fast),
    Mutant("all times three quarters", three_quarters),
    Mutant("a print in half its time", print_halved),
    Mutant("a makespan that is not", makespan_denied),
    Mutant("travels said shorter", travel_denied),
)


def _ended_s(plan: Plan, actions: list[dict[str, Any]], k: int) -> float:
    """Return when the action before has ended, and all those whose ends an action waits for."""
    named = _all_actions(plan)
    ends = [
        named[edge[HEAD]][edge[ACTION]]["end_s"] + edge[LAG]
        for edge in actions[k]["after"]
        if edge[POINT] is None
    ]
    return max(float(end) for end in (actions[k - 1]["end_s"], *ends))


def started_at_once(plan: Plan, rng: Rng) -> None:
    """Let a head that waits go on as soon as it may, as if nothing had to be started again."""
    rest_s = plan["machine"]["rest_s"]
    found = [
        (actions, k)
        for actions in _all_actions(plan).values()
        for k in range(1, len(actions))
        if actions[k]["after"] and rest_s > 0.0
        and abs(actions[k]["begin_s"] - _ended_s(plan, actions, k) - rest_s) < 1e-6
    ]  # fmt: skip
    if not found:
        raise NotHereError
    actions, k = found[int(rng.integers(len(found)))]
    actions[k]["begin_s"] -= rest_s
    actions[k]["end_s"] -= rest_s


def _first_point_s(actions: list[dict[str, Any]], k: int) -> float:
    """Return the seconds from the end of an action to point 1 of the next, at even speed."""
    later = actions[k + 1]
    steps = np.linalg.norm(np.diff(np.array(later["path"]), axis=0), axis=1)
    takes = later["end_s"] - later["begin_s"]
    return float(later["begin_s"] - actions[k]["end_s"] + takes * steps[0] / steps.sum())


def signals_too_near(plan: Plan, rng: Rng) -> None:
    """Let the last action of a head wait for the first point behind an end that is waited for."""
    machine, named = plan["machine"], _all_actions(plan)
    found = [
        (name, edge)
        for name, actions in named.items()
        for action in actions
        for edge in action["after"]
        if edge[POINT] is None and len(named[edge[HEAD]]) > edge[ACTION] + 1
        and not named[edge[HEAD]][edge[ACTION] + 1]["after"]
        and named[edge[HEAD]][edge[ACTION] + 1]["kind"] == "travel"
        and _points(plan, [edge[HEAD], edge[ACTION] + 1]) > 2
        and _first_point_s(named[edge[HEAD]], edge[ACTION]) < machine["signal_interval_s"] / 2
    ]  # fmt: skip
    if not found or machine["release"] != "point" or not machine["signal_interval_s"]:
        raise NotHereError
    name, edge = found[int(rng.integers(len(found)))]
    last, rest_s = named[name][-1], machine["rest_s"]
    last["after"].append([edge[HEAD], edge[ACTION] + 1, 1, 0.0])
    last["begin_s"] += rest_s  # so that the head can start again
    last["end_s"] += rest_s
    done = max(actions[-1]["end_s"] for actions in named.values() if actions)
    due = {"cross_head_waits": sum(len(a["after"]) for h in named.values() for a in h)}
    due |= dict.fromkeys(OF_THE_WHOLE, done)
    plan["metrics"].update((key, due[key]) for key in due if key in plan["metrics"])


STOP_MUTANTS: tuple[Mutant[Plan], ...] = (
    Mutant("a head starts again at once", started_at_once),
    Mutant("signals too near", signals_too_near),
)
