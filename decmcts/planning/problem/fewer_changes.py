"""One head with several tools: an order with fewer changes of tools in place of the source's own.

Where changes follow one pattern (`formats.gcode.writing.fewer_changes`) they are no walls: each
tool prints as much as the head's shape and the rules of order allow before it is changed. The
source is written anew so. The judge looks at the file beside the source, and it is planned in its
place. A change that is not understood stays where it is.

With the tool in use all is printed that precedence allows, then the tool is taken with which most
can be printed. Of two tools no order that begins with the same one has fewer changes: whatever it
has printed by its k-th change, this one has printed too, by induction over k.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Int32s
from decmcts.errors import InputError
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.gcode.writing.fewer_changes import FreeChanges, free_changes, with_runs
from decmcts.formats.gcode.writing.parts import without_blocks
from decmcts.formats.mesh import is_mesh
from decmcts.planning.events import Note, Report, Step, unheard
from decmcts.planning.options import Rules
from decmcts.planning.problem.layer_by_layer import rewritten
from decmcts.planning.problem.planned import Planned, source_plan
from decmcts.planning.problem.print_problem import PrintProblem, parked_above, problem_of
from decmcts.planning.problem.source import Regrouped, Source
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.cooling import cooled, find_lags, source_times, time_left

LEAST_CHANGE_S = 5.0  # that a change of tools takes: fast tool changers, and two carriages


def with_fewer_changes(source: Source, rules: Rules, report: Report) -> Source:
    """Return the source with fewer changes of tools, or as it stands; the report is told why.

    It stands where one tool prints all of it.
    """
    if len(np.unique(source.job.contours.tool)) < 2 or is_mesh(source.path):
        return source
    found = _regrouped(source, rules, report)
    if isinstance(found, str):
        report(Note(f"changes of tools stay as they are: {found}"))
        return source
    return found


def _regrouped(source: Source, rules: Rules, report: Report) -> Source | str:
    """Return the source with fewer changes of tools, or in words why there is none."""
    job, document = source.job, source.document
    free = free_changes(document)
    if isinstance(free, str):
        return free
    report(Step("an order with fewer changes of tools"))
    loose, text = without_blocks(job, document, free.blocks)
    try:
        problem = problem_of(replace(source, job=loose, document=text), rules, report)
    except InputError as error:
        return str(error)
    tool = job.contours.tool
    runs = by_tool(
        problem.graph, tool, loose.contours.epoch, lambda a, b: (a, b) in free.of_pair
    )  # fmt: skip
    if runs is None:
        return "the source never changes between two tools that would follow each other"
    was, now = changes(tool), changes(tool[runs.order])
    if now >= was:
        return "no order that the rules allow has fewer" + (f" ({free.why})" if free.why else "")
    before = source_plan(problem).metrics
    times = source_times(problem.job, problem.machine, problem.graph)
    left_s = time_left(loose.contours, *times)
    waited_s = _waits(problem, runs.order, times, left_s)
    if waited_s > LEAST_CHANGE_S * (was - now):
        return f"with {was - now} changes less the print would wait {waited_s:.0f} s for cooling"
    return _written(source, free, runs, Regrouped(source, before, was - now, left_s))


def changes(tool: NDArray[np.int16]) -> int:
    """Return how often the tool changes in a sequence."""
    return int(np.count_nonzero(np.diff(tool)))


def _waits(
    problem: PrintProblem, order: Int32s, times: tuple[Floats, Floats], left_s: Floats,
) -> float:  # fmt: skip
    """Return how long an order waits for what is printed over to cool, s.

    `times` are those of the source's own order (`source_times`).
    """
    job, machine, graph = problem.job, problem.machine, problem.graph
    (lags,) = find_lags(job.contours, [times], problem.min_layer_time_s, left_s)
    as_it_is = Toolpath.of(order, np.zeros(len(order), np.bool_))
    return cooled(job, machine, graph, lags, as_it_is).waited_s


def _written(source: Source, free: FreeChanges, runs: ToolRuns, made_of: Regrouped) -> Source | str:
    """Write the source in an order of its tools and return it as it is read back."""
    order = runs.order
    tooled, document = with_runs(source.job, source.document, free, order, runs.run)
    machine = parked_above(source.machine, source.job.contours)
    found = rewritten(source, tooled, document, order, machine)
    if isinstance(found, str):
        return found
    made_of = replace(made_of, left_s=made_of.left_s[order])
    notes = found.job.notes
    if free.walls:
        one = free.walls == 1
        they = (
            "change of tools stays where it is" if one else "changes of tools stay where they are"
        )
        notes = (*notes, f"{free.walls} {they}: {free.why}")
    return replace(found, job=replace(found.job, notes=notes), regrouped=made_of)


def of_given(planned: Planned) -> Planned:
    """Return the own order of the source that was given, where another was made of it."""
    made_of = planned.problem.source.regrouped
    if made_of is None:
        return planned
    problem = problem_of(made_of.given, planned.problem.rules, unheard)
    return replace(planned, problem=problem, before=source_plan(problem))


def beside_given(planned: Planned) -> Planned:
    """Return a plan with the figures of the source that was given, not of what was made of it."""
    made_of = planned.problem.source.regrouped
    if made_of is None:
        return planned
    return replace(planned, before=replace(planned.before, metrics=made_of.before))


May = Callable[[int, int], bool]
"""Tells whether a tool may be changed for another."""
NONE = -1


@dataclass(frozen=True, slots=True)
class ToolRuns:
    """An order, and where its tools change."""

    order: Int32s  # (n,)
    run: Int32s  # (n,) by place in the order, never falling: one tool, within one stretch


def by_tool(
    graph: DependencyGraph, tool: NDArray[np.int16], stretch: Int32s, may: May
) -> ToolRuns | None:
    """Return an order with few changes of tools; None where no allowed change leads on.

    Each stretch begins and ends with the tool that it begins and ends with in the source. Within
    a run contours stand as in the source, as far as precedence allows. `tool` and `stretch`, (n,),
    are in the source's order, which keeps `graph`; `stretch` never falls. Takes
    O((n + edges) k log n) for k tools in use, for each change.
    """
    front = _Front.of(graph, tool)
    order, run, number = list[int](), list[int](), 0
    edges = [*np.flatnonzero(np.diff(stretch, prepend=-1)).tolist(), len(stretch)]
    for begin, end in pairwise(edges):
        front.enter(begin, end)
        now, last = int(tool[begin]), end - 1
        while len(order) < end:
            held = last if len(order) < last else NONE  # so the last is of the source's last tool
            mine = front.within_reach(now, held)
            if not mine:
                following = front.following(now, may, held)
                if following is None:
                    return None
                now, number = following, number + 1
                continue
            front.print(mine)
            order += mine
            run += [number] * len(mine)
        number += 1
    return ToolRuns(np.array(order, np.int32), np.array(run, np.int32))


@dataclass(slots=True)
class _Front:
    """What can be printed next, by tool."""

    succ_offsets: list[int]
    succs: list[int]
    tool: list[int]
    waits: list[int]  # of each contour how many it depends on are not printed
    ready: dict[int, set[int]]
    end: int = 0  # of the stretch

    @staticmethod
    def of(graph: DependencyGraph, tool: NDArray[np.int16]) -> _Front:
        """Return the front before anything is printed."""
        return _Front(
            graph.succ_offsets.tolist(), graph.succs.tolist(), tool.tolist(),
            np.diff(graph.pred_offsets).tolist(), {int(t): set() for t in np.unique(tool)},
        )  # fmt: skip

    def enter(self, begin: int, end: int) -> None:
        """Begin a stretch; mutates the front."""
        self.end = end
        for c in range(begin, end):
            if not self.waits[c]:
                self.ready[self.tool[c]].add(c)

    def within_reach(self, tool: int, held: int) -> list[int]:
        """Return all that can be printed with one tool alone, but for a contour that is held."""
        heap, less, found = sorted(self.ready[tool]), dict[int, int](), list[int]()
        while heap:
            c = heapq.heappop(heap)
            if c == held:
                continue
            found.append(c)
            for b in self._above(c):
                less[b] = less.get(b, 0) + 1
                if less[b] == self.waits[b] and self.tool[b] == tool and b < self.end:
                    heapq.heappush(heap, b)
        return found

    def following(self, now: int, may: May, held: int) -> int | None:
        """Return the tool with which most can be printed next; None: there is none."""
        reach = {t: len(self.within_reach(t, held)) for t in self.ready if t != now and may(now, t)}
        best = max(reach, key=lambda t: (reach[t], -t), default=None)
        return best if best is not None and reach[best] else None

    def print(self, contours: list[int]) -> None:
        """Take contours as printed; mutates the front."""
        for c in contours:
            for b in self._above(c):
                self.waits[b] -= 1
                if not self.waits[b] and b < self.end:
                    self.ready[self.tool[b]].add(b)
        for c in contours:
            self.ready[self.tool[c]].discard(c)

    def _above(self, c: int) -> list[int]:
        return self.succs[self.succ_offsets[c] : self.succ_offsets[c + 1]]
