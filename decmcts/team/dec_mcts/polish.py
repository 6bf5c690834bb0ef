"""Refines one joint order by local search, and crosses it with other heads' orders.

Front of `recreate_kernels`, `polish_kernels` and `windows_kernels`. A head improves the best joint
order it knows and sends it to the team. From an order it receives it takes the windows that are
better than its own (partition crossover, Whitley, Hains & Howe 2009). So heads improve different
places at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from decmcts.arrays import Flags, Ints
from decmcts.random_kernels import log_uniform, seeded
from decmcts.team.dec_mcts.polish_kernels import RUN, SHORTEST, Annealing, PolishMoves, polish
from decmcts.team.dec_mcts.recreate_kernels import Guide, recreate
from decmcts.team.dec_mcts.windows_kernels import join
from decmcts.team.engine.dispatch_kernels import new_pool
from decmcts.team.engine.joint_kernels import NONE, TeamState, all_parked, new_units
from decmcts.team.engine.plans import POLICIES, StatedOrder
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.replay_kernels import JointOrder, Marks, finish, link
from decmcts.team.engine.resolve import fleet_for, policy_of

NEAR = 10  # contours near each end of one
LEVEL_MM = 20.0  # to find what is near, 1 mm upwards counts as so many along the bed
FEW = 40  # contours of an order that is annealed as a whole
SMALL = 8  # contours up to which all sweeps are done; fewer beyond, for as much work
LEAST_SWEEPS = 6
SWEEPS = 10  # of one annealing, about; the next begins hot again
COOLEST, HOTTEST = 0.3, 3.0  # first temperature of an annealing, in mean times of a contour
COLD_S = 0.003  # temperature of moves: the last one in small orders, the only one in large ones
SLACK_S = 0.3  # temperature of windows, in large orders


class Polish:
    """The search on one joint order of all heads; equal seeds and calls give equal orders.

    `best` and `best_s` are the best order it has seen and its makespan.
    """

    def __init__(
        self,
        problem: TeamProblem,
        stated: StatedOrder,
        *,
        seed: int,
        live: Sequence[int] | None = None,
    ) -> None:
        """Begin with an order that `live` heads can carry out; None: all heads."""
        n, heads = len(problem.macro), len(problem.machine.heads)
        self._problem, self._state = problem, seeded(seed)
        fleet, self._eligible = fleet_for(problem, range(heads) if live is None else live)
        self._moves = _moves(problem, self._eligible)
        self._joint, parked = _joint_of(stated, heads), all_parked(n, fleet)
        units, self._marks = new_units(8 * n + 64 * heads * (heads + 2)), _marks(n, parked)
        self._engine = self._joint, problem.visits, fleet, units, parked, self._marks
        self.began_s = self.makespan_s = finish(0, *self._engine)
        self.best, self.best_s = stated, self.makespan_s

    @property
    def _searchable(self) -> bool:
        """Whether there is an order to search, which heads can carry out."""
        return bool(np.isfinite(self.makespan_s)) and len(self._joint.order) > 0

    def improve(self, windows: int) -> None:
        """Polish some random windows, or a small order as a whole; `best` never gets worse."""
        if not self._searchable:
            return
        if len(self._joint.order) <= FEW:
            self._anneal(windows)
        else:
            self._polish(windows, Annealing(COLD_S, SLACK_S, 1.0, SHORTEST))

    def recreate(self, windows: int) -> None:
        """Ruin and recreate some random windows; the order never gets worse."""
        if self._searchable:
            self._keep(recreate(self.makespan_s, windows, *self._engine, self._guide, self._state))

    @cached_property
    def _guide(self) -> Guide:
        """Policies, and arrays to try them in: many orders are polished and never recreated."""
        return _guide(self._problem, self._eligible)

    def _anneal(self, sweeps: int) -> None:
        """Anneal a small order as a whole, several times; it may end worse than it began.

        Short ones that begin at different temperatures end in more places than a long one.
        """
        sweeps = max(LEAST_SWEEPS, sweeps * SMALL // max(SMALL, len(self._joint.order)))
        times = max(1, sweeps // SWEEPS)
        each = sweeps // times
        for _ in range(times):
            first = log_uniform(self._state, COOLEST, HOTTEST)
            hot = max(COLD_S, first * float(self._problem.visits.seconds.mean()))
            for sweep in range(each):
                temperature = hot * (COLD_S / hot) ** ((sweep + 1) / each)
                self._polish(1, Annealing(temperature, np.inf, 0.01, FEW))

    def _polish(self, windows: int, annealing: Annealing) -> None:
        engine, state = self._engine, self._state
        self._keep(polish(self.makespan_s, windows, annealing, self._moves, *engine, state))

    def take(self, other: StatedOrder) -> None:
        """Take from another joint order the windows in which it is better."""
        if self._searchable:
            windows = _differences(self._stated(), other)
            order, head = other.order.astype(np.int64), other.head.astype(np.int64)
            is_reversed = np.ascontiguousarray(other.reversed)
            self._keep(join(self.makespan_s, windows, order, head, is_reversed, *self._engine))

    def _stated(self) -> StatedOrder:
        order = self._joint.order
        return StatedOrder(
            order.astype(np.int32), self._joint.reversed[order], self._joint.head[order]
        )

    def _keep(self, makespan_s: float) -> None:
        """Note the makespan of the order as it is now."""
        self.makespan_s = makespan_s
        if makespan_s < self.best_s:
            self.best, self.best_s = self._stated(), self.makespan_s


def _joint_of(stated: StatedOrder, heads: int) -> JointOrder:
    n = len(stated.order)
    head, is_reversed = np.empty(n, np.int64), np.empty(n, np.bool_)
    head[stated.order], is_reversed[stated.order] = stated.head, stated.reversed
    made = JointOrder(
        stated.order.astype(np.int64), np.empty(n, np.int64), head, is_reversed,
        np.empty(n, np.int64), np.empty(n, np.int64),
    )  # fmt: skip
    link(made, heads)
    return made


def _marks(n: int, heads: TeamState) -> Marks:
    """Return marks that know only the beginning."""
    count = len(heads.free)
    marks = Marks(
        np.zeros(n + 1, np.int64), np.full((n + 1, count), NONE), np.zeros((n + 1, count)),
        np.empty((n + 1, count, 3)), np.empty((n + 1, count, 6)), np.zeros(1, np.int64),
        np.full((n + 1, count, count), NONE), np.zeros((n + 1, count)),
    )  # fmt: skip
    marks.at[0], marks.rest[0] = heads.at, heads.rest
    return marks


def _moves(problem: TeamProblem, eligible: Flags) -> PolishMoves:
    n = len(problem.macro)
    ends = problem.visits.ends.reshape(-1, 3) * [1.0, 1.0, LEVEL_MM]
    near = np.zeros((0, 1), np.int64)
    if n:
        near = cKDTree(ends).query(ends, min(NEAR + 2, 2 * n))[1] // 2
        own = near == np.arange(2 * n)[:, None] // 2
        near = np.take_along_axis(near, np.argsort(own, axis=1, kind="stable"), axis=1)[:, :NEAR]
    return PolishMoves(
        np.ascontiguousarray(near, np.int32), eligible,
        problem.graph.succ_offsets, problem.graph.succs,
        np.empty(RUN, np.int64), np.empty(n, np.int64),
    )  # fmt: skip


def _guide(problem: TeamProblem, eligible: Flags) -> Guide:
    n, heads = eligible.shape
    row = np.empty(n, np.int64)
    row[problem.column] = np.arange(n)
    keys = np.zeros((heads, n))
    policy = policy_of(problem, POLICIES[np.zeros(heads, np.int64)], keys, eligible)
    pool = new_pool(problem.visits, policy, heads)
    return Guide(POLICIES, problem.key_terms, row, policy, pool, np.zeros((2, n), np.int64))


def _differences(mine: StatedOrder, other: StatedOrder) -> Ints:
    """Return first turn and end of all windows of the same contours that differ, (k, 2)."""
    n = len(mine.order)
    turn = np.empty(n, np.int64)
    turn[other.order] = np.arange(n)
    cut = np.maximum.accumulate(turn[mine.order]) == np.arange(n)  # all before is the same set
    ends = np.flatnonzero(cut) + 1
    begins = np.concatenate([[0], ends[:-1]]).astype(np.int64)
    differs = (mine.order != other.order) | (mine.head != other.head)
    differs |= mine.reversed != other.reversed
    unlike = np.add.reduceat(differs, begins) > 0
    return np.ascontiguousarray(np.stack([begins, ends], axis=1)[unlike])
