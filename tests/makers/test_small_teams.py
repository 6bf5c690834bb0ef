"""Brute force over joint orders finds what trying each of them with the engine finds.

It is a table's yardstick (docs/results), compiled anew in every process: half a minute.
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest

from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.engine.carry_out_kernels import OK, carry_out
from decmcts.team.engine.order import sequences_of
from decmcts.team.engine.plans import StatedOrder, encode_stated
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve
from tests.makers.small_teams import least_makespan, small_problem

pytestmark = pytest.mark.long
PRINTS = [(5, 2, 2, 1), (49, 2, 2, 1), (49, 2, 1, 2), (9, 3, 2, 1), (33, 3, 1, 2)]


def every_order(problem: TeamProblem) -> float:
    """Return the least makespan of all orders, heads and directions, one after the other."""
    n, heads = len(problem.macro), len(problem.machine.heads)
    least = np.inf
    for order in permutations(range(n)):
        for head in product(range(heads), repeat=n):
            if not problem.space.eligible[list(order), list(head)].all():
                continue
            for directions in product((False, True), repeat=n):
                is_reversed = np.array(directions)
                if (is_reversed & ~problem.visits.reversible[list(order)]).any():
                    continue
                stated = StatedOrder(
                    np.array(order, np.int32), is_reversed, np.array(head, np.int64)
                )
                sequences = sequences_of(stated.toolpaths(heads))
                units, verdict = carry_out(sequences, problem.visits, problem.fleet)
                if verdict == OK:
                    least = min(least, float(units.end[: units.used[0]].max()))
    return least


@pytest.mark.parametrize("print_", PRINTS)
def test_nothing_better_is_left_out(print_: tuple[int, int, int, int]) -> None:
    """Neither the bound nor the states that are tried once may cost the optimum."""
    problem = small_problem(*print_)
    assert problem is not None
    found = least_makespan(problem)
    assert found.complete and found.stated is not None
    assert found.makespan_s == pytest.approx(every_order(problem), rel=1e-9)
    heads = len(problem.machine.heads)
    plan = encode_stated(found.stated, heads, problem.n_macros)
    again = resolve(problem, {0: plan}, range(heads)).makespan_s
    assert again == pytest.approx(found.makespan_s, rel=1e-9)


def test_what_is_to_be_beaten_stays_where_nothing_beats_it() -> None:
    """So is planning shown to have reached the least."""
    problem = small_problem(5, 2, 2, 1)
    assert problem is not None
    least = least_makespan(problem).makespan_s
    again = least_makespan(problem, least)
    assert again.makespan_s == least and again.stated is None and again.complete


def test_brute_force_that_is_given_up_says_so() -> None:
    """A table may not call what was not finished proven."""
    problem = small_problem(5, 2, 2, 1)
    assert problem is not None
    assert not least_makespan(problem, most=3).complete


@pytest.mark.parametrize("seed", [0, 1])
def test_planning_leaves_a_place_where_long_runs_of_annealing_end(seed: int) -> None:
    """From half a mean contour's time they stayed 10 % above the least, whatever the time."""
    problem = small_problem(255, 2, 2, 2)
    assert problem is not None
    found = plan_in_turn(problem, stopping=Stopping(iterations=3), seed=seed)
    assert found.makespan_s == pytest.approx(least_makespan(problem).makespan_s, rel=1e-6)
