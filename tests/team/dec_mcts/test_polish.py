"""Local search on a joint order: true to the engine, never worse, and joined with others'."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decmcts.feasibility.build import build_graph
from decmcts.formats.machines.machine_file import load_machine
from decmcts.random_kernels import seeded
from decmcts.team.dec_mcts.polish import Polish
from decmcts.team.dec_mcts.warm_up import smallest_job, smallest_problem
from decmcts.team.dec_mcts.windows_kernels import batch_of, draw_windows
from decmcts.team.engine.plans import StatedOrder, encode, encode_stated
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import Resolved, resolve


def _problem(case: Callable[..., Any], seed: int, heads: int = 2) -> TeamProblem:
    chosen = case(seed, towers=8, reach=5.0)
    assert len(chosen.machine.heads) == heads
    return build_team_problem(chosen.job, chosen.machine, chosen.graph)


def _start(problem: TeamProblem) -> Resolved:
    plans = {r: encode(0, problem.n_macros) for r in range(2)}
    return resolve(problem, plans, [0, 1])


def _stated(problem: TeamProblem, stated: StatedOrder, by: int = 0) -> Resolved:
    heads = max(2, int(stated.head.max()) + 1)
    return resolve(problem, {by: encode_stated(stated, heads, problem.n_macros)}, [0, 1])


@pytest.mark.slow
@pytest.mark.parametrize("improve", [Polish.improve, Polish.recreate])
@pytest.mark.parametrize("seed", range(4))
def test_improved_orders_are_valid_and_no_worse(
    case: Callable[..., Any], seed: int, improve: Callable[[Polish, int], None]
) -> None:
    """What it says of its best order is what the engine makes of it."""
    problem = _problem(case, seed)
    start = _start(problem)
    polish = Polish(problem, StatedOrder.of(start.toolpaths), seed=seed)
    improve(polish, 20)
    assert polish.best_s < polish.began_s
    found = _stated(problem, polish.best)
    assert found.makespan_s == polish.best_s
    assert found.makespan_s <= start.makespan_s + 1e-9
    assert np.array_equal(np.sort(polish.best.order), np.arange(len(problem.macro)))
    turn = np.empty(len(problem.macro), np.int64)
    turn[polish.best.order] = np.arange(len(turn))
    before, after = problem.graph.pairs().T
    assert (turn[before] < turn[after]).all()
    assert problem.space.eligible[polish.best.order, polish.best.head].all()
    printed = np.concatenate([path.order[np.argsort(path.turn)] for path in found.toolpaths])
    expected = np.concatenate([polish.best.order[polish.best.head == r] for r in range(2)])
    assert np.array_equal(printed, expected)


@pytest.mark.slow
@pytest.mark.parametrize("improve", [Polish.improve, Polish.recreate])
def test_equal_seeds_give_equal_orders(
    case: Callable[..., Any], improve: Callable[[Polish, int], None]
) -> None:
    """Without this no run could ever be replayed."""
    problem = _problem(case, 1)
    stated = StatedOrder.of(_start(problem).toolpaths)
    ends = []
    for seed in (3, 3, 4):
        polish = Polish(problem, stated, seed=seed)
        improve(polish, 10)
        ends.append(polish.best.order.tolist() + polish.best.head.tolist())
    assert ends[0] == ends[1] != ends[2]


@pytest.mark.slow
def test_takes_what_is_better_of_anothers_order(case: Callable[..., Any]) -> None:
    """Two heads that polish the same order end with the best of both."""
    problem = _problem(case, 2)
    stated = StatedOrder.of(_start(problem).toolpaths)
    one, two = (Polish(problem, stated, seed=seed) for seed in (5, 6))
    one.improve(8)
    two.improve(8)
    alone = one.best_s
    one.take(two.best)
    assert one.best_s <= alone
    fresh = Polish(problem, stated, seed=7)
    fresh.take(two.best)
    assert fresh.best_s == pytest.approx(min(two.best_s, fresh.began_s))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["precedence", "head", "direction"])
def test_a_stated_order_that_cannot_be_is_ignored(case: Callable[..., Any], kind: str) -> None:
    """A peer's broken plan must neither crash nor bind anyone."""
    problem = _problem(case, 2)
    stated = StatedOrder.of(_start(problem).toolpaths)
    order, is_reversed, head = stated.order.copy(), stated.reversed.copy(), stated.head.copy()
    if kind == "precedence":
        order, is_reversed, head = order[::-1], is_reversed[::-1], head[::-1]
    elif kind == "head":
        head += 2
    else:
        fixed = ~problem.visits.reversible[order]
        if not fixed.any():
            pytest.skip("every contour of this print may be reversed")
        is_reversed[fixed] = True
    nothing = resolve(problem, {}, [0, 1])
    assert _stated(problem, StatedOrder(order, is_reversed, head)).digest == nothing.digest


@pytest.mark.slow
def test_heads_that_are_lost_are_given_nothing() -> None:
    """What is polished is carried out by the heads that live."""
    job, machine = smallest_job(), load_machine("rail-3")
    graph = build_graph(job.contours, machine.heads, clearance_mm=machine.clearance_mm)
    problem = build_team_problem(job, machine, graph)
    for live in ((0, 1), (1, 2), (0, 2)):
        start = resolve(problem, {}, live)
        polish = Polish(problem, StatedOrder.of(start.toolpaths), seed=1, live=live)
        assert polish.began_s == pytest.approx(start.makespan_s)
        polish.recreate(20)
        polish.improve(20)
        assert set(polish.best.head.tolist()) <= set(live)
        plan = encode_stated(polish.best, 3, problem.n_macros)
        assert resolve(problem, {live[0]: plan}, live).makespan_s == polish.best_s


@pytest.mark.slow
def test_printing_that_takes_no_time_is_polished() -> None:
    """Segments without a feed take none; the temperature must not divide by it."""
    problem = smallest_problem()
    problem.visits.seconds[:] = 0.0
    stated = StatedOrder.of(resolve(problem, {}, [0, 1]).toolpaths)
    polish = Polish(problem, stated, seed=1)
    polish.improve(5)
    assert polish.best_s <= polish.began_s


@pytest.mark.parametrize("n", [3, 150, 5000])
def test_windows_of_a_batch_come_in_order_and_all_over_the_print(n: int) -> None:
    """No window may change what the tails behind a later one are made of."""
    state, seen = seeded(1), np.zeros(n)
    for _ in range(200):
        drawn = draw_windows(8, n, 20, 400, 20, state)
        first, end = drawn.T
        assert (np.diff(end) >= 0).all() and first.min() >= 0 and end.max() <= n
        assert (end - first >= min(n, 20)).all() and (end - first <= min(n, 400)).all()
        for begin, stop in drawn:
            seen[begin:stop] += 1
    assert seen.min() > 0.4 * seen.mean()


def test_batches_grow_with_the_print_but_not_beyond_what_is_asked_for() -> None:
    assert [batch_of(n, 60) for n in (50, 6_000, 40_000)] == [4, 6, 32]
    assert batch_of(40_000, 3) == 3
