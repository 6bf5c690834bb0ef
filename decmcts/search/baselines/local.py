"""The planners `local` and `layerwise`: annealing on one thread, and descent.

`layerwise` is what a careful slicer could do without looking across layers. A layer is a
maximal run of equal layer numbers in the source. So objects that the source prints one after
the other stay so, and the sequence of layers is always allowed.
"""

from __future__ import annotations

from dataclasses import dataclass

from decmcts.arrays import Int32s
from decmcts.search.decomposition.threads import anneal_rounds, descend_fully, open_threads
from decmcts.search.sequence.greedy import Greedy, layer_runs, nearest_in_layers
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.neighbours import near_ports
from decmcts.search.sequence.stopping import DESCENT_FROM

HOT, COLD = 1.5, 0.03
"""First and last temperature, in mean travels; within a factor of three either way results
hardly change."""


@dataclass(frozen=True, slots=True)
class Local:
    """Anneals the best of the source, the greedy and the layer-by-layer sequences.

    It does so in rounds, each from the best so far. The first round is short, so that a search
    stopped early has most of the gain; the last takes most of the time.
    """

    rounds: tuple[float, ...] = (0.1, DESCENT_FROM)  # shares of the budget at which rounds end
    rounds_if_small: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7, DESCENT_FROM)
    small: int = 400  # contours up to which several rounds beat one long one

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the budget, or stop at the first sequence without any travel."""
        n = len(incumbent.problem)
        if n < 2:
            return
        incumbent.offer(*nearest_in_layers(incumbent))
        Greedy().plan(incumbent, seed=seed)
        incumbent.tick()
        _anneal(incumbent, self.rounds_if_small if n <= self.small else self.rounds, seed)


@dataclass(frozen=True, slots=True)
class Layerwise:
    """Nearest neighbour within each layer, then annealing that never leaves a layer."""

    def plan(self, incumbent: Incumbent, *, seed: int) -> None:
        """Spend the whole budget."""
        if len(incumbent.problem) < 2:
            return
        incumbent.offer(*nearest_in_layers(incumbent))
        incumbent.tick(1)
        _anneal(incumbent, (DESCENT_FROM,), seed, layer_runs(incumbent.problem.layer))


def _anneal(
    incumbent: Incumbent,
    ends: tuple[float, ...],
    seed: int,
    group: Int32s | None = None,
) -> None:
    """Anneal the best sequence in rounds, and descend; moves stay within equal `group`."""
    if incumbent.over:
        return
    near = near_ports(incumbent.problem)
    with open_threads(1, seed) as threads:
        steps = anneal_rounds(incumbent, near, threads, ends, hot=HOT, cold=COLD, group=group)
        for _ in steps:
            if incumbent.over:
                break
    if not incumbent.over:
        descend_fully(incumbent, near, group)
    incumbent.offer_order(incumbent.order)
