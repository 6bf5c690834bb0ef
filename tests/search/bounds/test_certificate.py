"""The certificate must never exceed the least travel, whatever the problem."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.search.bounds import certificate
from decmcts.search.bounds.certificate import Ascent, lower_bound
from decmcts.search.bounds.pricing_kernels import price_travels
from decmcts.search.bounds.relaxation import WIDTH, Relaxation
from decmcts.search.planners import plan_order
from decmcts.search.sequence.problem import FreedomWord, OrderProblem
from decmcts.search.sequence.stopping import Stopping
from tests.makers.corpus import CORPUS
from tests.search.problems import choices, price, random_problem, with_bare, with_loops, with_pace


def optimum(problem: OrderProblem) -> float:
    """Least travel by depth-first search over all linear extensions and choices for each."""
    n = len(problem)
    needed = [0] * n  # contours before each, as bits
    for a, b in problem.graph.pairs().tolist():
        needed[b] |= 1 << a
    visits = [(c, into, out) for c in range(n) for into, out in choices(problem, c)]
    steps = [
        [price(problem, out, into) if a != b else 0.0 for b, into, _ in visits]
        for a, _, out in visits
    ]
    best, least = np.inf, dict[tuple[int, int], float]()  # least travel to each state

    def visit(done: int, last: int, travel: float) -> None:
        nonlocal best
        if travel >= min(best, least.get((done, last), np.inf)):
            return
        least[done, last] = travel
        if done == (1 << n) - 1:
            best = travel
            return
        for k, (c, _, _) in enumerate(visits):
            if not done >> c & 1 and needed[c] & done == needed[c]:
                visit(done | 1 << c, k, travel if last < 0 else travel + steps[last][k])

    visit(0, -1, 0.0)
    return best


def relaxed_bound(problem: OrderProblem, rounds: int, width: int = WIDTH) -> float:
    """Bound by the relaxation alone, also where the exact path would be taken."""
    return relaxed_bound_of(problem, rounds, 1.05 * optimum(problem) + 0.1, width)


def relaxed_bound_of(
    problem: OrderProblem, rounds: int, target: float = 200.0, width: int = WIDTH
) -> float:
    """Bound by the relaxation, steps set by a target."""
    ascent = Ascent(Relaxation(problem, width=width), target)
    for _ in range(rounds):
        if ascent.may_go_on(None):
            ascent.round(lambda: False)
    return ascent.bound


def varied(problem: OrderProblem, seed: int) -> OrderProblem:
    """The problem as it is, with loops, in seconds, or both, in turn; some with bare travels."""
    problem = with_loops(problem, seed) if seed // 2 % 2 else problem
    paced = with_bare if seed // 8 % 2 else with_pace
    return paced(problem) if seed // 4 % 2 else problem


def layered_problem(seed: int) -> OrderProblem:
    """Up to eight contours in layers that nearly follow each other as wholes."""
    n = 5 + seed % 4
    problem = random_problem(seed, n, density=0.0, reversible=(0.0, 0.5, 1.0)[seed % 3])
    rng = np.random.default_rng(seed)
    layer = np.sort(rng.integers(0, 3, n))
    wanted = (layer[:, None] < layer[None, :]) & (rng.random((n, n)) < 0.9)
    graph = DependencyGraph.from_pairs(n, np.argwhere(wanted).astype(np.int32))
    return replace(problem, graph=graph)


def small_problem(seed: int) -> OrderProblem:
    """Up to seven contours: sparse to dense graphs, none to all of them reversible."""
    return random_problem(
        seed,
        2 + seed % 6,
        density=(0.0, 0.15, 0.3, 0.6)[seed % 4],
        reversible=(0.0, 0.5, 1.0)[seed % 3],
    )


def towers(seed: int, n: int) -> OrderProblem:
    """Contours of two towers 20 mm apart that must be served in turns."""
    rng = np.random.default_rng(seed)
    start = rng.random((n, 3)) + np.outer(np.arange(n) // 2 % 2, [20.0, 0.0, 0.0])
    pairs = np.array([(a, b) for b in range(n) for a in range(b) if a // 2 < b // 2], np.int32)
    graph = DependencyGraph.from_pairs(n, pairs)
    layer = (np.arange(n) // 2).astype(np.int32)
    return OrderProblem(start, start.copy(), np.zeros(n, np.bool_), layer, graph)


@pytest.mark.slow
def test_relaxation_never_exceeds_the_optimum() -> None:
    """The certificate's promise, on many problems solved by brute force."""
    close = 0
    for seed in range(144):  # nine of each kind
        problem = varied(small_problem(seed) if seed % 2 else layered_problem(seed // 2), seed)
        least, bound = optimum(problem), relaxed_bound(problem, 8)
        assert bound <= least + 1e-12, seed
        close += bound >= 0.9 * least - 1e-6
    assert close > 72  # a bound of zero would be valid too


@pytest.mark.slow
@pytest.mark.parametrize("width", [1, 2])
def test_travels_that_are_not_listed_are_bounded_too(width: int) -> None:
    """With so few travels listed most of them count by what the rest costs at least."""
    rng = np.random.default_rng(width)
    for seed in range(80):
        problem = varied(small_problem(seed) if seed % 2 else layered_problem(seed // 2), seed)
        least = optimum(problem)
        assert relaxed_bound(problem, 6, width) <= least + 1e-12, seed
        relaxed = Relaxation(problem, width=width)
        at = relaxed.allowed(rng.normal(0.0, 2.0, relaxed.size))
        relaxed.take_up(at)
        found = relaxed.evaluate(at)
        assert found.value - found.rounding <= least, seed


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_the_cheapest_travels_are_those_of_a_plain_search(seed: int) -> None:
    """Boxes of contours and of 64 contours may hide nothing."""
    n, width = 150, 3
    problem = varied(random_problem(seed, n, density=0.02, reversible=0.5), 2 * seed)
    relaxed = Relaxation(problem)
    rng = np.random.default_rng(seed)
    prices = relaxed.prices(relaxed.allowed(rng.normal(0.0, 1.0, relaxed.size)))
    tails, rest = price_travels(relaxed.choices, relaxed.boxes, relaxed.rule, prices, width)
    after = np.zeros((n, n), np.bool_)
    for b, c in sorted(problem.graph.pairs().tolist(), reverse=True):
        after[b] |= after[c]
        after[b, c] = True
    rule, offsets = relaxed.rule, relaxed.choices.offsets
    ways = [numbered(problem, c) for c in range(n)]
    for j in range(0, n, 3):
        covers = set(rule.covers[rule.offsets[j] : rule.offsets[j + 1]].tolist())
        unrelated = set(np.flatnonzero(~(after[j] | after[:, j])).tolist()) - {j}
        assert covers <= set(np.flatnonzero(after[:, j]).tolist())
        cost = {}
        for i in covers | unrelated:
            cost[i] = (
                prices.leave[i]
                - prices.crossing[prices.zone[i], prices.zone[j]]
                + min(
                    price(problem, out, into)
                    + prices.by_choice[offsets[i] + p]
                    - prices.by_choice[offsets[j] + q]
                    for p, (_, out) in ways[i]
                    for q, (into, _) in ways[j]
                )
            )
        cheapest = sorted(cost, key=lambda i: cost[i])
        listed = [i for i in tails[j].tolist() if i >= 0]
        assert [cost[i] for i in listed] == pytest.approx([cost[i] for i in cheapest[:width]])
        last = cost[cheapest[width - 1]] if len(cost) >= width else np.inf
        assert rest[j] == pytest.approx(last)


def numbered(problem: OrderProblem, c: int) -> list[tuple[int, tuple[np.ndarray, np.ndarray]]]:
    """Choices of a contour with the number of each; all of a loop's entries have one."""
    return [
        (k if problem.reversible[c] else 0, choice) for k, choice in enumerate(choices(problem, c))
    ]


def test_edges_given_twice_change_nothing() -> None:
    """Each travel pays its toll once; layers in series have many exclusive travels."""
    problem = columns(2, 4, 4)
    pairs = problem.graph.pairs()
    twice = replace(problem, graph=DependencyGraph.from_pairs(16, np.concatenate([pairs, pairs])))
    assert relaxed_bound_of(twice, 10) == pytest.approx(relaxed_bound_of(problem, 10))


def test_a_travel_below_the_bound_is_an_error() -> None:
    """One of the two is wrong then; to call it optimal would hide that."""
    with pytest.raises(ValueError, match="below the bound"):
        certificate.LowerBound(80.0, 0, "exact", 0).gap_percent(79.0)


@pytest.mark.slow
def test_few_contours_are_solved_exactly() -> None:
    """Tiny prints get the optimum itself."""
    for seed in range(300):
        problem = varied(small_problem(seed), seed)
        least = optimum(problem)
        found = lower_bound(problem, stopping=Stopping(0.0))
        assert found.method == "exact"
        assert found.bound <= least
        assert found.bound == pytest.approx(least, rel=1e-9)


def test_relaxation_holds_at_any_prices() -> None:
    """The proof does not depend on good prices: the climb may go anywhere."""
    rng = np.random.default_rng(0)
    for seed in range(60):
        problem = (small_problem(seed), towers(seed, 6), columns(seed, 3, 2))[seed % 3]
        problem = varied(problem, seed)
        relaxed = Relaxation(problem)
        at = relaxed.allowed(rng.normal(0.0, 3.0, relaxed.size))
        relaxed.take_up(at)
        found = relaxed.evaluate(at)
        assert found.value - found.rounding <= optimum(problem)


def columns(seed: int, layers: int, each: int) -> OrderProblem:
    """Layers in series, of contours 10 mm apart, each above its like in the layer below."""
    rng = np.random.default_rng(seed)
    n = layers * each
    start = 10.0 * np.stack([np.arange(n) % each, np.zeros(n), np.zeros(n)], axis=1)
    start[:, 1] = rng.random(n)
    start[:, 2] = np.arange(n) // each * 0.2
    pairs = [(a, b) for b in range(n) for a in range(b) if a // each < b // each]
    graph = DependencyGraph.from_pairs(n, np.array(pairs, np.int32))
    layer = (np.arange(n) // each).astype(np.int32)
    return OrderProblem(start, start.copy(), np.zeros(n, np.bool_), layer, graph)


def test_layers_in_series_are_climbed_once() -> None:
    """Climbing at every contour would cost a tenth; an order climbs once a layer."""
    problem = columns(2, 4, 3)
    least = optimum(problem)
    assert least > 4 * 2 * 10.0
    assert 0.97 * least <= relaxed_bound(problem, 12) <= least


def test_forced_crossings_are_paid() -> None:
    """Towers served in turns cost their distance each time; single travels do not show it."""
    problem = towers(1, 12)
    least = optimum(problem)
    assert least > 5 * 19.0
    bound = relaxed_bound(problem, 12)
    assert 0.97 * least <= bound <= least


@pytest.mark.parametrize("n", [0, 1])
def test_nothing_to_travel(n: int) -> None:
    """No contour or a single one needs no travel."""
    assert lower_bound(random_problem(0, n), stopping=Stopping(1.0)).bound == 0.0


def test_contours_on_one_spot_have_a_bound_of_zero() -> None:
    """Duplicate points must give no bound above the travel of zero."""
    n = 20
    spot = np.ones((n, 3))
    graph = DependencyGraph.from_pairs(n, np.empty((0, 2), np.int32))
    problem = OrderProblem(spot, spot.copy(), np.ones(n, np.bool_), np.zeros(n, np.int32), graph)
    found = lower_bound(problem, stopping=Stopping(iterations=100))
    assert found.bound == 0.0
    assert found.gap_percent(0.0) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_bound_stays_below_what_planners_find(seed: int) -> None:
    """Beyond the exact size the bound must still lie below any order found, and not far."""
    problem = random_problem(seed, 60, density=(0.0, 0.02, 0.1)[seed % 3], reversible=seed % 2)
    problem = varied(problem, 2 * seed)
    found = lower_bound(problem, stopping=Stopping(iterations=600))
    best = plan_order(problem, planner="local", stopping=Stopping(iterations=300_000), seed=0)
    assert found.method == "arborescence"
    near = 0.5 if problem.seams is None else 0.25  # entry and exit are chosen apart
    assert near * best.cost <= found.bound <= best.cost


@pytest.mark.slow
def test_more_iterations_never_lower_the_bound() -> None:
    """A longer search keeps the best bound of a shorter one."""
    problem = random_problem(3, 80, density=0.05)
    bounds = [
        lower_bound(problem, stopping=Stopping(iterations=limit)).bound
        for limit in (0, 5, 30, 100, 400)
    ]
    assert bounds == sorted(bounds)
    assert bounds[-1] > 1.05 * bounds[0]


def test_time_counts_only_in_whole_rounds() -> None:
    """A round cut off by the clock leaves the bound of the rounds before, so time never hurts."""
    problem = random_problem(5, 40, density=0.1)
    bounds = []
    for limit in (0.0, 30.0, 70.0, 130.0, 260.0):
        ticks = itertools.count()
        found = lower_bound(problem, stopping=Stopping(limit), clock=lambda: float(next(ticks)))  # noqa: B023 - called before the next turn
        bounds.append(found.bound)
    assert bounds == sorted(bounds)


def test_equal_iterations_give_equal_bounds() -> None:
    """Certificates are repeatable."""
    problem = random_problem(8, 50, density=0.1)
    one, other = (lower_bound(problem, stopping=Stopping(iterations=100)) for _ in range(2))
    assert one == other


def test_whoever_asks_ends_the_proof() -> None:
    """Ctrl-C keeps what is proven by then, which is the first bound at least."""
    problem = random_problem(8, 50, density=0.1)
    asked = lower_bound(problem, stopping=Stopping(60.0, asked=lambda: True))
    assert asked == lower_bound(problem, stopping=Stopping(0.0))


def test_gap_of_a_bound_of_zero_is_unknown() -> None:
    """No share above zero can be said."""
    assert certificate.LowerBound(0.0, 0, "exact", 0).gap_percent(1.0) is None
    assert certificate.LowerBound(80.0, 0, "exact", 0).gap_percent(100.0) == pytest.approx(25.0)


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.parametrize("freedom", ["fixed", "reversible", "seam"])
def test_bound_of_a_real_print(freedom: FreedomWord) -> None:
    """On a real print the bound holds against the search and is near enough to be of use."""
    path = CORPUS / "models" / "gcode" / "stained_glass_3.gcode.gz"
    if not path.exists():
        pytest.skip(f"no corpus of real prints at {CORPUS}")
    job, _ = read_gcode(path)
    machine = load_machine("paper")
    graph = build_graph(
        job.contours,
        machine.heads,
        clearance_mm=machine.clearance_mm,
        bead_width=machine.bead_width,
        process_order="free",
    )
    problem = OrderProblem.from_job(job, graph, freedom)
    best = plan_order(problem, planner="local", stopping=Stopping(iterations=3_000_000), seed=0)
    found = lower_bound(problem, stopping=Stopping(iterations=500))
    assert found.bound <= best.cost
    assert best.cost < {"fixed": 1.08, "reversible": 1.15, "seam": 5.0}[freedom] * found.bound
