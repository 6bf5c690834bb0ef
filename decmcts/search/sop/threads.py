"""Beam search, annealing and branch and bound on two threads, and when one replaces another.

Work comes in slices. Within a slice the threads share nothing. Between slices, on the
calling thread, what was found is offered to the incumbent, and a thread may get another
search. So results depend only on the seed and the sizes of the slices, and not on which
thread is faster.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.random_kernels import seeded
from decmcts.search.sequence.incumbent import Incumbent
from decmcts.search.sequence.metric_kernels import Matrix
from decmcts.search.sequence.stopping import next_chunk
from decmcts.search.sop.annealing import (
    FIRST,
    LEAST,
    EliteAnnealer,
    LubyAnnealer,
    NearSteps,
)
from decmcts.search.sop.assignment import Assignment, AssignmentTree, assign
from decmcts.search.sop.beam import Beam
from decmcts.search.sop.joint import JointAnnealing, JointThread
from decmcts.search.sop.precedence import Precedence
from decmcts.search.sop.windows import WindowAnnealer

_SLICE_S = 0.15
_SLICES = 400  # of a search that is limited by iterations
_LEAST_SLICE, _LARGEST_SLICE = 1000, 4_000_000  # iterations
_HANDICAP = 4  # the beam from the worse end is so many times narrower
_CHANGES = (  # shares spent; lead annealing needs over beams; gap the tree may keep working on
    (0.08, np.inf, 0.02),
    (0.2, 0.005, 0.005),
    (0.4, 0.005, 0.0),
)
_NEAR_ENOUGH = 0.08  # share by which the first annealing may lie above beams
_ELITE_LEAD = 8  # times the lead, where elites are made of what beams found too
_BEFORE_WINDOWS = 0.5  # share of what is left of the budget for a last, long annealing
_LARGEST_TREE = 1500  # nodes; beyond, one assignment takes seconds


@dataclass(slots=True)
class BeamThread:
    """Beams from one end or both; the one that found less goes on narrower."""

    beams: list[Beam]
    bound: float  # what to add to reduced costs
    least_gain: float  # costs differ by more than this
    best: float = np.inf  # cost of the best sequence this thread has found
    exhausted: bool = False  # nothing better is left
    below: float = np.inf  # sequences have to cost less
    _found: list[Ints] = field(default_factory=list)  # since the last meeting
    _bests: list[float] = field(default_factory=list)  # by beam

    def __post_init__(self) -> None:
        self._bests = [np.inf for _ in self.beams]

    def work(self, quota: int, spent: float) -> int:
        """Step the beams whose turn it is; return how many partial sequences were looked at."""
        seen = 0
        while seen < quota and not self.exhausted:
            turn = self._turn()
            beam = self.beams[turn]
            seen += beam.step(quota - seen, self.below - self.bound - self.least_gain)
            self.exhausted = beam.exhausted
            if beam.found is not None:
                cost = beam.found_cost + self.bound
                self._bests[turn] = min(self._bests[turn], cost)
                self.best, self.below = min(self.best, cost), min(self.below, cost)
                self._found.append(beam.found)
        return seen

    def meet(self, incumbent: Incumbent) -> None:
        """Offer what runs have found; from now on look below the incumbent only."""
        for order in self._found:
            incumbent.offer(order.astype(np.int32), incumbent.reversed, by="beam")
        self._found = []
        self.below = min(self.below, incumbent.cost)

    def _turn(self) -> int:
        """Return which beam goes on: the narrowest, with a handicap for the worse."""
        least = min(self._bests)
        widths = [
            beam.width * (_HANDICAP if best > least else 1)
            for beam, best in zip(self.beams, self._bests, strict=True)
        ]
        return int(np.argmin(widths))


@dataclass(slots=True)
class TreeThread:
    """Branch and bound over assignments; the relaxed sequences are repaired."""

    tree: AssignmentTree
    costs: Floats  # (n, n)
    bound: float  # what to add to reduced costs
    least_gain: float
    below: float = np.inf
    _found: Int32s | None = None

    @property
    def exhausted(self) -> bool:
        """Whether nothing better is left."""
        return self.tree.exhausted

    def work(self, quota: int, spent: float) -> int:
        """Branch; an assignment counts as n² / 4 iterations, about the time it takes."""
        unit, made = max(len(self.costs) ** 2 // 4, 1), self.tree.made
        while (self.tree.made - made) * unit < quota:
            relaxed = self.tree.step(self.below - self.bound - self.least_gain)
            if relaxed is None:
                break
            order = self.tree.precedence.repaired(relaxed)
            cost = float(self.costs[order[:-1], order[1:]].sum())
            if cost < self.below:
                self.below, self._found = cost, order
        return 1 + (self.tree.made - made) * unit

    def meet(self, incumbent: Incumbent) -> None:
        """Offer the best repaired sequence; from now on look below the incumbent only."""
        if self._found is not None:
            incumbent.offer(self._found, incumbent.reversed, by="assignments")
            self._found = None
        self.below = min(self.below, incumbent.cost)


@dataclass(slots=True)
class TurnsThread:
    """Annealing by Luby's lengths and annealing by elites, in alternate slices.

    Elites find more on most problems without distances, but may all lie beside the best
    sequence; on small ones annealings that know nothing of each other then find it.
    """

    annealers: tuple[LubyAnnealer, EliteAnnealer]
    _turn: int = 0

    @property
    def best(self) -> float:
        """Least cost seen where the temperature changes."""
        return min(annealer.best for annealer in self.annealers)

    def work(self, quota: int, spent: float) -> int:
        """Let one of the two work."""
        self._turn ^= 1
        return self.annealers[self._turn].work(quota, spent)

    def meet(self, incumbent: Incumbent) -> None:
        """Let both offer what they found, and hear of a better sequence."""
        for annealer in self.annealers:
            annealer.meet(incumbent)


SopThread = (
    BeamThread
    | LubyAnnealer
    | EliteAnnealer
    | TurnsThread
    | WindowAnnealer
    | JointThread
    | TreeThread
)


@dataclass
class TwoThreads:
    """One problem's three searches, and the rules by which they share two threads."""

    incumbent: Incumbent
    precedence: Precedence
    assignment: Assignment
    seed: int
    least_gain: float  # costs differ by more than this

    def run(self) -> float:
        """Mutate the incumbent until the budget is spent or it is optimal; return a bound."""
        incumbent, pace = self.incumbent, _SliceSizes.of(self.incumbent)
        changes, bound = list(_CHANGES), self.assignment.bound
        threads = self._first_threads()
        with ThreadPoolExecutor(len(threads)) as pool:
            while True:
                incumbent.tick(pace.slice(pool, threads, incumbent))
                for thread in threads:
                    thread.meet(incumbent)
                bound = max(bound, *map(self._bound, threads))
                if incumbent.cost - bound < self.least_gain:
                    return incumbent.cost
                if incumbent.over:
                    return bound
                if changes and incumbent.spent >= changes[0][0]:
                    _, lead, gap = changes.pop(0)
                    threads = self._handed_over(threads, lead, cost_above=(1.0 + gap) * bound)
                threads = [self._in_windows(thread) for thread in threads]

    def _first_threads(self) -> list[SopThread]:
        """Return both threads: one long annealing of large problems, else beams and a tree."""
        large = len(self.costs) > _LARGEST_TREE
        if large and self.steps.are_distances:
            joint = JointAnnealing.of(
                self.steps.bare(self.costs, self.incumbent.problem.graph),
                scale=self.steps.scale, seed=2 * self.seed, incumbent=self.incumbent,
            )  # fmt: skip
            return list(joint.sides)
        return [self._beams(), self._annealer(0) if large else self._tree()]

    @cached_property
    def steps(self) -> NearSteps:
        """Near nodes and what temperatures go by, found when first asked for."""
        reduced, possible = self.assignment.reduced, self.precedence.possible
        return NearSteps.of(self.costs, reduced, possible, least=self.least_gain)

    @property
    def costs(self) -> Floats:
        """Return the real costs, (n, n)."""
        metric = self.incumbent.metric
        assert isinstance(metric, Matrix)
        return metric.costs

    def _bound(self, thread: SopThread) -> float:
        """Return what a thread has proven: no sequence costs less."""
        if isinstance(thread, BeamThread | TreeThread) and thread.exhausted:
            return self.incumbent.cost
        if isinstance(thread, TreeThread):
            return min(self.assignment.bound + thread.tree.bound, self.incumbent.cost)
        return -np.inf

    def _handed_over(
        self, threads: list[SopThread], lead: float, *, cost_above: float
    ) -> list[SopThread]:
        """Return the threads, with annealing in the place of a tree or beams that do not pay.

        Beams have to be behind by `lead`, since they find most towards the end. A long
        annealing shows what it finds at its end only; there a short one before it has to
        come near the beams. The tree stays while the cost is not above `cost_above`.
        """
        beams, other, cost = *threads, self.incumbent.cost
        if isinstance(beams, BeamThread):
            if isinstance(other, LubyAnnealer) and other.is_last and np.isfinite(lead):
                cost, lead = other.first_cost, -_NEAR_ENOUGH
            elif isinstance(other, TurnsThread):
                lead *= _ELITE_LEAD
            if (1.0 + lead) * cost < beams.best:
                beams = self._annealer(1)
        if isinstance(other, TreeThread) and self.incumbent.cost > cost_above:
            other = self._annealer(0)
        return [beams, other]

    def _in_windows(self, thread: SopThread) -> SopThread:
        """Return the thread, with annealing in windows in the place of one that is over."""
        spent = self.incumbent.spent
        if not (isinstance(thread, LubyAnnealer) and thread.over(spent)):
            return thread
        return WindowAnnealer.after(thread, self.incumbent)

    def _tree(self) -> TreeThread:
        """Return a thread of branch and bound."""
        table = np.where(self.precedence.possible, self.assignment.reduced, np.inf)
        tree = AssignmentTree(table, self.precedence)
        thread = TreeThread(tree, self.costs, self.assignment.bound, self.least_gain)
        thread.meet(self.incumbent)
        return thread

    def _beams(self) -> BeamThread:
        """Return a thread of beams from both ends.

        Prices are not unique; each end is best served by those worked out from there.
        """
        costs, possible = self.costs, self.precedence.possible
        mirrored = assign(np.ascontiguousarray(costs.T[::-1, ::-1]), possible.T[::-1, ::-1])
        prices = (self.assignment.reduced, mirrored.reduced.T[::-1, ::-1])
        beams = [
            Beam(reduced, self.precedence, self.seed, backward=backward)
            for backward, reduced in zip((False, True), prices, strict=True)
        ]
        thread = BeamThread(beams, self.assignment.bound, self.least_gain)
        thread.meet(self.incumbent)
        return thread

    def _annealer(self, number: int) -> LubyAnnealer | EliteAnnealer | TurnsThread:
        """Return a thread that anneals from the best sequence; its number: 0, or 1 for long ones.

        Where costs are no distances it goes by elites, and thread 0 by both.
        """
        steps, long, state = self.steps, number > 0, seeded(2 * self.seed + number)
        graph = self.incumbent.problem.graph

        def luby(last_share: float) -> LubyAnnealer:
            made = LubyAnnealer(
                bare=steps.bare(self.costs, graph), state=state, scale=steps.scale, long=long,
                last_share=last_share,
            )  # fmt: skip
            made.begin(self.incumbent, FIRST)
            return made

        if steps.are_distances:
            return luby(_BEFORE_WINDOWS)
        elites = EliteAnnealer(
            bare=steps.bare(self.costs, graph), state=state, steps=steps,
            least_gain=self.least_gain, long=long,
        )  # fmt: skip
        elites.begin(self.incumbent, LEAST)
        return elites if long else TurnsThread((luby(0.0), elites))


@dataclass(slots=True)
class _SliceSizes:
    """How large the slices are: about equally long, or a set share of the iterations."""

    quotas: list[int]
    timed: bool

    @staticmethod
    def of(incumbent: Incumbent) -> _SliceSizes:
        limit = incumbent.stopping.iterations
        share = 20_000 if limit is None else max(limit // (2 * _SLICES), 1)
        return _SliceSizes([min(share, _LARGEST_SLICE)] * 2, limit is None)

    def slice(
        self, pool: ThreadPoolExecutor, threads: list[SopThread], incumbent: Incumbent
    ) -> int:
        """Let each thread work once; return the iterations made."""
        spent = incumbent.spent

        def work(thread: int) -> int:
            began = incumbent.seconds
            made = threads[thread].work(self.quotas[thread], spent)
            if self.timed:
                self.quotas[thread] = next_chunk(
                    made, incumbent.seconds - began, _SLICE_S,
                    least=_LEAST_SLICE, most=_LARGEST_SLICE,
                )  # fmt: skip
            return made

        return sum(pool.map(work, range(len(threads))))
