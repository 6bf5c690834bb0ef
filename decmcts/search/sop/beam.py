"""Beam searches of doubling width, in steps small enough to share the clock.

Run after run the width doubles, until a run drops nothing for want of width:
then the better of what it found and what was known before is proven optimal. When
memory allows no wider run, runs of the same width go on with a little noise. A beam reads
no clock and shares nothing, so another thread may step a second one at the same time.

References
----------
Libralesso, Bouhassoun, Cambazard & Jost 2020, "Tree search for the sequential
ordering problem".
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.search.sop.beam_kernels import (
    BeamProblem,
    Children,
    Expansion,
    Level,
    breed,
    descend_to,
    keep_best,
)
from decmcts.search.sop.precedence import Precedence

MOST_BYTES = 2**30  # of one beam
_FRESH = Expansion(0, 0, np.inf, 0)
_TIES = 1e-6  # of the mean reduced cost: breaks ties only
_NOISE = 0.1  # of the mean reduced cost: changes what is kept
_CAPACITY = 4  # children kept before they are thinned out, in widths


@dataclass(slots=True)
class Beam:
    """Beam searches through one problem, whose node 0 is first and n − 1 last; mutable.

    `costs` are reduced, never negative. With `backward` sequences are built from
    their end.
    """

    costs: Floats  # (n, n)
    precedence: Precedence
    seed: int
    backward: bool = False
    width: int = 1
    found: Ints | None = None  # cheapest sequence of the last finished run
    found_cost: float = np.inf  # reduced
    exhausted: bool = False  # a run has dropped nothing: there is nothing below its limit
    _rules: BeamProblem = field(init=False)
    _widest: int = field(init=False)
    _noise: float = field(init=False)
    _level: Level = field(init=False)
    _children: Children = field(init=False)
    _stand: Expansion = field(init=False)
    _trail: list[tuple[Int32s, Int32s]] = field(init=False)
    _dropped: bool = field(init=False)

    def __post_init__(self) -> None:
        costs, precedence = self.costs, self.precedence
        if self.backward:
            costs, precedence = costs.T[::-1, ::-1], precedence.reversed()
        n, rng = len(costs), np.random.default_rng(self.seed)
        counts = precedence.direct.sum(axis=1)
        self._rules = BeamProblem(
            np.ascontiguousarray(costs),
            _bit_rows(precedence.before.T),
            np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            np.nonzero(precedence.direct)[1].astype(np.int32),
            rng.integers(0, 2**64, (n, 2), dtype=np.uint64),
        )
        state = 8 * n + 64 * self._rules.needed.shape[1] + 64 * _CAPACITY + 64
        self._widest = 1 << max(int(np.log2(MOST_BYTES / state)), 0)
        self._noise = _TIES * float(costs.mean())
        self._begin()

    def step(self, quota: int, below: float) -> int:
        """Look at about `quota` children, of sequences below `below` only; return how many.

        `below` is in reduced costs. Ends early when a run does; `found` is then
        what it found and the next run is ready.
        """
        self.found, seen = None, 0
        while seen < quota and not self.exhausted and self.found is None:
            before = self._stand.seen
            self._stand = breed(
                self._rules,
                self._level,
                self._children,
                self._stand,
                self.width,
                below,
                self._noise,
                quota - seen,
            )
            seen += self._stand.seen - before
            if self._stand.state == len(self._level.last):
                self._next_level()
                seen += 1
        return seen

    def _begin(self) -> None:
        """Start a run of the present width at the first node."""
        words, room = self._rules.needed.shape[1], _CAPACITY * self.width + 1000
        slots = 1 << int(np.ceil(np.log2(2 * room)))
        self._children = Children(
            np.zeros(room, np.int32),
            np.zeros(room, np.int32),
            np.zeros(room),
            np.zeros(room, np.uint64),
            np.full(slots, -1, np.int64),
        )
        nothing, self._level = _new_level(1, words), _new_level(1, words)
        nothing.ready[0, 0] = 1
        nothing.mixed[0] = 0
        nothing.placed[0] = 0
        descend_to(self._rules, nothing, self._children, 1, self._level)
        self._trail, self._dropped, self._stand = [], False, _FRESH

    def _next_level(self) -> None:
        """Make the best children the states; after the last level, end the run."""
        children, n = self._children, len(self._rules.costs)
        self._dropped |= self._stand.limit < np.inf
        count, limit = keep_best(children, self._stand.kept, self.width, self._noise)
        self._dropped |= limit < np.inf
        following = _new_level(count, self._rules.needed.shape[1])
        descend_to(self._rules, self._level, children, count, following)
        self._trail.append((children.parent[:count].copy(), children.node[:count].copy()))
        children.table[:] = -1
        self._level, self._stand = following, _FRESH
        if count == 0 or len(self._trail) == n - 1:
            self._finish(count)

    def _finish(self, count: int) -> None:
        """Keep what the run found, and prepare the next one."""
        self.exhausted = not self._dropped
        self.found = self._walk_back() if count else None
        self.found_cost = float(self._level.cost.min()) if count else np.inf
        if self.exhausted:
            return
        if 2 * self.width <= self._widest:
            self.width *= 2
        else:
            self._noise = _NOISE * float(self._rules.costs.mean())
            rng = np.random.default_rng((self.seed, int(self._rules.words_of[0, 0] >> 1)))
            words = rng.integers(0, 2**64, self._rules.words_of.shape, dtype=np.uint64)
            self._rules = self._rules._replace(words_of=words)
        self._begin()

    def _walk_back(self) -> Ints:
        """Return the cheapest sequence of the last level."""
        k, order = int(np.argmin(self._level.cost)), []
        for parent, node in reversed(self._trail):
            order.append(int(node[k]))
            k = int(parent[k])
        sequence = np.array([0, *reversed(order)], np.int64)
        return len(sequence) - 1 - sequence[::-1] if self.backward else sequence


def _new_level(count: int, words: int) -> Level:
    """Return a level of so many states, not filled in."""
    return Level(
        np.zeros(count, np.int32),
        np.zeros(count),
        np.zeros(count, np.uint64),
        np.zeros((count, words), np.uint64),
        np.zeros((count, words), np.uint64),
    )


def _bit_rows(rows: Flags) -> NDArray[np.uint64]:
    """Return each row as words of 64 bits."""
    n, words = len(rows), (rows.shape[1] + 63) // 64
    padded = np.zeros((n, 64 * words), np.bool_)
    padded[:, : rows.shape[1]] = rows
    return np.packbits(padded, axis=1, bitorder="little").view(np.uint64)
