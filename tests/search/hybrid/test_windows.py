"""Windows of a sequence in their best order: as recursion finds it, and nothing else moves."""

from __future__ import annotations

import time
from functools import cache

import numpy as np
import pytest

from decmcts.random_kernels import seeded
from decmcts.search.bounds.exact import Capacity, slack_of
from decmcts.search.decomposition.blocks import Sequence, cut
from decmcts.search.decomposition.threads import open_threads
from decmcts.search.hybrid.phases import WindowSolver, improve_windows
from decmcts.search.hybrid.windows_kernels import solve_window
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.metric_kernels import respects
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from tests.search.bounds.test_exact import kinds
from tests.search.problems import choices, found, price, random_problem, varied


def solved(
    sequence: Sequence,
    first: int,
    last: int,
    *,
    widest: int = 10_000,
    room: int = 10_000,
    limit: int = 200_000,
) -> bool:
    """Mutate the sequence: positions [first, last) in their best order, if that is not too much."""
    block = cut(sequence, 0, len(sequence.order))
    ideals = Capacity(room, 4 * room, 20 * room, 20_011).allocate()
    slack = slack_of(sequence.problem)
    done, _ = solve_window(block.tour, ideals, first, last, slack, widest, limit)
    block.put_back(sequence)
    return bool(done)


def choice_in_use(sequence: Sequence, c: int) -> int:
    """The number of the choice, as `choices` lists them, in which a contour is printed now."""
    seams, entry_id = sequence.problem.seams, int(sequence.entry_id[c])
    if seams is not None and entry_id >= 0:
        return entry_id - int(seams.offsets[c])
    return int(sequence.reversed[c])


def least(sequence: Sequence, first: int, last: int) -> float:
    """The least cost of positions [first, last) by recursion; their ends stay as they are."""
    problem: OrderProblem = sequence.problem
    ids, n = sequence.order[first:last].tolist(), len(sequence.order)
    inside, needed = set(ids), {c: set[int]() for c in ids}
    for a, b in problem.graph.pairs().tolist():
        if a in inside and b in inside:
            needed[b].add(a)
    ends = {c: list(enumerate(choices(problem, c))) for c in ids}
    for at, guards in ((0, first > 0), (-1, last < n)):
        if guards:
            ends[ids[at]] = [ends[ids[at]][choice_in_use(sequence, ids[at])]]
    if first > 0:
        for c in ids[1:]:
            needed[c].add(ids[0])
    if last < n:
        needed[ids[-1]] |= set(ids[:-1])

    @cache
    def rest(done: frozenset[int], left: tuple[int, int] | None) -> float:
        costs = []
        for c in ids:
            if c in done or not needed[c] <= done:
                continue
            for k, (into, _) in ends[c]:
                cost = 0.0
                if left is not None:
                    out = choices(problem, left[0])[left[1]][1]
                    cost = price(problem, out, into)
                costs.append(cost + rest(done | {c}, (c, k)))
        return min(costs, default=0.0)

    return rest(frozenset(), None)


def window_cost(sequence: Sequence, first: int, last: int) -> float:
    """What the travels between these positions cost."""
    problem, total = sequence.problem, 0.0
    for a, b in zip(
        sequence.order[first : last - 1], sequence.order[first + 1 : last], strict=True
    ):
        out = choices(problem, int(a))[choice_in_use(sequence, int(a))][1]
        total += price(problem, out, choices(problem, int(b))[choice_in_use(sequence, int(b))][0])
    return total


def check(sequence: Sequence) -> None:
    """Refuse a sequence that is not allowed."""
    problem = sequence.problem
    assert sorted(sequence.order.tolist()) == list(range(len(problem)))
    assert respects(sequence.order, problem.graph.succ_offsets, problem.graph.succs)
    assert not (sequence.reversed.astype(bool) & ~problem.reversible).any()


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed",
    [pytest.param(s, marks=[pytest.mark.long] * (s > 3)) for s in range(24) if s % 5 != 4],
)
def test_a_window_ends_in_the_best_order_there_is(seed: int) -> None:
    """At the beginning, the end and between, of every kind of print; the rest stays."""
    problem = kinds(random_problem(seed, 20, density=(0.0, 0.1, 0.4)[seed % 3]), seed)
    sequence = found(problem, seed, iterations=1)
    sequence.choose_entries()
    for first, last in ((0, 6), (14, 20), (6, 13), (3, 10)):
        before, best = sequence.copy(), least(sequence, first, last)
        assert solved(sequence, first, last)
        check(sequence)
        assert window_cost(sequence, first, last) == pytest.approx(best)
        outside = [p for p in range(20) if not first <= p < last]
        kept = before.order[outside]
        assert (kept == sequence.order[outside]).all()
        assert (before.reversed[kept] == sequence.reversed[kept]).all()
        assert (before.entry_id[kept] == sequence.entry_id[kept]).all()


@pytest.mark.slow
def test_what_takes_too_much_stays_as_it_was() -> None:
    """Too many steps from a level, or no room: the sequence is the one from before."""
    sequence = found(random_problem(2, 40, density=0.0), 2, iterations=1)
    before = sequence.copy()
    assert not solved(sequence, 5, 25, widest=100)
    assert not solved(sequence, 5, 25, room=50)
    assert not solved(sequence, 5, 25, limit=100)
    assert (sequence.order == before.order).all()
    assert (sequence.reversed == before.reversed).all()


@pytest.mark.slow
def test_windows_grow_while_they_are_solved() -> None:
    """A print whose layers have one contour each is solved however long they are."""
    problem = random_problem(4, 200, density=0.0)
    chain = np.stack([np.arange(199), np.arange(1, 200)], axis=1).astype(np.int32)
    sequence = found(OrderProblem(
        problem.start, problem.end, problem.reversible, np.arange(200, dtype=np.int32),
        type(problem.graph).from_pairs(200, chain),
    ), 0, iterations=1)  # fmt: skip
    before, solver = sequence.cost, WindowSolver()
    incumbent = of_iterations(sequence.problem, 1_000_000)
    made = solver.improve(incumbent, sequence, seeded(1), 1.0)
    assert solver.length == 62
    assert 1_000_000 <= made <= 1_100_000
    check(sequence)
    assert sequence.cost <= before


def of_iterations(problem: OrderProblem, limit: int) -> Incumbent:
    """An incumbent of a search limited by iterations."""
    return Incumbent(
        problem,
        clock=time.monotonic,
        stopping=Stopping(iterations=limit),
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_all_threads_improve_one_sequence_and_repeat(seed: int) -> None:
    """Better than before, allowed, the same for equal seeds, and not much over the budget."""
    results = []
    for _ in range(2):
        problem = varied(seed)
        sequence, incumbent = found(problem, seed, iterations=10), of_iterations(problem, 50_000)
        before = sequence.cost
        with open_threads(2, seed) as threads:
            for _ in improve_windows(incumbent, sequence, threads, 1.0):
                if incumbent.over:
                    break
        assert incumbent.over
        check(sequence)
        assert incumbent.cost == pytest.approx(sequence.cost)
        assert sequence.cost < before
        results.append(sequence.order.tolist())
        assert 50_000 <= incumbent.iterations <= 60_000
    assert results[0] == results[1]
