"""The incumbent knows when the search is over, so that nobody has to hand it on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.errors import InputError
from decmcts.search.sequence.greedy import Greedy
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import Progress, Stopping
from tests.search.problems import random_problem


def begun(stopping: Stopping, told: list[Progress] | None = None) -> Incumbent:
    """An incumbent of a small print, at a clock that stands still."""
    report = None if told is None else told.append
    return Incumbent(random_problem(1, 9), clock=lambda: 0.0, stopping=stopping, report=report)


def test_work_that_is_counted_ends_the_search() -> None:
    """And it stays over, whatever the stopping would say later."""
    asked = iter([False, True, False])
    incumbent = begun(Stopping(iterations=100, asked=lambda: next(asked)))
    incumbent.tick(3)
    assert not incumbent.over
    incumbent.tick(4)
    assert incumbent.over
    incumbent.tick()
    assert incumbent.over
    assert incumbent.iterations == 7


def test_each_piece_of_work_is_reported() -> None:
    """A progress bar needs no clock of its own."""
    told: list[Progress] = []
    incumbent = begun(Stopping(iterations=10), told)
    for _ in range(3):
        incumbent.tick(2)
    assert [progress.iterations for progress in told] == [2, 4, 6]
    assert incumbent.spent == 0.6


def test_what_is_proven_optimal_ends_the_search() -> None:
    """No limit need be used up for it."""
    incumbent = begun(Stopping(iterations=10))
    incumbent.finish()
    assert incumbent.over


def test_without_any_travel_there_is_nothing_to_search() -> None:
    """Temperatures are multiples of the mean travel; zero is none."""
    problem = random_problem(1, 9)
    alike = np.zeros_like(problem.start)
    problem = replace(problem, start=alike, end=alike.copy())
    assert Incumbent(problem, clock=lambda: 0.0, stopping=Stopping(seconds=1.0)).over


def test_who_asks_counts_only_within_the_with() -> None:
    """What one planner is to end for, the next may go on with."""
    incumbent = begun(Stopping(iterations=10))
    with incumbent.ending_when(lambda: True):
        incumbent.tick(1)
        assert incumbent.over
    assert not incumbent.over
    with incumbent.ending_when(lambda: False):
        incumbent.tick(9)
    assert incumbent.over


def test_preparations_count_where_it_began_before_them() -> None:
    """Also by a clock that began at 0."""
    stopping = Stopping(seconds=10.0)
    given = Incumbent(random_problem(1, 9), clock=lambda: 3.0, stopping=stopping, started=0.0)
    assert given.seconds == 3.0
    assert given.spent == 0.3
    assert Incumbent(random_problem(1, 9), clock=lambda: 3.0, stopping=stopping).seconds == 0.0


def test_it_knows_who_found_the_best_sequence() -> None:
    """Whoever offered a worse one later did not."""
    incumbent, other = (begun(Stopping(iterations=100)) for _ in range(2))
    Greedy().plan(other, seed=0)
    assert other.cost < incumbent.cost
    found = (other.order, other.reversed, other.entry_id)
    assert incumbent.found_by == ""
    assert incumbent.offer(*found, by="beam")
    assert not incumbent.offer(*found, by="annealing")
    assert incumbent.found_by == "beam"


@pytest.mark.parametrize(
    "wrong",
    [
        np.arange(8),
        np.arange(9) + 1,
        np.arange(9) - 1,
        np.arange(9) + 0.5,
        np.arange(9) * 2**40,
        np.zeros(9, np.int32),
        np.arange(9)[None],
        "order",
        None,
    ],
)
def test_what_is_no_order_is_named(wrong: object) -> None:
    """Kernels trust their callers: a number beyond the contours once ended the process."""
    incumbent = begun(Stopping(iterations=10))
    with pytest.raises(InputError, match="order"):
        incumbent.offer_order(wrong)
    if isinstance(wrong, np.ndarray):
        with pytest.raises(InputError, match="order"):
            incumbent.offer(wrong, np.zeros(9, np.uint8))
    with pytest.raises(InputError, match="is_reversed"):
        incumbent.offer(np.arange(9, dtype=np.int32), np.zeros(3, np.uint8))


def test_an_order_may_be_of_any_numbers_that_are_whole() -> None:
    for order in (np.arange(9.0), list(range(9)), np.arange(9, dtype=np.uint8)):
        incumbent = begun(Stopping(iterations=10))
        incumbent.offer_order(order)
        assert incumbent.order.tolist() == list(range(9))
