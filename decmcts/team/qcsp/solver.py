"""Bare team problems: cranes on one rail, a schedule of least makespan.

Two threads anneal, in rounds. In most rounds all cranes sweep along the rail one
way, and tasks are only handed from crane to crane. Such unidirectional schedules are
optimal or nearly so on all published instances, and few enough to be searched well.
One such round is hot, since small steps at low temperatures do not lead away from a
schedule in which cranes wait for each other in turn; the next is warm. Every third
round anneals order and cranes of the best schedule freely. In every other cycle of three
rounds both threads sweep in the direction that did better, else one in each direction.
Rounds grow longer, so that little is lost where the time is short.

References
----------
Bierwirth & Meisel 2009 (unidirectional schedules); Meisel & Bierwirth 2011 (the
instances).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.formats.bare.qcsp import QcspProblem, QcspSchedule
from decmcts.print.brief import brief
from decmcts.random_kernels import seeded
from decmcts.search.sequence.stopping import Progress, Stopping
from decmcts.team.qcsp.bound import least_makespan
from decmcts.team.qcsp.paths import paths_of
from decmcts.team.qcsp.solver_kernels import (
    CraneProblem,
    CraneSchedule,
    anneal_schedule,
    decode,
    find_loads,
)

_HOT, _WARM, _COLD = 0.03, 0.008, 0.0005  # temperatures, shares of the makespan
_FIRST_ROUND = 20_000  # proposals of each thread
_LONGEST_ROUND = 4_000  # for each task: several such end in better schedules than a longer one
_SLICE = 10_000  # proposals between looks at the clock, at most
_SLICE_WORK = 10_000_000  # tasks times cranes of them
_ROUNDS = 3  # of one length: a hot sweep, a warm one, and one that moves tasks in the order too
_THREADS = 2  # that anneal at once


@dataclass(frozen=True, slots=True)
class QcspResult:
    """The best schedule found, and what is proven of it."""

    schedule: QcspSchedule
    bound: float  # no schedule ends earlier
    proposals: int
    history: Floats  # (k, 3) seconds, proposals, makespan at each improvement
    seed: int

    @property
    def order(self) -> NDArray[np.intp]:
        """Tasks in the order in which they begin, (n,)."""
        return np.argsort(self.schedule.begin, kind="stable")

    @property
    def assignments(self) -> Int32s:
        """Which crane does each task, (n,)."""
        return self.schedule.crane

    __repr__ = brief("schedule", "bound", "proposals")

    @property
    def optimal(self) -> bool:
        """Whether no schedule can end earlier."""
        return self.bound >= self.schedule.makespan


@dataclass(slots=True)
class _Goal:
    """A makespan that ends a round, and which threads reached it after how many proposals.

    A thread that has not reached it goes on until it has made as many proposals as the one that
    has. Of all threads that have reached it by then the first one counts. So the result does not
    depend on which thread is faster.
    """

    makespan: float
    reached: list[tuple[int, int]] = field(default_factory=list)  # proposals, thread; all append

    def is_open(self, made: int) -> bool:
        """Say whether a thread that made so many proposals may still be first."""
        return all(made < other for other, _ in self.reached)


@dataclass(slots=True)
class _Thread:
    """One thread's schedules."""

    number: int
    problem: CraneProblem
    sweep: Int32s  # (n,) tasks along the rail
    rightward: bool
    schedule: CraneSchedule
    best: tuple[Int32s, Int32s]  # order and cranes
    state: NDArray[np.uint64]  # (1,) mutated
    slice: int  # proposals between looks at the clock
    least: float = np.inf  # makespan of its best sweep

    def anneal(
        self, proposals: int, warmest: float, coldest: float, *, free: bool,
        go_on: Callable[[], bool], goal: _Goal,
    ) -> int:  # fmt: skip
        """Anneal once, from the schedule at hand; return how many proposals were made.

        Ends early, and tells the others so, once a schedule reaches the goal.
        """
        costs = np.full(3, np.inf)
        sweep = self.sweep[:0] if free else self.sweep
        made = 0
        while made < proposals and goal.is_open(made) and go_on():
            more = min(self.slice, proposals - made)
            warm, cold = (
                warmest * (coldest / warmest) ** (at / proposals) for at in (made, made + more)
            )
            anneal_schedule(
                self.problem, self.schedule, self.best, costs, sweep, self.rightward, self.state,
                (warm, cold), more,
            )  # fmt: skip
            made += more
            if costs[1] <= goal.makespan:
                goal.reached.append((made, self.number))
        return made

    def go_to(self, order: Int32s, crane: Int32s) -> None:
        """Go on from this order and these cranes; the times are found later."""
        self.schedule.order[:], self.schedule.crane[:] = order, crane

    def makespan(self) -> float:
        """Return the makespan of the last round's best schedule, which `schedule` becomes."""
        self.go_to(*self.best)
        find_loads(self.problem, self.schedule)
        decode(self.problem, self.schedule, np.inf)
        return float(self.schedule.end.max())


def search_qcsp(
    problem: QcspProblem,
    *,
    stopping: Stopping,
    seed: int = 0,
    clock: Callable[[], float] = time.monotonic,
    target: float = 0.0,
    progress: Callable[[Progress], None] | None = None,
) -> QcspResult:
    """Find a schedule of small makespan, on two threads.

    Equal seeds and equal limits of iterations give equal results, provided nothing else
    ends the search. Ends early when the result is proven optimal.

    Parameters
    ----------
    stopping : Stopping
        What ends the search; iterations are the moves proposed, of both threads together.
    clock : Callable[[], float]
        Seconds; only differences matter. Threads ask it at the same time.
    target : float
        A makespan that is good enough: the search ends once it is reached.
    progress : Callable[[Progress], None] | None
        Told after every round where the search stands.
    """
    search = _CraneSearch(problem, stopping, clock, seed, target, progress)
    if len(problem):
        search.run()
    return search.result()


class _CraneSearch:
    """Rounds of annealing and the best schedule of all."""

    def __init__(
        self,
        problem: QcspProblem,
        stopping: Stopping,
        clock: Callable[[], float],
        seed: int,
        target: float,
        progress: Callable[[Progress], None] | None,
    ) -> None:
        self.problem, self.seed, self._stopping = problem, seed, stopping
        self._clock, self._began, self._progress = clock, clock(), progress
        self._bound = least_makespan(problem)
        self._goal = max(target, self._bound)
        self._threads = list(_threads_of(problem, seed))
        self._best = self._threads[0].schedule
        self._makespan = np.inf if len(problem) else 0.0
        self._proposals = 0
        self._history: list[tuple[float, int, float]] = []

    def run(self) -> None:
        """Anneal until there is no time left, or nothing better."""
        for thread in self._threads:  # whatever the limits are, there is a schedule
            thread.anneal(1, 1.0, 1.0, free=False, go_on=lambda: True, goal=_Goal(self._goal))
            self._offer(thread)
        turn, length, speed = 0, _FIRST_ROUND, 0.0
        longest = max(length, _LONGEST_ROUND * len(self.problem))
        with ThreadPoolExecutor(_THREADS) as pool:
            while self._may_go_on() and self._makespan > self._goal:
                kind = turn % _ROUNDS
                round_ = self._length(length, speed)
                began = self._seconds()
                self._round(
                    pool, self._at_work(turn // _ROUNDS), round_,
                    warmest=_HOT if kind == 0 else _WARM, free=kind == _ROUNDS - 1,
                )  # fmt: skip
                speed = round_ / max(self._seconds() - began, 1e-6)
                turn += 1
                length = length if turn % _ROUNDS else min(2 * length, longest)

    def _at_work(self, cycle: int) -> list[_Thread]:
        """Return a thread of each direction, every other time two of the better one."""
        first, second = self._threads[:2], self._threads[2:]
        if cycle % 2 == 0:
            return first
        better = int(np.argmin([min(a.least, b.least) for a, b in zip(first, second, strict=True)]))
        return [first[better], second[better]]

    def result(self) -> QcspResult:
        """Return the best schedule with the paths of all cranes."""
        crane, begin = self._best.crane.copy(), self._best.begin.copy()
        paths = paths_of(self.problem, crane, begin)
        schedule = QcspSchedule(crane, begin, paths, float(self._makespan))
        history = np.array(self._history, np.float64).reshape(-1, 3)
        bound = min(self._bound, schedule.makespan)
        return QcspResult(schedule, bound, self._proposals, history, self.seed)

    def _round(
        self, pool: ThreadPoolExecutor, threads: list[_Thread], proposals: int, *, warmest: float,
        free: bool,
    ) -> None:  # fmt: skip
        """Let threads anneal once, side by side, and keep what is better."""
        scale = float(self._makespan)
        own = [(thread.schedule.order.copy(), thread.schedule.crane.copy()) for thread in threads]
        if free:
            for thread in threads:
                thread.go_to(self._best.order, self._best.crane)
        goal = _Goal(self._goal)
        works = [
            pool.submit(
                thread.anneal, proposals, scale * warmest, scale * _COLD, free=free,
                go_on=self._may_go_on, goal=goal,
            )
            for thread in threads
        ]  # fmt: skip
        made = [work.result() for work in works]
        if goal.reached:
            first, number = min(goal.reached)
            self._proposals += first * len(threads)
            self._offer(self._threads[number])
        else:
            self._proposals += sum(made)
            self._keep(threads, own, free=free)
        if self._progress is not None:
            improved = self._history[-1][0] if self._history else 0.0
            cost = float(self._makespan)
            self._progress(Progress(self._seconds(), self._proposals, cost, improved, self._bound))

    def _keep(
        self,
        threads: list[_Thread],
        own: list[tuple[Int32s, Int32s]],
        *,
        free: bool,
    ) -> None:
        """Take what is better; after a free round threads go on from the sweep they had, `own`."""
        for thread, (order, crane) in zip(threads, own, strict=True):
            makespan = self._offer(thread)
            if not free:
                thread.least = min(thread.least, makespan)
            else:
                thread.go_to(order, crane)

    def _offer(self, thread: _Thread) -> float:
        """Take the thread's last result if it is better; return its makespan."""
        makespan = thread.makespan()
        if makespan < self._makespan:
            self._makespan = makespan
            self._best = CraneSchedule._make(array.copy() for array in thread.schedule)
            self._history.append((self._seconds(), self._proposals, makespan))
        return makespan

    def _length(self, length: int, speed: float) -> int:
        """Return the proposals of the next round: `length`, or all that are left if few are."""
        limit, left = self._stopping, np.inf
        if limit.seconds is not None and speed > 0.0:
            left = (limit.seconds - self._seconds()) * speed
        if limit.iterations is not None:
            left = min(left, (limit.iterations - self._proposals) // _THREADS)
        return max(1, int(left)) if left < 1.5 * length else length

    def _may_go_on(self) -> bool:
        """Say whether there is time, and a proposal left for each thread."""
        return not self._stopping.ends(self._seconds(), self._proposals + _THREADS - 1)

    def _seconds(self) -> float:
        return self._clock() - self._began


def _threads_of(problem: QcspProblem, seed: int) -> Iterator[_Thread]:
    """Yield threads to the right and left in turn, the work shared out evenly along the rail."""
    arrays, depth = _arrays_of(problem)
    n, q = len(problem), problem.cranes
    looks = max(1, min(_SLICE, _SLICE_WORK // max(1, n * q)))  # rarer where proposals are quick
    for thread in range(2 * _THREADS):
        rightward = thread % 2 == 0
        along = arrays.bay if rightward else -arrays.bay
        sweep = np.lexsort((np.arange(n), depth, along)).astype(np.int32)
        work = problem.duration[sweep]
        share = (np.cumsum(work) - work / 2) * q / max(float(work.sum()), 1e-300)
        rank, crane = np.minimum(share.astype(np.int32), q - 1), np.zeros(n, np.int32)
        crane[sweep] = rank if rightward else q - 1 - rank
        schedule = CraneSchedule(
            sweep.copy(), crane, np.zeros(n), np.zeros(n),
            np.empty((q, arrays.bays)), np.empty((q, arrays.bays)),
            np.zeros(q, np.int32), np.zeros(q), np.zeros(q), np.zeros(q),
        )  # fmt: skip
        best = sweep.copy(), crane.copy()
        state = seeded(seed * 2 * _THREADS + thread)
        yield _Thread(thread, arrays, sweep, rightward, schedule, best, state, looks)


def _arrays_of(problem: QcspProblem) -> tuple[CraneProblem, Ints]:
    """Return the problem as kernels take it, and how many tasks come before each."""
    n = len(problem)
    before = np.zeros((n, n), np.bool_)
    before[problem.precedence[:, 0], problem.precedence[:, 1]] = True
    for k in range(n):
        before |= before[:, [k]] & before[[k], :]
    counts = before.astype(np.float32)
    direct = before & ~(counts @ counts > 0.0)
    preds, succs = np.nonzero(direct.T), np.nonzero(direct)
    lowest = int(min(problem.bay.min(initial=problem.start[0]), problem.start.min()))
    bays = int(max(problem.bay.max(initial=0), problem.start.max())) - lowest + 1
    arrays = CraneProblem(
        problem.duration,
        problem.bay - np.int32(lowest),
        np.append(0, np.cumsum(direct.sum(axis=0))).astype(np.int32),
        preds[1].astype(np.int32),
        np.append(0, np.cumsum(direct.sum(axis=1))).astype(np.int32),
        succs[1].astype(np.int32),
        before,
        problem.ready,
        problem.start - np.int32(lowest),
        problem.travel,
        problem.spacing,
        bays,
    )
    return arrays, before.sum(axis=0)
