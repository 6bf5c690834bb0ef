"""The planner `hybrid`: tree search for the large structure, annealing for the rest.

Prints whose layers have few contours are solved exactly, if there is time. Else trees
over clusters, one for each Γ, propose a start, and what follows depends on size.
Up to a thousand contours, or more with more time: races of whole sequences, one a
thread, from unlike starts, within layers once that is ahead; after each only what the
best and a rival differ in. Larger: one sequence in pieces, long ones while hot, where
long moves decide the large structure, many short ones while cold; half-way the trees,
guided by what annealing made of the sequence, get another turn. At last regions, one
after the other, where there is time for many steps a contour; short stretches, solved
exactly, in turn with them, or alone where there is less time.

References
----------
Yoo et al. 2020 (tree and clusters); Gambardella & Dorigo 2000 (moves).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from decmcts.search.annealing import Cooling, descend_fully, tour_of
from decmcts.search.crossover import crossover
from decmcts.search.exact import WIDEST, Patience, solve_exactly
from decmcts.search.fusing import merge
from decmcts.search.greedy import Greedy
from decmcts.search.incumbent import Incumbent
from decmcts.search.lanes import Lanes, anneal_pieces, anneal_rivals, open_lanes
from decmcts.search.layerwise import layer_runs, nearest_in_layers
from decmcts.search.neighbours import near_ports
from decmcts.search.pieces import Sequence
from decmcts.search.regions import anneal_regions
from decmcts.search.stretches import solve_all_stretches
from decmcts.search.structure import gamma_searches, search_structure

_STEPS_A_S = 1.5e6  # of a lane, about
_CLUSTERING_S = 0.6e-6  # an edge and Γ, about


@dataclass(frozen=True, slots=True)
class Hybrid:
    """Tree search and annealing in turns; temperatures in multiples of the mean travel."""

    promising: float = 1.15  # cost of going by layers, in those of the best start, worth a try
    layers: float = 0.06  # share of the budget for annealing within layers of a large print
    raced: float = 0.65  # share of the budget at which races end
    settling: float = 0.2  # share of a race for annealing what the best and a rival differ in
    fused: float = 1.0  # temperature that begins with, in mean travels of what is fused
    racing: float = 3000.0  # steps of a lane in a race, for each contour and entry
    most_races: int = 8
    medium: int = 1000  # contours up to which races and regions beat sharing one sequence out,
    for_races: float = 15_000.0  # or more, up to `large`, with so many steps of a lane for each
    first: float = 0.05  # share of the budget for a first, fast annealing of a larger one
    turn: float = 0.5  # share of the budget at which the trees get their second turn
    end: float = 0.97  # share of the budget at which the descent begins
    shared: float = 0.75  # share of the budget at which a shared sequence goes on in regions,
    for_regions: float = 15_000.0  # if there are so many steps for each contour in all
    solved: float = 0.85  # or at which stretches of it are solved exactly,
    for_stretches: float = 2000.0  # if there are only so many
    probe: float = 0.15  # share of the budget for finding out what an exact solution takes,
    exact: float = 0.75  # and the share that may take; 0: no exact solutions
    large: int = 6000  # contours from which one Γ is all that time allows
    for_structure: float = 0.02  # share of the budget for each turn of the trees; 0: no trees
    gammas: tuple[float, ...] = (0.3, 0.5, 0.7, 0.9)
    threads: int = 2  # fixed, so that results do not depend on the machine
    hot: float = 1.5
    mild: float = 0.7  # from here on some of the structure stays
    warm: float = 0.2  # from here on the structure stays
    cold: float = 0.03
    anneals: bool = True  # False: trees and descent only
    exploration: float = 0.05  # of UCB1; rewards of good sequences differ little

    def __post_init__(self) -> None:
        if min(self.racing, self.most_races, self.threads) < 1:
            raise ValueError("racing, most_races and threads: expected 1 or more")

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the budget, or stop at the first sequence without any travel."""
        if len(incumbent.problem) < 2:
            return
        by_layers = nearest_in_layers(incumbent, layer_runs(incumbent.problem.layer))
        incumbent.offer(*by_layers)
        Greedy().plan(incumbent, seed=seed)
        if incumbent.tick() or self._solve(incumbent) or incumbent.tick():
            return
        near = near_ports(incumbent.problem)
        layered = layered_start(incumbent, near, *by_layers, promising=self.promising)
        with open_lanes(self.threads, seed) as lanes:
            if self._search(incumbent, near, lanes, layered):
                return
        incumbent.offer_order(incumbent.order)
        descend_fully(incumbent, tour_of(incumbent, near))
        incumbent.offer_order(incumbent.order)

    def _solve(self, incumbent: Incumbent) -> bool:
        """Solve the problem exactly, if it is of that kind; return whether it was."""
        if self.exact == 0.0:
            return False
        patience, widest = Patience(lambda: incumbent.spent, self.probe, self.exact), WIDEST
        if incumbent.budget.iterations is not None:
            widest = min(widest, 1 + int(self.probe * incumbent.budget.iterations))

        def go_on(made: int, share: float) -> bool:
            return not incumbent.tick(made) and patience.lasts(share)

        optimum = solve_exactly(incumbent.problem, go_on, widest=widest)
        if optimum is not None:
            incumbent.offer(optimum.order, optimum.flip, optimum.seat)
            incumbent.prove(optimum.bound)
            incumbent.tick()
        return optimum is not None

    def _search(
        self,
        incumbent: Incumbent,
        near: NDArray[np.int32],
        lanes: Lanes,
        layered: Sequence | None,
    ) -> bool:
        """Take turns until the descent is due; return whether to stop."""
        if incumbent.cost == 0.0:
            return True
        if not self.anneals:
            return self._found(incumbent, lanes, _sequence(incumbent, near), self.end)
        if self._has_time_for_races(incumbent):
            return self._race(incumbent, near, lanes, layered)
        return self._improve(incumbent, near, lanes, layered)

    def _race(
        self,
        incumbent: Incumbent,
        near: NDArray[np.int32],
        lanes: Lanes,
        layered: Sequence | None,
    ) -> bool:
        """Anneal whole sequences in races, then regions; return whether to stop.

        What a race ends in depends on what it begins with, and no start is best for all
        prints. One lane has the best sequence, or the trees'; the others the plain start,
        hot and mild in turn, or, if there is a layered one, what annealing within layers
        has made of that so far, hot. Once that is ahead, all lanes stay within layers, the
        first one mild; of one lane none does. Sharing the best with all lanes would make
        them alike. The best of all races so far is joined stretch by stretch: where layers
        follow each other strictly, it has the best that was found of each.
        """
        plain, layers = _sequence(incumbent, near), layer_runs(incumbent.problem.layer)
        whole, ahead = np.zeros_like(layers), False  # ahead: the layered one
        began, races = incumbent.spent, self._races(incumbent)
        length = (self.raced - began) / races
        for number in range(races):
            other = plain if layered is None else layered
            first = other.copy() if ahead else _sequence(incumbent, near)
            rivals = [first, *(other.copy() for _ in lanes.states[1:])]
            trees = number in (0, races // 2) and not ahead
            if trees and self._turn_of_trees(incumbent, lanes, first):
                return True
            hot, mild, _, cold = self._heats(incumbent)
            if hot == 0.0:
                return True
            heats = [mild if ahead else hot]
            heats += [mild if layered is None and number % 2 else hot for _ in rivals[1:]]
            groups = [layers if ahead else whole]
            groups += [whole if layered is None else layers for _ in rivals[1:]]
            coolings = [Cooling(heat, cold) for heat in heats]
            until = began + length * (number + 1)
            race_ends = until - self.settling * length
            if anneal_rivals(incumbent, rivals, lanes, coolings, race_ends, groups=groups):
                return True
            _offer(incumbent, _joined([_sequence(incumbent, near), *rivals]))
            if layered is not None and len(rivals) > 1:
                layered = _joined([layered, *rivals[0 if ahead else 1 :]])
                ahead = ahead or rivals[-1].cost < first.cost
            if self._settle(incumbent, _sequence(incumbent, near), rivals, lanes, until):
                return True
        return anneal_regions(incumbent, _sequence(incumbent, near), lanes, self.end)

    def _has_time_for_races(self, incumbent: Incumbent) -> bool:
        """Tell whether whole sequences, one a thread, end better than one shared out."""
        n = len(incumbent.problem)
        return n <= self.medium or n <= min(self.large, self._steps(incumbent) / self.for_races)

    def _races(self, incumbent: Incumbent) -> int:
        """Return how many races there is time for."""
        choices, seams = len(incumbent.problem), incumbent.problem.seams
        if seams is not None:
            choices += int((np.diff(seams.offsets) - 1).clip(0).sum())
        steps = self._steps(incumbent) * (self.raced - incumbent.spent)
        return int(min(max(1.0, steps / (self.racing * choices)), self.most_races))

    def _steps(self, incumbent: Incumbent) -> float:
        """Return about how many steps a lane has time for."""
        if incumbent.budget.iterations is not None:
            return incumbent.budget.iterations / self.threads
        return incumbent.budget.seconds * _STEPS_A_S

    def _settle(
        self,
        incumbent: Incumbent,
        best: Sequence,
        rivals: list[Sequence],
        lanes: Lanes,
        until: float,
    ) -> bool:
        """Anneal what the best sequence and the next best differ in; return whether to stop."""
        others = [rival for rival in rivals if rival.cost > best.cost]
        if not others:
            return False
        fused = merge(best, min(others, key=lambda rival: rival.cost))
        if len(fused.problem) < 2:
            return False
        merged = [fused.start() for _ in lanes.states]
        mean = merged[0].cost / len(fused.problem)
        coolings = [Cooling(self.fused * mean, self.cold * mean) for _ in merged]
        return mean > 0.0 and anneal_rivals(incumbent, merged, lanes, coolings, until, fused=fused)

    def _in_layers(self, incumbent: Incumbent, lanes: Lanes, layered: Sequence) -> bool:
        """Anneal within layers on each lane, join the best; return whether to stop."""
        hot, *_, cold = self._heats(incumbent)
        if hot == 0.0:
            return True
        rivals, until = [layered.copy() for _ in lanes.states], incumbent.spent + self.layers
        coolings = [Cooling(hot, cold) for _ in rivals]
        groups = [layer_runs(incumbent.problem.layer)] * len(rivals)
        if anneal_rivals(incumbent, rivals, lanes, coolings, until, groups=groups):
            return True
        _offer(incumbent, _joined(rivals))
        return False

    def _improve(
        self,
        incumbent: Incumbent,
        near: NDArray[np.int32],
        lanes: Lanes,
        layered: Sequence | None,
    ) -> bool:
        """Take trees, a first fast annealing and a long one; return whether to stop."""
        large = len(incumbent.problem) >= self.large
        if large and layered is not None and self._in_layers(incumbent, lanes, layered):
            return True
        if self._turn_of_trees(incumbent, lanes, _sequence(incumbent, near)):
            return True
        sequence, (hot, *_, cold) = _sequence(incumbent, near), self._heats(incumbent)
        first = incumbent.spent + self.first
        if anneal_pieces(incumbent, sequence, lanes, Cooling(hot, cold), first, a_lane=1):
            return True
        return self._share_out(incumbent, near, lanes)

    def _share_out(self, incumbent: Incumbent, near: NDArray[np.int32], lanes: Lanes) -> bool:
        """Anneal one sequence on all threads together; return whether to stop."""
        sequence, (hot, _, warm, cold) = _sequence(incumbent, near), self._heats(incumbent)
        if anneal_pieces(incumbent, sequence, lanes, Cooling(hot, warm), self.turn, a_lane=1):
            return True
        if self._turn_of_trees(incumbent, lanes, _sequence(incumbent, near)):
            return True
        if incumbent.cost < sequence.cost:  # the trees', or that of the first annealing
            sequence = _sequence(incumbent, near)
        steps = incumbent.iterations / (incumbent.spent * len(incumbent.problem))
        regions, stretches = steps >= self.for_regions, steps >= self.for_stretches
        until = self.shared if regions else self.solved if stretches else self.end
        if anneal_pieces(incumbent, sequence, lanes, Cooling(warm, cold), until, a_lane=4):
            return True
        if regions:
            return anneal_regions(incumbent, _sequence(incumbent, near), lanes, self.end)
        sequence = _sequence(incumbent, near)
        return stretches and solve_all_stretches(incumbent, sequence, lanes, self.end)

    def _turn_of_trees(self, incumbent: Incumbent, lanes: Lanes, guest: Sequence) -> bool:
        """Mutate the guest to the trees' best sequence; return whether to stop."""
        if incumbent.cost == 0.0 or not self._has_time_for_trees(incumbent):
            return incumbent.cost == 0.0
        stop = self._found(incumbent, lanes, guest, incumbent.spent + self.for_structure)
        return stop or incumbent.cost == 0.0

    def _has_time_for_trees(self, incumbent: Incumbent) -> bool:
        """Tell whether clustering takes no more than the share of time the trees have."""
        edges, budget = len(incumbent.problem.graph.preds), incumbent.budget
        if self.for_structure == 0.0 or budget.iterations is not None:
            return self.for_structure > 0.0
        seconds = _CLUSTERING_S * edges * len(self._gammas_for(incumbent))
        return seconds <= self.for_structure * budget.seconds

    def _gammas_for(self, incumbent: Incumbent) -> tuple[float, ...]:
        """Return each Γ to be tried."""
        return self.gammas if len(incumbent.problem) < self.large else self.gammas[1:2]

    def _heats(self, incumbent: Incumbent) -> tuple[float, float, float, float]:
        """Return the hot, mild, warm and cold temperatures for the best sequence."""
        mean = incumbent.cost / len(incumbent.problem)
        return self.hot * mean, self.mild * mean, self.warm * mean, self.cold * mean

    def _found(self, incumbent: Incumbent, lanes: Lanes, guest: Sequence, until: float) -> bool:
        """Mutate the guest to the trees' best sequence; return whether to stop."""
        gammas = self._gammas_for(incumbent)
        searches = gamma_searches(incumbent, gammas, lanes.fresh(len(gammas)))
        best, stop = search_structure(
            incumbent, searches, lanes, exploration=self.exploration, until=until
        )
        guest.order[:], guest.flip[:] = best.order, best.flip
        guest.settle()
        _offer(incumbent, guest)
        incumbent.notes["gamma"] = best.gamma
        return stop


def layered_start(
    incumbent: Incumbent,
    near: NDArray[np.int32],
    order: NDArray[np.int32],
    flip: NDArray[np.uint8],
    *,
    promising: float,
) -> Sequence | None:
    """Return the best sequence if it goes by layers, else the one given if it promises enough.

    That one gets the entries that suit it and may then cost `promising` times the best.
    None too if there is but one layer.
    """
    best, group = _sequence(incumbent, near), layer_runs(incumbent.problem.layer)
    if group[-1] == 0:
        return None
    if (np.diff(group[best.order]) >= 0).all():
        return best
    layered = replace(best.copy(), order=order.copy(), flip=flip.copy())
    layered.settle()
    return layered if layered.cost <= promising * best.cost else None


def _joined(sequences: list[Sequence]) -> Sequence:
    """Return the best of what the sequences have, stretch by stretch."""
    joined = reduce(crossover, sequences)
    joined.settle()
    return joined


def _offer(incumbent: Incumbent, sequence: Sequence) -> None:
    incumbent.offer(sequence.order, sequence.flip, sequence.seat)


def _sequence(incumbent: Incumbent, near: NDArray[np.int32]) -> Sequence:
    """Return a mutable copy of the best sequence."""
    return Sequence(
        incumbent.problem,
        incumbent.metric,
        near,
        incumbent.order.copy(),
        incumbent.flip.copy(),
        incumbent.seat.copy(),
    )
