"""One sequence parted among threads, for prints too large for several starts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from decmcts.search.decomposition.blocks import Sequence
from decmcts.search.decomposition.threads import anneal_blocks
from decmcts.search.hybrid.multistart import Multistart, Partition
from decmcts.search.hybrid.phases import Hybrid
from decmcts.search.planners import plan_order
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem

NO_STARTS = Multistart(always=10, at_most=10)


def test_goes_on_from_the_best_of_what_it_has_half_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """A large print half-way is still warm and may cost more than the first, fast annealing."""
    begun: list[tuple[float, float]] = []

    def watched(
        incumbent: Incumbent, sequence: Sequence, *args: Any, **options: Any
    ) -> Iterator[None]:
        begun.append((sequence.cost, incumbent.cost))
        yield from anneal_blocks(incumbent, sequence, *args, **options)

    monkeypatch.setattr("decmcts.search.hybrid.multistart.anneal_blocks", watched)
    hardly_cooled = Partition(warm=1.4)
    planner = Hybrid(multistart=NO_STARTS, partition=hardly_cooled)
    problem = random_problem(5, 300, density=0.01)
    plan_order(problem, planner=planner, stopping=Stopping(iterations=200_000), seed=0)
    assert len(begun) == 3
    assert begun[2][0] == begun[2][1]
