"""One long annealing by both threads at once, each on its side of a cut.

Segments are exchanged and reversed within what lies between two positions, and whether
precedence allows that depends on nothing else. So two threads may change one sequence, one
before a cut and one behind it. Between slices of work the cut moves. That makes twice as
many proposals to one sequence, and faster ones, since each thread looks at less memory. Once the
annealing is over each side is annealed window by window (`.windows`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from decmcts.random_kernels import below, seeded
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.stopping import TemperatureSchedule
from decmcts.search.sop.annealing import SHARES, quenched
from decmcts.search.sop.annealing_kernels import Bare, anneal_bare
from decmcts.search.sop.windows import anneal_window, worse_at

_HOT, _COLD = 2.0, 0.1  # first temperature and that before the quench, in scales
_COOLED = 0.7  # share of what was left of the budget when it began


@dataclass(slots=True, kw_only=True)
class JointAnnealing:
    """A sequence, its temperature, and which thread changes which positions of it."""

    bare: Bare
    scale: float  # of temperatures
    state: NDArray[np.uint64]  # (1,) draws the cuts
    began: float  # budget spent when it began
    cost: float
    sides: list[JointThread] = field(default_factory=list)  # both threads
    _best: float = np.inf

    @staticmethod
    def of(bare: Bare, *, scale: float, seed: int, incumbent: Incumbent) -> JointAnnealing:
        """Go on from the incumbent, until the budget is spent."""
        bare.order[:] = incumbent.order
        bare.position[bare.order] = np.arange(len(bare.order))
        joint = JointAnnealing(
            bare=bare, scale=scale, state=seeded(seed), began=incumbent.spent, cost=incumbent.cost
        )
        for number in (0, 1):
            own = bare._replace(scratch=np.empty_like(bare.scratch))
            joint.sides.append(JointThread(joint, own, seeded(seed + number)))
        joint._cut()
        return joint

    def temperature(self, spent: float) -> float:
        """Return the temperature at a share of the budget."""
        share = (spent - self.began) / max(self.ends - self.began, 1e-9)
        return quenched(TemperatureSchedule(_HOT * self.scale, _COLD * self.scale), share)

    @property
    def ends(self) -> float:
        """Share of the budget at which windows begin."""
        return self.began + _COOLED * (1.0 - self.began)

    def meet(self, incumbent: Incumbent) -> None:
        """Add up what the threads have changed, offer it if it is the best, and cut anew."""
        self.cost += sum(side.change for side in self.sides)
        for side in self.sides:
            side.change = 0.0
        if self.cost < self._best:
            self._best = self.cost
            incumbent.offer(self.bare.order, incumbent.reversed, by="annealing")
        self._cut()

    def _cut(self) -> None:
        """Draw where the threads meet, in the middle half."""
        last, (before, behind) = len(self.bare.order) - 1, self.sides
        cut = last // 4 + int(below(self.state, last // 2 + 1))
        before.first, before.last, behind.first, behind.last = 0, cut, cut, last


@dataclass(slots=True)
class JointThread:
    """One thread of a joint annealing."""

    joint: JointAnnealing
    bare: Bare  # order and position are those of the other thread too
    state: NDArray[np.uint64]  # (1,)
    first: int = 0  # position; what lies between it and `last` is annealed
    last: int = 0
    change: float = 0.0  # of the cost since the last meeting

    def work(self, quota: int, spent: float) -> int:
        """Make `quota` proposals at the present temperature, or windows of as many."""
        joint = self.joint
        if spent < joint.ends:
            self.change += anneal_bare(
                self.bare, SHARES, self.state, joint.temperature(spent), quota,
                self.first, self.last,
            )  # fmt: skip
            return quota
        made, worse = 0, worse_at(joint.scale, (spent - joint.ends) / (1.0 - joint.ends))
        while made < quota:
            proposals, change = anneal_window(
                self.bare, self.state, joint.scale, worse, self.first, self.last
            )
            made += proposals
            self.change += change
        return made

    def meet(self, incumbent: Incumbent) -> None:
        """Let the annealing meet once all of its threads have worked."""
        if self is self.joint.sides[-1]:
            self.joint.meet(incumbent)
