"""A search that begins with another planner must lose neither its time nor its best sequence."""

from __future__ import annotations

from decmcts.search.planners import PLANNERS, Meanwhile, keeps_lags, plan_order
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem


class Recorded:
    """A planner that works in ticks of one iteration until the search is over."""

    def __init__(self) -> None:
        self.ticks = 0

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Count until the search is over."""
        while not incumbent.over:
            incumbent.tick(1)
            self.ticks += 1


def searched(ready_after: int, iterations: int = 10) -> tuple[int, int]:
    """Return the ticks each planner had, with the second ready after so many questions."""
    first, then = Recorded(), Recorded()
    asked = iter(range(10**6))
    planner = Meanwhile(first, then, lambda: next(asked) >= ready_after)
    plan_order(
        random_problem(0, 4), planner=planner, stopping=Stopping(iterations=iterations), seed=0,
    )  # fmt: skip
    return first.ticks, then.ticks


def test_ready_at_once_the_first_never_runs() -> None:
    """On a warm machine the search is what was asked for."""
    assert searched(ready_after=0)[0] == 0


def test_the_second_takes_over_when_it_is_ready() -> None:
    """Both share one budget."""
    first, then = searched(ready_after=4)
    assert first > 0
    assert then > 0
    assert first + then == 10


def test_never_ready_the_first_has_all_the_time() -> None:
    """A search shorter than compiling takes still searches."""
    assert searched(ready_after=10**6) == (10, 0)


def test_lags_are_kept_where_both_planners_keep_them() -> None:
    """A first run on a machine forgot cooling for all its time."""
    local, hybrid, greedy = (PLANNERS[name] for name in ("local", "hybrid", "greedy"))
    assert keeps_lags("hybrid") and keeps_lags(hybrid) and not keeps_lags("greedy")
    assert keeps_lags(Meanwhile(local, hybrid, lambda: False))
    assert not keeps_lags(Meanwhile(greedy, hybrid, lambda: False))
    assert not keeps_lags(Recorded())
