"""One sequence shared out among threads, for prints too large for races."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.search.hybrid import Hybrid
from decmcts.search.incumbent import Incumbent
from decmcts.search.lanes import anneal_pieces
from decmcts.search.pieces import Sequence
from decmcts.search.planners import plan_order
from decmcts.search.races import Races
from decmcts.search.sharing import Sharing
from decmcts.search.structure import Trees
from tests.search.problems import random_problem

NO_RACES = Races(always=10, large=10)


def test_without_trees_stops_where_no_travel_is_left() -> None:
    """Annealing within layers of a large print may end there."""
    problem = random_problem(1, 30, density=0.1)
    alike = np.zeros_like(problem.start)
    still = replace(problem, start=alike, end=alike.copy())
    planner = Hybrid(races=NO_RACES, sharing=Sharing(large=10), trees=Trees(share=0.0))
    assert plan_order(still, planner=planner, time_limit_s=60.0, seed=0).cost == 0.0


@pytest.mark.parametrize("trees", [0.0, 0.02])
def test_goes_on_from_the_best_of_what_it_has_half_way(
    monkeypatch: pytest.MonkeyPatch, trees: float
) -> None:
    """A large print half-way is still warm and may cost more than the first, fast annealing."""
    begun: list[tuple[float, float]] = []

    def watched(incumbent: Incumbent, sequence: Sequence, *args: Any, **options: Any) -> bool:
        begun.append((sequence.cost, incumbent.cost))
        return anneal_pieces(incumbent, sequence, *args, **options)

    monkeypatch.setattr("decmcts.search.sharing.anneal_pieces", watched)
    planner = Hybrid(
        races=NO_RACES, sharing=Sharing(warm=1.4), trees=Trees(share=trees)
    )  # hardly cooled half-way
    problem = random_problem(5, 300, density=0.01)
    plan_order(problem, planner=planner, time_limit_s=60.0, seed=0, max_iterations=200_000)
    assert len(begun) == 3
    assert begun[2][0] == begun[2][1]
