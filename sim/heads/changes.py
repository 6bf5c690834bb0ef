"""Which changes of tools of a source need not happen, where each head has one tool.

Found from the source's text, line by line, by the rules of docs/gcode.md (*Changes of tools, where
each head has its own*); what holds from bead to bead is compared bead by bead. The filament of
changes is the ledger's (`sim.heads.ledger`). What the source does with a tool at them is its
practice, for heads that stand idle (`sim.heads.idle`): how far it is pulled back at least, how hot
it is left at most, and what is pushed beyond what was pulled, alike at each change to it. How hot a
head is where it prints is looked at in its file.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Int32s
from decmcts.formats.gcode import Block, GcodeDocument, Motions
from decmcts.formats.gcode.document import OwnStart
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine, Practice
from sim.faults import Fault, FaultKind, listed
from sim.files.changes import codes_of
from sim.files.commands import command_in, commands_of, sets_state
from sim.files.written import source_text
from sim.heads.file import ContourMoves, HeadFile
from sim.heads.heat import SELECTS, heat_due, heat_of

_MOVES = re.compile(
    rb"G(?:[0-4]|1[01](?!.*[PL])|21|9[01])(?![\d.])|G92 ?E|M(?:400|8[23])(?![\d.])", re.I
)

MOST_MM = 2.0  # of filament; more is a purge, or made up for by a macro
PRIMES_MM = 0.01  # of filament
UNLOADS_MM = 20.0  # more is no retraction: the filament is out of the hot end
ALIKE_MM = 2e-3  # what differs less is alike: files round off
UNSEEN = ("unknown", "filament change", "pause", "tool change")  # how reasons begin of barriers
# that may move filament unseen, or after which it is another tool's
SourcePrint = tuple[PrintJob, GcodeDocument]


@dataclass(frozen=True, slots=True)
class _Tool:
    """How hot a source sets one tool, and where that prints; by line, from 1, ascending."""

    stated: list[tuple[int, float]]  # line and degrees
    prints: list[int]  # lines of its contours

    def degrees(self, line: int) -> float:
        """Return what is stated for it above a line; NaN: nothing."""
        k = bisect_left(self.stated, (line, -1.0))
        return self.stated[k - 1][1] if k else np.nan

    def stays(self, begin: int, end: int) -> bool:
        """Tell whether it prints as hot below these lines as above, whatever they state."""
        if bisect_left(self.stated, (begin, -1.0)) == bisect_left(self.stated, (end + 1, -1.0)):
            return True
        k = bisect_left(self.prints, begin)
        if k == len(self.prints):
            return not k or self.degrees(end + 1) > 0.0  # one that is done is not left hot
        return not k or self.degrees(self.prints[k - 1]) == self.degrees(self.prints[k])


def without_changes(job: PrintJob, document: GcodeDocument) -> SourcePrint | None:
    """Return a source of several tools as heads with one tool each may print it.

    None where all its changes stay. Linear in lines and moves.
    """
    if document.moves is None:
        return None
    tools = _tools_of(source_text(document), job, every=heat_due(document, job).one_hot_end)
    since = gaps_of_tools(document.moves, job.contours.tool)
    gone, kept = list[Block](), list[Block]()
    for block in document.blocks:
        little = abs(since.get(behind(block, job), NO_GAP).net) <= MOST_MM
        (gone if little and _may_go(block, tools) else kept).append(block)
    if not any(block.begin.tool != block.end.tool for block in gone):
        return None
    return _unwalled(job, document, gone, kept, since, tools)


def _unwalled(
    job: PrintJob, document: GcodeDocument, gone: list[Block], kept: list[Block],
    since: Mapping[int, FilamentBalance], tools: Mapping[int, _Tool],
) -> SourcePrint:  # fmt: skip
    """Return a source without some blocks."""
    was = job.contours.epoch
    behind = dict(zip(np.searchsorted(was, [b.epoch for b in gone]).tolist(), gone, strict=True))
    walls = np.diff(was, prepend=was[:1]) > 0
    walls[[c for c, block in behind.items() if not block.edge]] = False
    epoch = np.cumsum(walls, dtype=np.int32)
    now = dict(zip(was.tolist(), epoch.tolist(), strict=True))
    starts = tuple(_starts(job, document, behind))
    refills = set(job.refills) - {block.epoch for block in gone}
    taken = {c for c in behind if job.contours.tool[c] != job.contours.tool[c - 1]}
    primes, deep = _primed_and_pulled(job, since, taken)
    owed = document.owed.copy()
    for c in behind:
        more = primes.get(int(job.contours.tool[c]), 0.0) if c in taken and c in since else 0.0
        owed[c] = more - since.get(c, NO_GAP).net
    apart = heat_due(document, job).one_hot_end
    standbys = {} if apart else _standbys(gone, tools)
    practices = {
        tool: Practice(
            round(deep.get(tool, 0.0), 5), round(primes.get(tool, 0.0), 5), standbys.get(tool)
        )
        for tool in sorted({*primes, *deep, *standbys})
    }
    job = replace(
        job, contours=replace(job.contours, epoch=epoch),
        refills=tuple(sorted(now[e] for e in refills)), practices=tuple(practices.items()),
    )  # fmt: skip
    blocks = tuple(replace(block, epoch=now[block.epoch]) for block in kept)
    return job, replace(document, blocks=blocks, own_starts=starts, owed=owed)


def as_planned(
    epochs: Int32s, machine: Machine, job: PrintJob, document: GcodeDocument
) -> SourcePrint:
    """Return a source as a plan with these epochs takes it: with its changes of tools or without.

    Where they begin no epoch of their own both have the same epochs; it is taken without them if
    each head has one tool. Where the plan's epochs are neither it is the source as it stands, from
    which they then differ.
    """
    tools = set(job.contours.tool.tolist())
    kept = [tools & set(head.tools) if head.tools else tools for head in machine.heads]
    one_tool_each = len(tools) > 1 and max(map(len, kept)) <= 1
    if not one_tool_each and np.array_equal(epochs, job.contours.epoch):
        return job, document
    found = without_changes(job, document)
    if found is not None and np.array_equal(epochs, found[0].contours.epoch):
        return found
    return job, document


def _tools_of(text: bytes, job: PrintJob, *, every: bool) -> dict[int, _Tool]:
    """Return what each tool is told; with `every` what names none is told to all."""
    numbers, lines = job.contours.tool, job.contours.line
    found = {int(t): _Tool([], lines[numbers == t].tolist()) for t in np.unique(numbers)}
    selected = 0
    for line, command in commands_of(text):
        if chosen := _selects(command):
            selected = int(chosen[1])
        elif (heat := heat_of(command)) is not None:
            tool = selected if heat.tool is None else heat.tool
            for each in found.values() if every and heat.tool is None else [found.get(tool)]:
                if each is not None:
                    each.stated.append((line, heat.degrees))
    return found


def _may_go(block: Block, tools: Mapping[int, _Tool]) -> bool:
    """Tell whether what a block commands is for a change of tools and for nothing else."""
    codes, changes = codes_of(block), _changes(block)
    if block.tower or block.begin.relative_e != block.end.relative_e:
        return False
    if not changes and not (codes and all(map(heat_of, codes))):
        return False
    if not all(_sets_up(code) or sets_state(code) or code[:4] == b"M73 " for code in codes):
        return False
    return all(tool.stays(block.line, block.last_line) for tool in tools.values())


def _changes(block: Block) -> bool:
    return any(_selects(code) for code in codes_of(block))


def _selects(code: bytes) -> re.Match[bytes] | None:
    """Return the match of a command that chooses a tool, with whatever words it has besides."""
    return SELECTS.match(code.split()[0])


def _sets_up(code: bytes) -> bool:
    return bool(code) and bool(_selects(code) or heat_of(code) or _MOVES.match(code))


def _starts(
    job: PrintJob, document: GcodeDocument, behind: Mapping[int, Block]
) -> Iterator[OwnStart]:
    """Yield what each head has behind the start code: the lines with which its tool is taken."""
    for tool in np.unique(job.contours.tool).tolist():
        block = behind.get(job.contours.tool.tolist().index(tool))
        if block is None:
            continue
        rows = [row for row in block.text.splitlines() if _sets_up(command_in(row))]
        text = b"".join(row + document.newline for row in rows)
        end = replace(block.end, state=document.start.state, position=document.start.position)
        yield OwnStart(tool, text, block.begin.tool, end, block.last_line)


def _primed_and_pulled(
    job: PrintJob, since: Mapping[int, FilamentBalance], taken: set[int]
) -> tuple[dict[int, float], dict[int, float]]:
    """Return what primes each tool, and how far it is pulled back at least, mm of filament.

    It is primed by what is pushed beyond what was pulled at every change to it alike. `taken` are
    the contours before which tools change.
    """
    of_tool: dict[int, list[FilamentBalance]] = {}
    for c in taken & since.keys():
        of_tool.setdefault(int(job.contours.tool[c]), []).append(since[c])
    primes, deep = dict[int, float](), dict[int, float]()
    for tool, changes in of_tool.items():
        pushed, pulled = zip(*changes, strict=True)
        if min(pushed) > PRIMES_MM and max(pushed) - min(pushed) <= ALIKE_MM:
            primes[tool] = median(pushed)
        if PRIMES_MM < min(pulled) <= UNLOADS_MM:
            deep[tool] = min(pulled)
    return primes, deep


def _standbys(gone: Sequence[Block], tools: Mapping[int, _Tool]) -> dict[int, float]:
    """Return how hot each tool is left at most where it is put down, degrees."""
    found = dict[int, float]()
    for block in filter(_changes, gone):
        tool = block.begin.tool
        rows = tools[tool].stated if tool in tools else []
        first, last = (
            bisect_left(rows, (line, -1.0)) for line in (block.line, block.last_line + 1)
        )
        if first < last and 0.0 < (left := rows[last - 1][1]) < np.inf:
            found[tool] = max(found.get(tool, 0.0), left)
    return found


def belongs_to_bead(block: Block) -> bool:
    """Tell whether what a block does with filament belongs to the contour behind it alone."""
    return not any(reason.startswith(UNSEEN) for reason in block.reasons)


def behind(block: Block, job: PrintJob) -> int:
    """Return the contour that the source prints first behind a block."""
    return int(np.searchsorted(job.contours.epoch, block.epoch))


class FilamentBalance(NamedTuple):
    """What a tool does between two contours it prints, mm of filament."""

    net: float  # pushed less pulled
    pulled: float  # the most that is pulled back


NO_GAP = FilamentBalance(0.0, 0.0)


def gaps_of_tools(moves: Motions, tool: NDArray[np.integer[Any]]) -> dict[int, FilamentBalance]:
    """Return what each contour's tool has done since its last contour.

    `tool` is that of each contour. Of contours that are the first of their tool nothing.
    """
    number, found = tool.tolist(), dict[int, FilamentBalance]()
    held, lowest, at = dict[int, float](), dict[int, float](), -1
    columns = (moves.tool, moves.contour, moves.extrusion)
    for used, contour, filament in zip(*(np.asarray(c).tolist() for c in columns), strict=True):
        if contour < 0:
            if filament and used in held:
                held[used] += filament
                lowest[used] = min(lowest[used], held[used])
            continue
        own = number[contour]
        if contour != at and own in held:
            found[contour] = FilamentBalance(held[own], -lowest[own])
        held[own], lowest[own], at = 0.0, 0.0, contour
    return found


def check_hot_ends(
    heads: Sequence[tuple[HeadFile, Sequence[ContourMoves]]], source: bytes, job: PrintJob,
    document: GcodeDocument,
) -> list[Fault]:  # fmt: skip
    """Check that each bead of heads' files is laid with its hot end told what the source tells it.

    `heads` has each file with the beads in it, `source` is the source's text.
    """
    tools = _tools_of(source, job, every=heat_due(document, job).one_hot_end)
    words = list[str]()
    for file, laid in heads:
        stated = [
            (line, heat.degrees)
            for line, command in commands_of(file.lines.text)
            if (heat := heat_of(command)) is not None
        ]
        has = _Tool(stated, [])
        for contour, begin, _ in laid:
            line = int(file.motion.line[begin]) + 1
            due = tools[int(job.contours.tool[contour])].degrees(int(job.contours.line[contour]))
            here = has.degrees(line)
            if here != due and not (np.isnan(here) and np.isnan(due)):
                words.append(
                    f"head {file.name}, line {line}: contour {contour} is printed with the hot end "
                    f"told {here:g} degrees, in the source {due:g}"
                )
    return listed(FaultKind.STATE, words)
