"""Cranes on one rail: optimal on small instances, repeatable, and judged without fault."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from decmcts.formats.bare.qcsp import QcspProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.qcsp.bound import least_makespan
from decmcts.team.qcsp.paths import paths_of
from decmcts.team.qcsp.solver import _threads_of, search_qcsp
from decmcts.team.qcsp.solver_kernels import SPREAD, decode, find_loads
from sim.qcsp import faults_of
from tests.team.qcsp.problems import problem_of


def random_qcsp(seed: int, n: int, q: int, bays: int, *, late: bool = False) -> QcspProblem:
    """Tasks anywhere, precedence mostly within bays, cranes at the least distance or more."""
    rng = np.random.default_rng(seed)
    s = int(rng.integers(0, 2))
    bay = np.sort(rng.integers(1, bays + 1, n))
    pairs = [
        [i + 1, j + 1]
        for i, j in itertools.combinations(range(n), 2)
        if rng.random() < (0.5 if bay[i] == bay[j] else 0.1)
    ]
    start = np.cumsum([1, *(s + 1 + rng.integers(0, 2, q - 1))])
    return problem_of(
        {
            "t": 1,
            "s": s,
            "p": rng.integers(1, 5, n).tolist(),
            "l": bay.tolist(),
            "r": (rng.integers(0, 4, q) if late else np.zeros(q, int)).tolist(),
            "l0": start.tolist(),
            "Phi": pairs,
        }
    )


def least_by_steps(problem: QcspProblem) -> int:
    """Return the least makespan by looking at every state the cranes can be in, step by step.

    It knows positions and remaining work only, no distances in time between tasks.
    Times are whole numbers, a bay takes one, and the rail goes on at both ends.
    """
    n, q, gap = len(problem), problem.cranes, problem.spacing
    reach = range(int(problem.bay.min()) - gap * q, int(problem.bay.max()) + gap * q + 1)
    pred = [frozenset(problem.precedence[problem.precedence[:, 1] == j, 0]) for j in range(n)]
    places = tuple(int(x) for x in problem.start)
    # where each crane is, its task and what is left of it (-1, 0: none), tasks done, tasks begun
    states = {(places, ((-1, 0),) * q, frozenset(), frozenset())}
    for time in itertools.count():
        following = set()
        for at, work, done, begun in states:
            if len(done) == n:
                return time
            choices = []
            for v in range(q):
                if work[v][1] > 0:
                    choices.append([("on", 0)])
                elif time < problem.ready[v]:
                    choices.append([("go", 0)])
                else:
                    able = [
                        ("do", j)
                        for j in range(n)
                        if problem.bay[j] == at[v] and j not in begun and pred[j] <= done
                    ]
                    choices.append([*able, ("go", -1), ("go", 0), ("go", 1)])
            for chosen in itertools.product(*choices):
                tasks = [j for what, j in chosen if what == "do"]
                if len(set(tasks)) < len(tasks):
                    continue
                x, left, over = list(at), list(work), set(done)
                for v, (what, k) in enumerate(chosen):
                    if what == "go":
                        x[v] += k
                        continue
                    j, rest = (k, int(problem.duration[k])) if what == "do" else work[v]
                    left[v] = (j, rest - 1) if rest > 1 else (-1, 0)
                    if rest == 1:
                        over.add(j)
                if all(b - a >= gap for a, b in itertools.pairwise(x)) and all(
                    b in reach for b in x
                ):
                    following.add((tuple(x), tuple(left), frozenset(over), begun | set(tasks)))
        states = following
    raise AssertionError


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
def test_small_instances_are_solved(seed: int) -> None:
    """The oracle knows states and steps only, so it also shows that the timing rule is right."""
    problem = random_qcsp(seed, 4, 2, 5, late=seed % 3 == 2)
    optimum = least_by_steps(problem)
    found = search_qcsp(problem, stopping=Stopping(iterations=60_000), seed=seed)
    assert faults_of(problem, found.schedule) == []
    assert found.schedule.makespan == optimum
    assert found.bound <= optimum


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_three_cranes_too(seed: int) -> None:
    """The one in the middle steps aside for both."""
    problem = random_qcsp(100 + seed, 3, 3, 4)
    optimum = least_by_steps(problem)
    found = search_qcsp(problem, stopping=Stopping(iterations=60_000))
    assert faults_of(problem, found.schedule) == []
    assert found.schedule.makespan == optimum
    assert found.bound <= optimum


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_every_schedule_is_one_the_judge_accepts(seed: int) -> None:
    """Few proposals give poor schedules, which must be sound all the same."""
    rng = np.random.default_rng(seed)
    n, q = int(rng.integers(1, 40)), int(rng.integers(1, 7))
    problem = random_qcsp(seed, n, q, int(rng.integers(1, 20)), late=seed % 2 == 1)
    found = search_qcsp(problem, stopping=Stopping(iterations=20), seed=seed)
    assert faults_of(problem, found.schedule) == []
    assert found.bound <= found.schedule.makespan


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_cranes_that_begin_too_near_only_move_apart(seed: int) -> None:
    """Published instances with wide safety distances begin so."""
    rng = np.random.default_rng(seed)
    n, q = 12, 4
    values: dict[str, Any] = {
        "t": float(rng.choice([0.5, 1.0, 3.0])),
        "s": int(rng.integers(2, 5)),
        "p": rng.uniform(0.5, 9.0, n).tolist(),
        "l": rng.integers(1, 15, n).tolist(),
        "r": [0] * q,
        "l0": [1, 3, 5, 7],
        "Phi": [],
    }
    problem = problem_of(values)
    found = search_qcsp(problem, stopping=Stopping(iterations=500), seed=seed)
    assert faults_of(problem, found.schedule) == []


@pytest.mark.slow
def test_precedence_against_the_sweep_is_kept() -> None:
    """Tasks that rest on others further along leave no crane able to go on by itself."""
    n = 9
    problem = problem_of(
        {
            "t": 1,
            "s": 1,
            "p": [2] * n,
            "l": list(range(1, n + 1)),
            "r": [0, 0],
            "l0": [1, 4],
            "Phi": [[n, 1], [5, 2], [9, 4], [3, 6]],
        }
    )
    found = search_qcsp(problem, stopping=Stopping(iterations=20_000))
    assert faults_of(problem, found.schedule) == []


@pytest.mark.slow
def test_equal_seeds_and_proposals_give_equal_schedules() -> None:
    """Threads must not decide what is found."""
    problem = random_qcsp(3, 30, 3, 12)
    first, second = (
        search_qcsp(problem, stopping=Stopping(iterations=100_000), seed=5) for _ in range(2)
    )
    assert np.array_equal(first.schedule.begin, second.schedule.begin)
    assert np.array_equal(first.schedule.crane, second.schedule.crane)
    assert np.array_equal(first.history[:, 1:], second.history[:, 1:])
    assert first.proposals == second.proposals <= 100_000


@pytest.mark.slow
def test_a_target_ends_the_search_the_same_way_whichever_thread_is_faster() -> None:
    """Rounds are long: what is good enough must not wait for their end, nor depend on luck."""
    problem = random_qcsp(3, 30, 3, 12)
    whole = search_qcsp(problem, stopping=Stopping(iterations=400_000), seed=5)
    target = whole.schedule.makespan * 1.05
    first, second = (
        search_qcsp(problem, stopping=Stopping(iterations=400_000), seed=5, target=target)
        for _ in range(2)
    )
    assert first.schedule.makespan <= target
    assert first.proposals == second.proposals < whole.proposals
    assert np.array_equal(first.schedule.begin, second.schedule.begin)
    assert np.array_equal(first.history[:, 1:], second.history[:, 1:])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_schedules_are_given_up_only_above_the_limit(seed: int) -> None:
    """What is skipped as too dear must be so, or good schedules are missed without a word."""
    problem = random_qcsp(seed, 20, 4, 12, late=seed % 2 == 1)
    thread = next(iter(_threads_of(problem, seed)))
    schedule = thread.schedule
    schedule.crane[:] = np.random.default_rng(seed).integers(0, 4, 20)
    least = find_loads(thread.problem, schedule)
    cost, makespan = decode(thread.problem, schedule, np.inf)
    assert least <= cost + 1e-9
    assert makespan == schedule.end.max()
    assert cost == pytest.approx(makespan + SPREAD * schedule.free.mean())
    assert decode(thread.problem, schedule, cost + 1e-6) == (cost, makespan)
    assert decode(thread.problem, schedule, cost - 1e-6) == (np.inf, np.inf)


def test_without_tasks_or_time_there_is_a_schedule() -> None:
    """Nothing to do ends at once; a limit of nothing still gives something sound."""
    nothing = problem_of({"t": 1, "s": 1, "p": [], "l": [], "r": [0], "l0": [3], "Phi": []})
    found = search_qcsp(nothing, stopping=Stopping(1.0))
    assert (found.schedule.makespan, found.optimal) == (0.0, True)
    assert faults_of(nothing, found.schedule) == []
    problem = random_qcsp(1, 8, 2, 6)
    found = search_qcsp(problem, stopping=Stopping(0.0))
    assert faults_of(problem, found.schedule) == []


def test_one_crane_s_path_goes_by_its_stops() -> None:
    """Time, place, and no detour that is not needed at the ends."""
    problem = problem_of({"t": 2, "s": 0, "p": [5, 5], "l": [3, 1], "r": [0], "l0": [3], "Phi": []})
    (path,) = paths_of(problem, np.array([0, 0]), np.array([0.0, 9.0]))
    assert path.tolist() == [[0.0, 3.0], [5.0, 3.0], [9.0, 1.0], [14.0, 1.0]]


def test_bays_too_near_bound_the_makespan() -> None:
    """Two bays within the distance never get work at once, whoever is there."""
    values = {"t": 1, "s": 2, "p": [10, 20, 5], "l": [4, 6, 9], "r": [0, 0], "l0": [1, 4]}
    assert least_makespan(problem_of({**values, "Phi": []})) == 30.0
    assert least_makespan(problem_of({**values, "s": 0, "Phi": []})) == 22.0
    assert least_makespan(problem_of({**values, "s": 0, "Phi": [[1, 2], [2, 3]]})) == 35.0
