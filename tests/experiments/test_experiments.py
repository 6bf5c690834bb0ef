"""Each experiment's runs, at the least there is to search: what they must show whatever it is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from decmcts.experiments.kinds import Asked, Key, Line, Row
from decmcts.experiments.run import EXPERIMENTS
from decmcts.version import __version__

LEAST = {"seconds": 0.0, "iterations": 1, "seed": 0, "version": __version__}


def some_of(name: str, **wanted: Any) -> Iterator[Key]:
    """Yield the keys of the small version that have these values."""
    for key in EXPERIMENTS[name].keys(Asked()):
        if all(key[field] == value for field, value in wanted.items()):
            yield key


def rows_of(name: str, *keys: Key) -> list[Row]:
    """Return the rows of some runs, and see that tables and figure can be made of them."""
    chosen = EXPERIMENTS[name]
    rows = [{**key, **LEAST, **chosen.run({**key, **LEAST}), "error": ""} for key in keys]
    names = {field for row in rows for field in row}
    lines: list[Line] = [{n: str(row.get(n, "")) for n in names} for row in rows]
    assert "|" in chosen.tables(lines)
    chosen.draw(lines).draw_without_rendering()
    return rows


@pytest.mark.slow
def test_two_heads_are_faster_where_parts_are_far_apart() -> None:
    """And never faster than the bound."""
    near, far = rows_of(
        "two-heads",
        *some_of("two-heads", print="row-2-15-5", cut="none"),
        *some_of("two-heads", print="row-2-15-100", cut="none"),
    )
    assert far["speedup"] > 1.3 > near["speedup"]
    assert near["speedup"] <= near["most"] and far["speedup"] <= far["most"]
    assert 0.0 <= far["waits"] < near["waits"] + near["idle"]


@pytest.mark.long
def test_more_heads_along_a_rail_are_faster() -> None:
    """The machine is made by code, of any number of heads."""
    keys = list(some_of("team-size", cut="none"))
    one, two, _, four = rows_of("team-size", *keys[:4])
    assert one["speedup"] == 1.0
    assert 1.5 < two["speedup"] < four["speedup"] <= four["most"]


@pytest.mark.slow
def test_a_plan_that_trusts_its_clock_collides_and_ours_does_not() -> None:
    """Both do the same at planned times."""
    calm, late = rows_of(
        "timing",
        *some_of("timing", print="row-4-20-5", timing="drift", error_share=0.0),
        *some_of("timing", print="row-4-20-5", timing="drift", error_share=0.2),
    )
    assert calm["waits_contacts"] == calm["clock_contacts"] == late["waits_contacts"] == 0
    assert calm["clock_longer"] == pytest.approx(1.0, abs=1e-6)
    assert late["clock_collided"] > 0 >= late["clock_least_mm"]
    assert late["waits_least_mm"] > 0.0


@pytest.mark.slow
def test_agents_agree_though_messages_are_lost_and_one_is_killed() -> None:
    """Whoever is fenced prints nothing; who is started again does."""
    calm, fenced, restarted = rows_of(
        "loss-and-failure",
        *some_of("loss-and-failure", print="row-4-20-20", loss=0.0, fails=""),
        *some_of("loss-and-failure", print="row-4-20-20", loss=0.5, fails="fenced"),
        *some_of("loss-and-failure", print="row-4-20-20", loss=0.5, fails="restarted"),
    )
    assert (calm["live"], fenced["live"], restarted["live"]) == (2, 1, 2)
    assert fenced["makespan_s"] > 1.3 * calm["makespan_s"]
    assert restarted["agreeing_s"] > calm["agreeing_s"]


@pytest.mark.slow
def test_what_a_head_leaves_is_printed_by_the_others() -> None:
    """Sooner than a person comes, and no sooner than anybody could."""
    keys = some_of("loss-and-failure", print="row-4-20-20", phase="printing")
    for row in rows_of("loss-and-failure", *keys):
        assert row["left_out"] == 0
        assert 0 < row["printed"] < row["contours"]
        assert max(row["clairvoyant_s"], row["planned_s"]) < row["makespan_s"] < row["wait_5"]
        assert row["wait_5"] < row["wait_30"]


@pytest.mark.long
def test_central_and_decentral_plans_come_over_the_same_network() -> None:
    """And both beat nobody's bound."""
    keys = some_of("decentral-or-central", print="row-6-20-20", setting="network", loss=0.2)
    equal = some_of("decentral-or-central", print="row-6-20-20", planner="one tree")
    for row in rows_of("decentral-or-central", *keys, *equal):
        assert row["over_bound"] >= 1.0
        assert row.get("agreeing_s", 1.0) > 0.0


@pytest.mark.slow
def test_greedy_rollouts_beat_random_ones() -> None:
    """At Γ 1 random rollouts are worse than the source; and equal seeds give equal curves."""
    keys = [
        next(iter(some_of("paper", print="strewn-9-10-1", method=method)))
        for method in ("slicer", "local", "mcts", "mcts, Γ 1", "mcts, Γ 1, nearest",
                       "rollouts, Γ 1, nearest")
    ]  # fmt: skip
    _, local, mcts, random, nearest, rollouts = rows_of("paper", *keys)
    assert random["travel_mm"] > mcts["travel_mm"] > nearest["travel_mm"] > local["travel_mm"]
    assert rollouts["travel_mm"] < mcts["travel_mm"]
    assert rows_of("paper", keys[0], keys[4])[1] | {"improved_s": 0} == nearest | {"improved_s": 0}
