"""The rest of a print that was broken off, planned anew for the heads that live.

The rest is written as a source of its own, read back, and planned in its place as any source is;
what is printed stands on the bed from the beginning: all travels clear it, and the judge looks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from decmcts.arrays import Flags
from decmcts.errors import InputError
from decmcts.formats.gcode import GcodeDocument, read_gcode
from decmcts.formats.gcode.writing.parts import Stretch, with_stretches
from decmcts.formats.gcode.writing.tools_left import printed_with, with_tool_left
from decmcts.planning.compiling import compilation_reported
from decmcts.planning.events import Report, Step, Stop, never, unheard
from decmcts.planning.launch import launched
from decmcts.planning.options import Cut, Rules, TeamSearch
from decmcts.planning.problem.layer_by_layer import write_order
from decmcts.planning.problem.made_from import source_of
from decmcts.planning.problem.own_tools import one_tool_each, team_problem
from decmcts.planning.problem.planned import require_passed
from decmcts.planning.problem.print_problem import PrintProblem, parked_above
from decmcts.planning.problem.slicing import SlicedFolder
from decmcts.planning.problem.source import Source
from decmcts.planning.replanning.fenced import (
    OPTION,
    living_machine,
    needed,
    refuse_other_diameters,
    slowed,
)
from decmcts.planning.replanning.park_files import ParkFile, park_files, park_paths
from decmcts.planning.replanning.rest import (
    Able,
    Broken,
    LeftBeads,
    LeftOut,
    broken_beads,
    left_out,
    printed_contours,
    stretches_left,
)
from decmcts.planning.result import Result
from decmcts.planning.team.pipeline import Launch
from decmcts.print.brief import brief
from decmcts.print.contours import Contours, taken
from decmcts.print.job import PrintJob
from decmcts.print.machine import Fenced, Machine, Stands
from decmcts.print.plan import OrderRules, PlanDocument
from decmcts.print.print_state import PrintState
from decmcts.team.engine.alone import lone_machine
from decmcts.team.engine.space import able_heads
from sim.content.rest import check_rest
from sim.faults import Verdict

ROUNDED_MM, ROUNDED_E_MM = 1.5e-3, 1e-4  # of what is written and read back
HOMES = (
    "the start code is run once more: see that it neither homes over what is printed nor drives "
    "into it"
)


@dataclass(frozen=True, slots=True)
class Rest:
    """What is left of a print, ready to be planned."""

    source: Source  # it alone, for the heads that live; its path is a draft, gone with it
    left: LeftOut
    broken: tuple[Broken, ...]
    done: int  # contours of the plan that are printed, or broken off
    missing: str = ""  # what no living head can finish, in words
    print_with: tuple[tuple[int, int], ...] = ()  # tools, and those that print for them
    others: tuple[str, ...] = ()  # what is printed with another tool, in words
    to_park: tuple[ParkFile, ...] = ()  # take heads that stand elsewhere there, in this order

    __repr__ = brief("source", "done", "broken", "missing")

    @property
    def lines(self) -> list[str]:
        """A line for whatever is not as the whole print would be."""
        finished = [
            f"{_broke(one)}: its last {one.missing_mm:.1f} mm are printed"
            for one in self.broken if self._is_finished(one)
        ]  # fmt: skip
        return [*self.others, *self.unfinished, *finished, *self._to_park()]

    @property
    def unfinished(self) -> list[str]:
        """A line for whatever is missing."""
        found = [self.missing] if self.missing else []
        return found + [
            f"{_broke(one)}: the last {one.missing_mm:.1f} mm at most of it are missing"
            for one in self.broken if not self._is_finished(one)
        ]  # fmt: skip

    def _to_park(self) -> list[str]:
        """Return a line on what is to be run before the files of the rest."""
        if not self.to_park:
            return []
        stem = Path("STEM")
        names = ", ".join(path.name for path in park_paths(self.to_park, stem))
        several = " one after another" if len(self.to_park) > 1 else ""
        return [
            f"heads away from their parks: before the files of the rest run {names},{several} in "
            "this order, each when the one before has ended"
        ]

    def _is_finished(self, one: Broken) -> bool:
        return bool(one.rest) and not self.left.rows[one.contour]


def _broke(one: Broken) -> str:
    return f"head {one.head} broke off within contour {one.contour}"


def rest_of(
    document: PlanDocument,
    source: Source,
    state: PrintState,
    fenced: Mapping[str, Stands],
    left_beads: LeftBeads = LeftBeads.LEAVE,
    report: Report = unheard,
    slower: Mapping[str, float] | None = None,
    print_with: Mapping[int, int] | None = None,
) -> Rest:
    """Return what is left of a print, for heads that are not `fenced` where they stand.

    `slower` heads take so many times as long as planned. `print_with` has tools, and those that
    print for them where no living head has them (`other_tools`). Raises InputError for another
    source, where no head lives, where nothing is left that one can print, and where another tool
    cannot print for one, VerificationError where what is written of the rest is not what is
    left of the print.
    """
    with _named(source.path):
        return _rest_of(
            document, source_of(document, source), state, fenced, left_beads, report, slower or {},
            print_with or {},
        )  # fmt: skip


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Name a print in an InputError raised in the body that names a draft made of it."""
    try:
        yield
    except InputError as error:
        if error.path in (None, str(path)):
            raise
        raise InputError(error.what, path=path, advice=error.advice) from error


def _rest_of(
    document: PlanDocument, source: Source, state: PrintState, fenced: Mapping[str, Stands],
    left_beads: LeftBeads, report: Report, slower: Mapping[str, float],
    print_with: Mapping[int, int],
) -> Rest:  # fmt: skip
    job = source.job
    broken = broken_beads(document, job, state, left_beads)
    left_open = ~state.done
    left_open[[one.contour for one in broken if one.rest]] = True
    whole, at = document.machine, dict(fenced)
    if document.fenced is not None:
        whole, at = document.fenced.machine, {**document.fenced.at, **at}
    whole = slowed(whole, slower)
    machine = living_machine(whole, at, document.contours)
    other = needed(print_with, machine, document.contours)
    left = left_out(document, left_open, _able(job, machine, other, document.contours))
    rows = left_open & ~left.rows
    stretches = _to_print(document, job, rows, broken, partial(_able, job, machine, other))
    if not stretches:
        raise InputError(left.stated(document.contours) or "nothing is left to print")
    others = _with_others(document, source, rows, other)
    anew = _written(source, machine, stretches, other, report)
    printed = printed_contours(document, job, state, broken)
    pairs = tuple(other.items()) if others else ()
    alone = replace(
        anew.job, name=job.name, printed=printed, fenced=Fenced(whole, at) if at else None,
        print_with=pairs,
    )  # fmt: skip
    gone = taken(document.contours, np.flatnonzero(left.rows))
    require_passed(Verdict(check_rest(alone.contours, printed, document, dict(pairs), gone).faults))
    done, missing = int(state.done.sum()), left.stated(document.contours)
    with compilation_reported(report) as reporting:
        reporting(Step("paths of heads to their parks"))
        to_park = park_files(document, source, state, whole, at)
    anew = replace(anew, job=alone)
    return Rest(anew, left, tuple(broken), done, missing, pairs, tuple(others), to_park)


def _able(job: PrintJob, machine: Machine, other: Mapping[int, int], contours: Contours) -> Flags:
    """Tell which contours some head of a machine can print, (n,).

    `other` has the tools that are printed with others.
    """
    whole = replace(job, contours=printed_with(contours, other), acceleration=None)
    return np.asarray(able_heads(whole, machine).any(axis=1))


def _with_others(
    document: PlanDocument, source: Source, rows: Flags, other: Mapping[int, int]
) -> list[str]:  # fmt: skip
    """Return in words what of these contours is printed with other tools, (n,) `rows`."""
    refuse_other_diameters(source, other)
    tool, found = document.contours.tool[rows], list[str]()
    for due, has in other.items():
        count = len(np.unique(document.contours.sources[rows][tool == due]))
        if count:
            found.append(
                f"{count} contour{'s' * (count != 1)} of tool {due} "
                f"{'are' if count != 1 else 'is'} printed with tool {has}'s filament"
            )
    return found


def _to_print(
    document: PlanDocument, job: PrintJob, rows: Flags, broken: Sequence[Broken], able: Able,
) -> list[Stretch]:  # fmt: skip
    """Return the stretches of these contours in the order of the source, (n,) `rows`."""
    begun, whole = {one.contour: one.rest for one in broken if one.rest}, rows.copy()
    whole[list(begun)] = False
    found = stretches_left(document, job, whole, able)
    for contour, rest in begun.items():
        found += rest if rows[contour] else ()
    return sorted(found, key=lambda one: (one.of, int(one.row[0])))


def _written(
    source: Source, machine: Machine, stretches: Sequence[Stretch], other: Mapping[int, int],
    report: Report,
) -> Source:  # fmt: skip
    """Write stretches in the order of their source, and return that as it is read back.

    Where one tool is left, as its head's own file has it, if that reads as these stretches.
    """
    report(Step("writing what is left as a print of its own"))
    job, document = _of_tools(source, machine, stretches, other)
    try:
        return _written_so(source, machine, job, document, stretches)
    except InputError:
        if other or document is source.document:
            raise
    return _written_so(source, machine, source.job, source.document, stretches)


def _written_so(
    source: Source, machine: Machine, job: PrintJob, document: GcodeDocument,
    stretches: Sequence[Stretch],
) -> Source:  # fmt: skip
    job, document = with_stretches(job, document, stretches)
    folder, order = SlicedFolder(), np.arange(len(stretches), dtype=np.int32)
    draft = folder.path / "rest.gcode"
    write_order(job, document, order, parked_above(lone_machine(machine), job.contours), draft)
    anew, text = read_gcode(draft)
    _refuse_altered(source, job, anew)
    return replace(
        source, path=draft, job=anew, document=text, folder=folder, machine=machine,
        own_limits=False, plate=None, given=None, original=None, towerless=False,
    )  # fmt: skip


def _of_tools(
    source: Source, machine: Machine, stretches: Sequence[Stretch], other: Mapping[int, int]
) -> tuple[PrintJob, GcodeDocument]:  # fmt: skip
    """Return the source with the tools that print these stretches."""
    job, document = source.job, source.document
    if not one_tool_each(machine, job.contours):
        return job, document
    of = np.array([stretch.of for stretch in stretches])
    tools = np.unique(printed_with(job.contours, other).tool[of]).tolist()
    if len(tools) == 1:
        return with_tool_left(job, document, tools[0], other, first=int(of.min()))
    if other:
        left = " and ".join(map(str, tools))
        raise InputError(
            f"{OPTION}: what is left is for tools {left}, and this is done for one tool alone yet",
            advice="leave it away: the heads that live print what is for their own tools",
        )
    return job, document


def _refuse_altered(source: Source, due: PrintJob, found: PrintJob) -> None:
    same = np.array_equal(due.contours.offsets, found.contours.offsets)
    if same:
        off = np.abs(due.contours.points - found.contours.points).max(initial=0.0)
        more = np.abs(due.contours.extrusion - found.contours.extrusion).max(initial=0.0)
        same = off <= ROUNDED_MM and more <= ROUNDED_E_MM
        same = same and np.array_equal(due.contours.tool, found.contours.tool)
    if not same:
        raise InputError(
            "what is left reads as other contours once it is written, so it is not planned",
            path=source.path, advice="a source that primes its first bead without having retracted "
            "before cannot be replanned yet",
        )  # fmt: skip


def search_of(document: PlanDocument, time_limit_s: float, seed: int) -> TeamSearch:
    """Return a search for the rest of a plan, which may be cut as the plan was."""
    made = OrderRules() if document.rules is None else document.rules
    return TeamSearch(time_limit_s, seed, cut=Cut(made.cut), weld_limit_s=made.weld_limit_s)


def replan(
    rest: Rest,
    search: TeamSearch,
    rules: Rules,
    *,
    writes: bool = True,
    report: Report = unheard,
    stop: Stop = never,
    agents: Launch | None = None,
) -> Result:
    """Plan what is left for the heads that live, and have it judged.

    `agents` stands for the heads' processes in a test. Raises InputError when the rest cannot be
    planned, VerificationError when the judge refuses the plan; nothing of it is written then.
    """
    heads = len(rest.source.machine.heads)
    if writes:
        _refuse_several_tools(rest)
    if heads == 1:
        search = replace(search, cut=Cut.NONE)
    return launched(
        partial(rest_problem, rest, rules), heads, search, writes=writes, report=report, stop=stop,
        agents=agents,
    )  # fmt: skip


def _refuse_several_tools(rest: Rest) -> None:
    """Raise InputError where a head would change its tool: files of heads have one each."""
    tools = np.unique(rest.source.job.contours.tool).tolist()
    for head in rest.source.machine.heads:
        mine = [tool for tool in tools if not head.tools or tool in head.tools]
        if len(mine) > 1:
            raise InputError(
                f"what is left for head {head.name} is of tools {' and '.join(map(str, mine))}, "
                "and files of a rest have one tool a head",
                advice="name --plan FILE in place of -o: what is left is then planned, not written",
            )


def rest_problem(rest: Rest, rules: Rules, report: Report = unheard) -> PrintProblem:
    """Return the problem of what is left, beside what is printed and the heads that are fenced.

    Raises InputError when the rest cannot be planned.
    """
    problem, whole = team_problem(rest.source, rules, report), rest.source.job
    notes = (*problem.job.notes, *rest.lines, HOMES)
    # A safe order that was made anew has lost what stands on the bed.
    job = replace(
        problem.job, printed=whole.printed, fenced=whole.fenced, print_with=whole.print_with,
        notes=notes,
    )  # fmt: skip
    return replace(problem, job=job)
