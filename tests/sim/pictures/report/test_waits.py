"""Why a head waits: for whom, for what, and by which rule."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.print.plan import ActionKind
from sim.pictures.report.waits import (
    CAUSES,
    FAR,
    aside_s,
    chain_cause,
    critical_path,
    sums_of,
    waits_of,
)


def graph_of(document, kind):
    pairs = document.precedence
    return DependencyGraph.from_pairs(
        len(document.contours), pairs, np.full(len(pairs), kind, np.uint8)
    )


def with_pairs(document, pairs):
    return replace(document, precedence=np.array(pairs, np.int32))


def of_head(waits, head):
    return [wait for wait in waits if wait.head == head]


def test_every_cause_has_a_name():
    """A new kind of edge must be explained to people too."""
    assert set(CAUSES) == set(EdgeKind)


@pytest.mark.parametrize(
    ("kind", "cause"),
    [(EdgeKind.GEOMETRY, "support"), (EdgeKind.PROCESS, "order"), (EdgeKind.STATE, "tool"),
     (EdgeKind.PRIMING, "priming"), (EdgeKind.LEAD, "layers")],
)  # fmt: skip
def test_a_wait_for_a_contour_is_by_its_rule(make, kind, cause):
    """The right head may print line 1 only after line 0, by a rule of this kind."""
    document = make.timed(with_pairs(make.shared_plan(after=[(0, 1)]), [(0, 1)]))
    (wait,) = of_head(waits_of(document, graph_of(document, kind)), 1)
    left, right = document.plan.heads
    assert (wait.cause, wait.action, wait.other_head, wait.other_action) == (cause, 0, 0, 1)
    assert (wait.begin_s, wait.end_s) == (0.0, pytest.approx(left.end_s[1]))
    assert wait.end_s == pytest.approx(right.begin_s[0])


def test_without_a_rule_the_other_head_is_in_the_way(make):
    """Nothing in the graph orders the two lines."""
    document = make.shared_plan(after=[(0, 1)])
    (wait,) = of_head(waits_of(document, None), 1)
    assert wait.cause == "space" and (wait.other_head, wait.other_action) == (0, 1)


def test_the_last_release_counts(make):
    """Of two things waited for, the one that happens later ends the wait."""
    document = make.shared_plan(after=[(0, 1, 5), (0, 2)])
    (wait,) = of_head(waits_of(document, None), 1)
    assert wait.other_action == 2


def test_time_to_cool_is_called_that(make):
    """An action that ends long before the wait does, and a lag behind it."""
    document = make.stacked_plan((0, 1, -1, 60.0))
    (first, second) = [w for w in of_head(waits_of(document, None), 1) if w.cause != "end"]
    assert (second.cause, second.lag_s, second.other_action) == ("cooling", 60.0, 1)
    assert first.cause == "space"


def stopping(make):
    """The right head stops 0.45 s before its second travel, long after what that waits for."""
    document = make.stacked_plan((0, 0))

    def later(rows):
        return [
            {**row, "begin_s": row["begin_s"] + 0.45, "end_s": row["end_s"] + 0.45}
            if k >= 2
            else row
            for k, row in enumerate(rows)
        ]

    return make.edited(document, 1, later)


def test_a_stop_to_be_heard_is_no_wait_for_a_head(make):
    """Heads signal one another at rest; nobody is in the way meanwhile."""
    document = stopping(make)
    assert document.plan.heads[1].after(2) == [(0, 0)]
    (wait,) = [w for w in of_head(waits_of(document, None), 1) if w.action == 2]
    assert wait.cause == "signal" and wait.other_head is None


def test_the_critical_path_stays_where_a_head_stops_to_be_heard(make):
    """What happened long before shortens nothing, though the action waits for it."""
    document = stopping(make)
    path = critical_path(document)
    assert (1, 1) in path and (1, 2) in path
    assert path.index((1, 2)) == path.index((1, 1)) + 1


def test_waits_fill_what_is_not_done(make):
    """Every second of a head is an action or a wait; those done first wait for the end."""
    document = make.timed(make.two_head_plan())
    waits = waits_of(document, None)
    for head, actions in enumerate(document.plan.heads):
        idle = sum(w.end_s - w.begin_s for w in of_head(waits, head))
        busy = float((actions.end_s - actions.begin_s).sum())
        assert idle + busy == pytest.approx(document.plan.makespan_s, abs=0.5)
    assert [w.begin_s for w in waits] == sorted(w.begin_s for w in waits)
    rows = sums_of(waits)
    assert sum(row["seconds"] for row in rows) == pytest.approx(
        sum(w.end_s - w.begin_s for w in waits), abs=0.01
    )
    assert sum(row["count"] for row in rows) == len(waits)


def test_one_head_waits_for_plastic_to_cool(make):
    """Its waits are actions."""
    document = make.tower_plan()

    def paused(rows):
        pause = {**rows[1], "kind": ActionKind.WAIT, "contour": -1, "path": rows[1]["path"][-1:]}
        pause |= {"begin_s": rows[1]["end_s"], "end_s": rows[1]["end_s"] + 7.0}
        later = [{**r, "begin_s": r["begin_s"] + 7.0, "end_s": r["end_s"] + 7.0} for r in rows[2:]]
        return [*rows[:2], pause, *later]

    document = make.edited(make.timed(document), 0, paused)
    (wait,) = waits_of(document, None)
    assert wait.cause == "cooling" and wait.end_s - wait.begin_s == pytest.approx(7.0)


def test_a_chain_of_rules_is_found_and_named_by_its_last():
    """a before b before c: c waits for a by the rule of (b, c); d is free."""
    kinds = np.array([EdgeKind.GEOMETRY, EdgeKind.PRIMING], np.uint8)
    graph = DependencyGraph.from_pairs(4, np.array([(0, 1), (1, 2)]), kinds)
    assert chain_cause(graph, 0, 2) == "priming"
    assert chain_cause(graph, 0, 1) == "support"
    assert chain_cause(graph, 0, 3) is None and chain_cause(graph, 2, 0) is None


def test_a_long_chain_ends_the_search():
    """A click must not take minutes."""
    n = FAR + 10
    rows = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    assert chain_cause(DependencyGraph.from_pairs(n, rows), 0, n - 1) is None
    assert chain_cause(DependencyGraph.from_pairs(n, rows), 20, n - 1) == "support"


def test_the_critical_path_leads_from_the_begin_to_the_end(make):
    """Shortening anything that is not on it shortens nothing."""
    document = make.timed(make.two_head_plan())
    heads = document.plan.heads
    path = critical_path(document)
    assert path[0][1] == 0 and heads[path[0][0]].begin_s[0] == pytest.approx(0.0)
    last = heads[path[-1][0]]
    assert last.end_s[path[-1][1]] == document.plan.makespan_s
    assert len({head for head, _ in path}) == 2  # the right head waits for the left one to park
    begins = [heads[head].begin_s[action] for head, action in path]
    assert begins == sorted(begins)
    for (head, action), (other, after) in pairwise(path):
        free = heads[head].end_s[action]
        assert heads[other].begin_s[after] <= free + 0.05


def test_travels_that_lead_nowhere_step_aside(make):
    """A travel before a print and the last way to the park are none."""
    document = make.timed(make.two_head_plan())
    assert aside_s(document.plan.heads[0]) == 0.0

    def aside(rows):
        step = {**rows[0], "path": rows[0]["path"][::-1]}
        return [*rows[:2], step, *rows[2:]]

    moved = make.edited(document, 0, aside).plan.heads[0]
    assert aside_s(moved) == pytest.approx(float(moved.end_s[2] - moved.begin_s[2]))
