"""Races of whole sequences: when there are any, and what they begin with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.search.hybrid.lanes import Lanes, anneal_rivals
from decmcts.search.hybrid.phases import Hybrid
from decmcts.search.hybrid.pieces import Sequence
from decmcts.search.hybrid.races import Races
from decmcts.search.planners import plan_order
from decmcts.search.sequence.incumbent import Incumbent
from tests.search.problems import random_problem, with_loops


@pytest.mark.parametrize("ahead", [False, True])
def test_stays_within_layers_once_that_is_ahead(
    monkeypatch: pytest.MonkeyPatch, ahead: bool
) -> None:
    """Races within layers, joined layer by layer, beat races of the whole on real prints."""
    layer = np.repeat(np.arange(8, dtype=np.int32), 25)
    problem = replace(random_problem(2, 200, density=0.01), layer=layer)
    found: list[float] = []  # by races within layers
    raced: list[list[bool]] = []
    heats: list[float] = []  # of lanes that begin hot
    pools: list[int] = []  # how many are joined: what all races, or those within layers, ended in

    def watched(incumbent: Incumbent, rivals: list[Sequence], *args: Any, **options: Any) -> bool:
        if "groups" not in options:
            return anneal_rivals(incumbent, rivals, *args, **options)
        within = [bool(group.any()) for group in options["groups"]]
        coolings = args[1]
        assert (coolings[0].hot_mm < coolings[1].hot_mm) == within[0]
        heats.append(coolings[1].hot_mm)
        for rival, stays in zip(rivals, within, strict=True):
            assert not stays or (np.diff(layer[rival.order]) >= 0).all()
            assert not stays or rival.cost <= min(found, default=np.inf) + 1e-9
        stop = anneal_rivals(incumbent, rivals, *args, **options)
        if not within[0]:  # one of them has bad luck
            rivals[0 if ahead else 1].order[:] = np.arange(200)
            rivals[0 if ahead else 1].flip[:] = 0
        found.extend(rival.cost for rival, stays in zip(rivals, within, strict=True) if stays)
        raced.append(within)
        return stop

    join = Lanes.join

    def watched_join(lanes: Lanes, sequences: list[Sequence]) -> Sequence:
        assert len({id(sequence) for sequence in sequences}) == len(sequences)
        pools.append(len(sequences))
        return join(lanes, sequences)

    monkeypatch.setattr("decmcts.search.hybrid.races.anneal_rivals", watched)
    monkeypatch.setattr(Lanes, "join", watched_join)
    planner = Hybrid(promising=10.0, races=Races(steps=50.0))
    plan_order(problem, planner=planner, time_limit_s=60.0, seed=0, max_iterations=400_000)
    most = planner.races.most
    assert raced == [[False, True], *[[ahead, True]] * (most - 1)]
    assert heats == [heats[0]] * most  # the best is better by then, but no cooler
    pools = pools[: 2 * most]  # then come regions
    assert pools[::2] == [1 + 2 * (race + 1) for race in range(most)]
    assert pools[1::2] == [2 + (2 if ahead else 1) * race for race in range(most)]


@pytest.mark.parametrize(("at_most", "steps", "races"), [(100, 400, True), (100, 100, False),
                                                         (50, 400, False)])  # fmt: skip
def test_races_on_larger_prints_if_there_is_time(
    monkeypatch: pytest.MonkeyPatch, at_most: int, steps: int, races: bool
) -> None:
    """With a minute, races end better on prints of some thousand contours too."""
    raced: list[int] = []

    def watched(*args: Any, **options: Any) -> bool:
        raced.append(1)
        return anneal_rivals(*args, **options)

    monkeypatch.setattr("decmcts.search.hybrid.races.anneal_rivals", watched)
    planner = Hybrid(races=Races(always=10, at_most=at_most, least=100.0))
    problem = random_problem(5, 60, density=0.05)
    plan_order(problem, planner=planner, time_limit_s=60.0, seed=0, max_iterations=60 * steps)
    assert bool(raced) == races


@pytest.mark.parametrize(("loops", "races"), [(False, 3), (True, 1)])
def test_entries_of_loops_make_races_longer(
    monkeypatch: pytest.MonkeyPatch, loops: bool, races: int
) -> None:
    """Each further entry counts like a contour; counted as loops there would be two races.

    One long annealing ended 2 % lower on a real print with seams than six short ones.
    """
    raced: list[int] = []

    def watched(*args: Any, **options: Any) -> bool:
        raced.append("groups" in options)
        return anneal_rivals(*args, **options)

    monkeypatch.setattr("decmcts.search.hybrid.races.anneal_rivals", watched)
    planner = Hybrid(races=Races(steps=100.0))
    problem = random_problem(5, 60, density=0.05)
    problem = with_loops(problem, 5) if loops else problem
    plan_order(problem, planner=planner, time_limit_s=60.0, seed=0, max_iterations=70_000)
    assert sum(raced) == races


@pytest.mark.parametrize(
    "options", [{"steps": 0.5}, {"most": 0}, {"hot": 0.0}, {"mild": 0.0},
                {"cold": 0.0}, {"fused": -1.0}],
)  # fmt: skip
def test_bad_settings_are_refused(options: dict[str, float]) -> None:
    """Annealing divides by temperatures."""
    with pytest.raises(ValueError, match=next(iter(options))):
        Races(**options)  # type: ignore[arg-type]  # bad on purpose
