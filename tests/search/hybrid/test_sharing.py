"""One sequence shared out among threads, for prints too large for races."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.search.hybrid.lanes import anneal_pieces, open_lanes
from decmcts.search.hybrid.phases import Hybrid
from decmcts.search.hybrid.pieces import Sequence
from decmcts.search.hybrid.races import Races
from decmcts.search.hybrid.regions import Regions
from decmcts.search.hybrid.sharing import Sharing
from decmcts.search.hybrid.structure import Trees
from decmcts.search.planners import plan_order
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Budget, IterationLimit
from tests.search.problems import random_problem

NO_RACES = Races(always=10, at_most=10)


def incumbent_of(problem: OrderProblem) -> Incumbent:
    limit = IterationLimit(10_000)
    return Incumbent(problem, clock=lambda: 0.0, budget=Budget(60.0, 10_000), criterion=limit)


@pytest.mark.parametrize("has_layered", [False, True])
def test_stops_where_no_travel_is_left(has_layered: bool) -> None:
    """There is no heat below that; a turn of the trees or annealing within layers may end there."""
    problem = random_problem(1, 30, density=0.1)
    alike = np.zeros_like(problem.start)
    incumbent = incumbent_of(replace(problem, start=alike, end=alike.copy()))
    near, sharing = near_ports(incumbent.problem), Sharing(layers_from=10)
    layered = Sequence.best_of(incumbent, near) if has_layered else None
    with open_lanes(2, 0) as lanes:
        assert sharing.run(incumbent, near, lanes, layered, Trees(share=0.0), Regions(), 0.97)
    assert incumbent.iterations == 0


@pytest.mark.parametrize("trees", [0.0, 0.02])
def test_goes_on_from_the_best_of_what_it_has_half_way(
    monkeypatch: pytest.MonkeyPatch, trees: float
) -> None:
    """A large print half-way is still warm and may cost more than the first, fast annealing."""
    begun: list[tuple[float, float]] = []

    def watched(incumbent: Incumbent, sequence: Sequence, *args: Any, **options: Any) -> bool:
        begun.append((sequence.cost, incumbent.cost))
        return anneal_pieces(incumbent, sequence, *args, **options)

    monkeypatch.setattr("decmcts.search.hybrid.sharing.anneal_pieces", watched)
    hardly_cooled = Sharing(warm=1.4)
    planner = Hybrid(races=NO_RACES, sharing=hardly_cooled, trees=Trees(share=trees))
    problem = random_problem(5, 300, density=0.01)
    plan_order(problem, planner=planner, time_limit_s=60.0, seed=0, max_iterations=200_000)
    assert len(begun) == 3
    assert begun[2][0] == begun[2][1]


@pytest.mark.parametrize("options", [{"hot": 0.0}, {"warm": 0.0}, {"cold": -0.1}])
def test_bad_settings_are_refused(options: dict[str, float]) -> None:
    """Annealing divides by temperatures."""
    with pytest.raises(ValueError, match=next(iter(options))):
        Sharing(**options)  # type: ignore[arg-type]  # bad on purpose
