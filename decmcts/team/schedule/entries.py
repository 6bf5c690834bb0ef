"""Where closed contours begin that several heads print: at first, and for agreed sequences.

Heads agree on sequences with every loop at a fixed entry (`first_entries`, `agreed_job`). Where
loops may begin anywhere, each head's own sequence then has its entries and directions
chosen by dynamic programming (`decmcts.search.sequence.entries_kernels`), so that the travels
within it cost least. A head that travels less may make another wait, so they are taken window by
window of the joint order, where the makespan falls. No sequence changes here.

**Biased** entries: a head is to release first what the heads beside it want. It releases its
reserved space while it prints a contour, and holds longest the space where the contour ends. A loop
ends where it begins. So where loops may begin anywhere their entries can be *biased*: all towards
one end of the machine, or each towards the end at which its own head stands.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Floats, Int32s
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.kinematics import line_up
from decmcts.print.lags_kernels import Lags
from decmcts.print.loops import as_run, rotated
from decmcts.print.machine import Machine
from decmcts.print.seam import SeamEntries, seam_entries
from decmcts.print.toolpath import Toolpath, entries_by_contour
from decmcts.search.sequence.entries_kernels import choose_visits
from decmcts.search.sequence.metric_kernels import with_points
from decmcts.search.sequence.pace import pace_of
from decmcts.search.sequence.problem import OrderProblem
from decmcts.team.engine.carry_out_kernels import OK, carry_out
from decmcts.team.engine.order import sequences_of, visits_along
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import first_policies_s
from decmcts.team.engine.space import fleet_of, printing_times

SHORTEST = 8  # contours of a window that is not halved any more


@dataclass(frozen=True, slots=True)
class OrderChoices:
    """What a search may choose in one head's order besides the sequence, and what it minimises."""

    freedom: str = "reversible"  # "fixed", "reversible" or "seam"
    seam: str = "nearest"  # with freedom "seam"
    objective: str = "travel"  # in mm, or "time" in s


def first_entries(job: PrintJob, orders: OrderChoices, alone: Toolpath) -> Int32s:
    """Return where each loop is entered while heads plan, (n,).

    A seam policy may name the vertex. With seam `nearest` it is where the order for one head
    alone enters the loop, for many neighbours in that order will be neighbours again. Else it
    is as sliced.
    """
    if orders.freedom == "seam" and orders.seam != "nearest":
        return seam_entries(job.contours, orders.seam).vertices  # type: ignore[arg-type]
    return entries_by_contour([alone], len(job.contours))


def entries_of(job: PrintJob, orders: OrderChoices) -> SeamEntries | None:
    """Return where loops may be entered; None: as sliced."""
    if orders.freedom != "seam":
        return None
    return seam_entries(job.contours, orders.seam)  # type: ignore[arg-type]


def agreed_job(job: PrintJob, orders: OrderChoices, entry: Int32s) -> PrintJob:
    """Return the print as heads plan it: loops entered there, nothing reversed if all is fixed."""
    contours = job.contours
    if orders.freedom == "fixed":
        none = np.zeros(len(contours), np.bool_)
        return replace(job, contours=replace(contours, reversible=none))
    if not entry.any():
        return job
    run, offsets = rotated(contours, entry)
    accelerations = None if job.acceleration is None else job.acceleration[run.rows]
    return replace(job, contours=as_run(contours, run, offsets), acceleration=accelerations)


def with_entries(toolpaths: Sequence[Toolpath], entry: Int32s) -> list[Toolpath]:
    """Return toolpaths for `agreed_job` as toolpaths for the job it is of."""
    return [replace(path, entry=entry[path.order]) for path in toolpaths]


def choose_entries(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    toolpaths: Sequence[Toolpath],
    orders: OrderChoices,
) -> list[Toolpath]:
    """Return the same sequences with the entries and directions for which travels cost least.

    A head begins and ends at its park; how it steps aside is not known here. Exact,
    O(n k²) for k entries of one contour. Seconds are by each head's own limits.
    """
    problem = OrderProblem.from_job(job, graph, orders.freedom, orders.seam)  # type: ignore[arg-type]
    chosen = []
    for head, toolpath in zip(machine.heads, toolpaths, strict=True):
        pace = pace_of(job, machine.limits_of(head)) if orders.objective == "time" else None
        chosen.append(_along(replace(problem, pace=pace), toolpath, np.array(head.park, float)))
    return chosen


def best_entries(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    toolpaths: Sequence[Toolpath],
    orders: OrderChoices,
    lags: Lags,
) -> list[Toolpath]:
    """Return agreed sequences with other entries and directions where the makespan falls.

    All that `choose_entries` changes is tried first, then halves of the joint order where
    that was no gain, and so on. Seams that a seam policy names stay, and nothing is tried if
    all is fixed.

    Parameters
    ----------
    toolpaths : Sequence[Toolpath]
        One a head, with turns, as agreed on.
    lags : Lags
        How long what is printed over must cool.
    """
    best = list(toolpaths)
    if orders.freedom == "fixed" or not len(job.contours):
        return best
    chosen = choose_entries(job, machine, graph, best, orders)
    estimate = makespan_estimate(job, machine, graph, lags)
    return window_by_window(best, chosen, len(job.contours), estimate)


def window_by_window(
    agreed: Sequence[Toolpath],
    chosen: Sequence[Toolpath],
    n: int,
    makespan: Callable[[Sequence[Toolpath]], float],
) -> list[Toolpath]:
    """Return agreed toolpaths with what was chosen in windows where the makespan falls by it.

    All n turns of the joint order are tried first, then halves of what was no gain.
    """
    best = list(agreed)
    best_s = makespan(best)
    windows = deque([(0, n)])
    trials = int(np.clip(500_000 // n, 15, 127))  # each takes time linear in n
    while windows and trials:
        begin, end = windows.popleft()
        tried = _within(best, chosen, begin, end)
        if not differ(tried, best):
            continue
        trials -= 1
        found_s = makespan(tried)
        if found_s < best_s:
            best, best_s = tried, found_s
        elif end - begin > SHORTEST:
            middle = (begin + end) // 2
            windows += [(begin, middle), (middle, end)]
    return best


def makespan_estimate(
    job: PrintJob, machine: Machine, graph: DependencyGraph, lags: Lags
) -> Callable[[Sequence[Toolpath]], float]:
    """Return a function that finds makespans of joint orders, by the estimate heads agree by.

    Infinite where heads shut each other in.
    """
    fleet, seconds = fleet_of(job, machine), printing_times(job, machine)

    def makespan(toolpaths: Sequence[Toolpath]) -> float:
        _, visits = visits_along(job, graph, machine, seconds, toolpaths, lags)
        units, verdict = carry_out(sequences_of(toolpaths), visits, fleet)
        return float(units.end[: units.used[0]].max(initial=0.0)) if verdict == OK else np.inf

    return makespan


def _within(
    one: Sequence[Toolpath], other: Sequence[Toolpath], begin: int, end: int
) -> list[Toolpath]:
    """Return the first toolpaths with entries and directions of the others in turns begin..end."""
    mixed = []
    for mine, theirs in zip(one, other, strict=True):
        turn = np.arange(len(mine)) if mine.turn is None else mine.turn
        inside = (turn >= begin) & (turn < end)
        mixed.append(
            replace(
                mine,
                reversed=np.where(inside, theirs.reversed, mine.reversed),
                entry=np.where(inside, theirs.entry, mine.entry).astype(np.int32),
            )
        )
    return mixed


def differ(one: Sequence[Toolpath], other: Sequence[Toolpath]) -> bool:
    """Tell whether toolpaths of the same sequences enter a contour elsewhere, or reverse one."""
    return any(
        (a.entry != b.entry).any() or (a.reversed != b.reversed).any()
        for a, b in zip(one, other, strict=True)
    )


def _along(problem: OrderProblem, toolpath: Toolpath, park: Floats) -> Toolpath:
    """Return one head's sequence, from its park and back, entered where it costs least."""
    order, k = toolpath.order, len(toolpath)
    if not k:
        return toolpath
    begins = np.arange(len(problem) + 1) if problem.seams is None else problem.seams.offsets
    count = np.diff(begins)[order]
    first = np.cumsum(count) - count
    possible = np.repeat(begins[order] - first, count) + np.arange(count.sum())
    ends = np.stack([problem.start, problem.end], axis=1)
    doors = ends
    if problem.seams is not None:
        doors = np.stack([problem.seams.enter, problem.seams.leave], axis=1)
    stop = np.broadcast_to(park, (1, 2, 3))
    points = np.concatenate([stop, ends[order], stop, stop, doors[possible], stop]).reshape(-1, 3)
    offsets = np.concatenate([[0, 1], 1 + np.cumsum(count), [2 + count.sum()]]).astype(np.int64)
    reversible = np.concatenate([[False], problem.reversible[order], [False]])
    reversible.setflags(write=False)  # as the problem's own: kernels are compiled once
    rows = np.arange(k + 2, dtype=np.int32)
    is_reversed, entry_id = choose_visits(
        with_points(problem.metric(), points), rows, reversible, offsets
    )
    entry = np.zeros(k, np.int32)
    if problem.seams is not None:
        at = np.where(entry_id[1:-1] >= 0, entry_id[1:-1] - 1, first)
        entry = np.ascontiguousarray(problem.seams.vertices[possible[at]], np.int32)
    return replace(toolpath, reversed=is_reversed[1:-1].astype(np.bool_), entry=entry)


def biased_entries(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    orders: OrderChoices,
    entry: Int32s,
    entries: SeamEntries | None,
    lags: Lags,
) -> Int32s:
    """Return where each loop is entered while heads plan: at `entry`, as sliced or biased, (n,).

    Of these the entries are taken with which the first policies reach the shortest makespan. It is
    `entry` where loops have no choice among `entries`, and where heads hold a contour's space to
    its end.
    """
    if entries is None or len(entries.vertices) == len(job.contours):
        return entry
    if machine.release != "point" or len(machine.heads) < 2:
        return entry

    def entered(chosen: Int32s) -> TeamProblem:
        return build_team_problem(agreed_job(job, orders, chosen), machine, graph, lags)

    usual = entered(entry)
    others = [np.zeros_like(entry), *_biased(job, usual, entries)]
    others = [other for other in others if (other != entry).any()]
    makespans = [first_policies_s(usual), *(first_policies_s(entered(other)) for other in others)]
    return (entry, *others)[int(np.argmin(makespans))]


def _biased(job: PrintJob, problem: TeamProblem, entries: SeamEntries) -> Iterator[Int32s]:
    """Yield entries biased apart, to the low end of the machine, and to the high one."""
    axis, _ = line_up(problem.machine)
    loop = entries.contour()
    at = job.contours.points[job.contours.offsets[loop] + entries.vertices, axis]
    low = problem.quantile < 0.5
    for towards_low in (low, np.ones_like(low), np.zeros_like(low)):
        row = np.lexsort((np.where(towards_low[loop], at, -at), loop))
        yield entries.vertices[row[entries.offsets[:-1]]]
