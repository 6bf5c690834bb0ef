"""Stretches of a sequence put in their best order, one after the other, exactly.

Annealing leaves some dozens of contours that follow each other in a good order; which
is the best is found in milliseconds (`decmcts._kernels.exact.stretch`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.exact.ideals import Ideals
from decmcts._kernels.exact.stretch import solve_stretches
from decmcts.search.bounds.exact import room_for, slack_of
from decmcts.search.hybrid.crossover import crossover
from decmcts.search.hybrid.lanes import ROUND_S, Lanes
from decmcts.search.hybrid.pieces import Sequence, cut
from decmcts.search.sequence.incumbent import Incumbent

_IDEALS, _STEPS, _TRAVELS = 100_000, 400_000, 2_000_000  # 25 MiB, if all is used
_SLOTS = 40_009  # a prime
_WIDEST = 20_000  # steps from all ideals of a level
_CHUNK_S = 0.03  # how often the clock is looked at
_LEAST_CHUNK, _LARGEST_CHUNK = 1_000, 4_000_000  # travels priced


@dataclass(slots=True)
class Stretches:
    """What one lane has learnt of stretches, and its room for solving them."""

    length: float = 8.0  # positions
    chunk: int = _LEAST_CHUNK  # travels
    _ideals: Ideals = field(default_factory=lambda: room_for(_IDEALS, _STEPS, _TRAVELS, _SLOTS))

    def improve(
        self, incumbent: Incumbent, sequence: Sequence, state: NDArray[np.uint64], until: float
    ) -> int:
        """Mutate the sequence and the generator until the share `until` is spent.

        If iterations are limited, there are as many as that share has. Returns how many.
        """
        if len(sequence.order) <= 2:
            return 0
        piece, slack, made = cut(sequence, 0, len(sequence.order)), slack_of(sequence.problem), 0
        limit, spent, most = incumbent.budget.iterations, incumbent.spent, _TRAVELS
        if limit is not None:
            self.chunk = most = int((until - spent) * limit)
        while spent < until:
            before = incumbent.seconds
            self.length, steps = solve_stretches(
                piece.tour, self._ideals, state, self.length, slack, _WIDEST, most, self.chunk
            )
            made += steps
            if limit is not None or steps < self.chunk:  # all is in its best order
                break
            speed = steps / max(incumbent.seconds - before, 1e-6)
            self.chunk = int(min(max(_CHUNK_S * speed, _LEAST_CHUNK), _LARGEST_CHUNK))
            spent = incumbent.spent
        piece.put_back(sequence)
        return made


def solve_all_stretches(
    incumbent: Incumbent, sequence: Sequence, lanes: Lanes, until: float
) -> bool:
    """Improve a sequence until the share `until` is spent; return whether to stop.

    Each lane solves stretches of its own, and the best of all goes on. Mutates the sequence
    and the generators; the incumbent gets what is better.
    """
    stretches, count = [Stretches() for _ in lanes.states], len(lanes.states)
    while (spent := incumbent.spent) < until:
        ends = spent + (until - spent) / count  # of iterations each lane makes its part
        if incumbent.budget.iterations is None:
            ends = min(until, spent + ROUND_S / incumbent.budget.seconds)
        found = [sequence.copy() for _ in stretches]
        made = lanes.pool.map(
            Stretches.improve, stretches, repeat(incumbent), found, lanes.states, repeat(ends)
        )
        total = sum(made)
        sequence.become(crossover(found))
        sequence.settle()
        incumbent.offer(sequence.order, sequence.flip, sequence.seat)
        if incumbent.tick(total) or incumbent.cost == 0.0:
            return True
        if total == 0:  # too few contours, or iterations
            break
    return False
