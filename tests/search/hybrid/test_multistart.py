"""Several starts: when there are any, and what they begin with."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.search.decomposition.blocks import Sequence, crossover
from decmcts.search.decomposition.threads import anneal_sequences, open_threads
from decmcts.search.hybrid.multistart import Multistart
from decmcts.search.hybrid.phases import Hybrid
from decmcts.search.hybrid.search import HybridSearch, LayeredStart
from decmcts.search.planners import plan_order
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem, with_loops


@pytest.mark.parametrize("ahead", [False, True])
def test_stays_within_layers_once_that_is_ahead(
    monkeypatch: pytest.MonkeyPatch, ahead: bool
) -> None:
    """Sequences annealed within layers, joined layer by layer, beat others on real prints."""
    layer = np.repeat(np.arange(8, dtype=np.int32), 25)
    problem = replace(random_problem(2, 200, density=0.01), layer=layer)
    found: list[float] = []  # by those that stayed within layers
    rounds: list[list[bool]] = []
    heats: list[float] = []  # of threads that begin hot
    pools: list[int] = []  # how many are joined: what all ended in, or those within layers

    def watched(
        incumbent: Incumbent, sequences: list[Sequence], *args: Any, **options: Any
    ) -> Iterator[None]:
        if "groups" not in options:
            yield from anneal_sequences(incumbent, sequences, *args, **options)
            return
        within = [bool(group.any()) for group in options["groups"]]
        schedules = args[1]
        assert (schedules[0].first < schedules[1].first) == within[0]
        heats.append(schedules[1].first)
        for sequence, stays in zip(sequences, within, strict=True):
            assert not stays or (np.diff(layer[sequence.order]) >= 0).all()
            assert not stays or sequence.cost <= min(found, default=np.inf) + 1e-9
        yield from anneal_sequences(incumbent, sequences, *args, **options)
        if not within[0]:  # one of them has bad luck
            sequences[0 if ahead else 1].order[:] = np.arange(200)
            sequences[0 if ahead else 1].reversed[:] = 0
        found.extend(
            sequence.cost for sequence, stays in zip(sequences, within, strict=True) if stays
        )
        rounds.append(within)

    def watched_crossover(sequences: list[Sequence]) -> Sequence:
        assert len({id(sequence) for sequence in sequences}) == len(sequences)
        pools.append(len(sequences))
        return crossover(sequences)

    monkeypatch.setattr("decmcts.search.hybrid.multistart.anneal_sequences", watched)
    monkeypatch.setattr("decmcts.search.hybrid.multistart.crossover", watched_crossover)
    planner = Hybrid(layered=LayeredStart(most_cost=10.0), multistart=Multistart(steps=50.0))
    plan_order(problem, planner=planner, stopping=Stopping(iterations=400_000), seed=0)
    most = planner.multistart.most
    assert rounds == [[False, True], *[[ahead, True]] * (most - 1)]
    assert heats == [heats[0]] * most  # the best is better by then, but no cooler
    assert pools[::2] == [1 + 2 * (number + 1) for number in range(most)]
    assert pools[1::2] == [2 + (2 if ahead else 1) * number for number in range(most)]


@contextmanager
def search_of(problem: OrderProblem, iterations: int) -> Iterator[HybridSearch]:
    """A search that has only begun."""
    stopping = Stopping(iterations=iterations)
    incumbent = Incumbent(problem, clock=lambda: 0.0, stopping=stopping)
    with open_threads(2, 0) as threads:
        yield HybridSearch(incumbent, threads)


@pytest.mark.parametrize(("at_most", "steps", "several"), [(100, 400, True), (100, 100, False),
                                                         (50, 400, False)])  # fmt: skip
def test_several_starts_on_larger_prints_if_there_is_time(
    at_most: int, steps: int, several: bool
) -> None:
    """With a minute, several starts end better on prints of some thousand contours too."""
    multistart = Multistart(always=10, at_most=at_most, least=100.0)
    with search_of(random_problem(5, 60, density=0.05), 60 * steps) as search:
        assert multistart.suits(search) == several


@pytest.mark.parametrize(("loops", "expected"), [(False, 3), (True, 1)])
def test_entries_of_loops_make_rounds_longer(loops: bool, expected: int) -> None:
    """Each further entry counts like a contour; counted as loops there would be two rounds.

    One long annealing ended 2 % lower on a real print with seams than six short ones.
    """
    problem = random_problem(5, 60, density=0.05)
    with search_of(with_loops(problem, 5) if loops else problem, 53_500) as search:
        assert Multistart(steps=100.0).rounds(search) == expected
