"""Changes of tools that are no walls: each head has one tool, and keeps it.

A source with several tools is one head's: it parks one tool, heats and takes another. Where each
head has a tool of its own nothing of that happens, so what stands in the source for a change and
for nothing else is left out, and contours may move across it. Such a block

- commands nothing but choices of tools, temperatures of hot ends, moves and retractions;
- has every tool that it heats or cools print as hot behind it as above it;
- stands beside no beads of a wipe tower.

What a block says where a tool is taken first is told to its head behind the start code. What is
pushed less what is pulled with a tool between two of its contours goes with the latter of the two,
so each tool gives what it gives in the source. But where the source pushes as much more than it has
pulled at each change to a tool, that primes it: it is pushed where the tool's head has stood idle.
How far a tool is pulled back at changes, and how hot it is left, is kept as its practice too.
A change that is not understood so stays a wall.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Floats
from decmcts.formats.gcode.dialects.dialect import classify
from decmcts.formats.gcode.document import Block, GcodeDocument, Motions, OwnStart
from decmcts.formats.gcode.text.lines import command_of, commands_of
from decmcts.formats.gcode.writing.hot_ends import (
    HELD,
    OWN,
    heat_taken_by_heads,
    hot_end_command,
    hot_end_commands,
    hot_end_commands_in,
    unknown_row,
)  # fmt: skip
from decmcts.formats.gcode.writing.parts import without_blocks
from decmcts.print.job import PrintJob
from decmcts.print.machine import UNLOAD_MM, Practice

_QUIET = re.compile(
    rb"(?:G0*(?:[0-4]|1[01](?![^;]*[PL])|9[01])|M(?:400|8[23]|220))(?![0-9.])|G92 *E", re.I
)  # moves, dwells, how coordinates count and how fast moves are meanwhile
_FACTOR = re.compile(rb"M220(?![0-9.])", re.I)  # the speed's: what is in force, goes with beads
DIGITS = 5  # of filament, as many as files have
MOST_MM = 2.0  # of filament that a change pushes or pulls in all; more is a purge, or a macro's
PRIMES_MM = 0.01  # of filament; less is rounding
ALIKE_MM = 2e-3  # by which what primes a tool may differ: what files of three decimals round off
_PLACES = re.compile(r"\d+ places? nothing is moved across$")


@dataclass(frozen=True, slots=True)
class Freed:
    """A print whose changes of tools are no walls, as far as they are understood."""

    job: PrintJob
    document: GcodeDocument
    barred: str = ""  # why the first of them does that is more than another temperature


def with_own_tools(job: PrintJob, document: GcodeDocument) -> Freed | str:
    """Return a print of several tools for heads that have one each, or why its changes stay walls.

    Linear in moves and contours, but for the search of each block's contours.
    """
    changes = [block for block in document.blocks if _is_change(block)]
    if not changes:
        return "the source has no changes of tools that stand by themselves"
    heat, obstacles = StatedHeat.of(job, document), dict[int, str]()
    epochs = [block.epoch for block in document.blocks]
    begins = np.searchsorted(job.contours.epoch, epochs).tolist()
    pushed = _pushed_before(job, document.moves, begins)
    barred = ""
    for number, (block, begin) in enumerate(zip(document.blocks, begins, strict=True)):
        net = _net(pushed[begin]) if begin in pushed else 0.0
        foreign, filament = _foreign(block), _left(block, net)
        if what := foreign or heat.differs(block) or filament:
            obstacles[number] = what
        if not barred and _is_change(block):
            barred = foreign or filament
    left = {k for k, block in enumerate(document.blocks) if k not in obstacles and _is_own(block)}
    count = sum(_is_change(document.blocks[k]) for k in left)
    stays = [why for k, why in obstacles.items() if _is_change(document.blocks[k])]
    if not count:
        return stays[0]
    freed = _without(job, document, left, {begins[k]: k for k in sorted(left)}, pushed)
    if what := StatedHeat.of(freed.job, freed.document).unlike(heat, freed.job, job):
        return stays[0] if stays else what
    note = f"{count} change{'s' * (count != 1)} of tools are no walls"
    note += f", {len(stays)} stay: {stays[0]}" if stays else ""
    job = replace(freed.job, notes=(*freed.job.notes, note))
    return replace(freed, job=job, barred=barred)


def first_use(job: PrintJob, document: GcodeDocument, tool: int) -> OwnStart | None:
    """Return what a tool's head is told where the source takes it first; None: in the start code.

    The change may be a wall or none.
    """
    first = int(np.argmax(job.contours.tool == tool))
    epochs = np.searchsorted(job.contours.epoch, [block.epoch for block in document.blocks])
    for k in np.flatnonzero(epochs == first).tolist():
        if _is_change(document.blocks[k]) and document.blocks[k].end.tool == tool:
            return _own_start(document, tool, document.blocks[k])
    return None


def _is_change(block: Block) -> bool:
    return "tool change" in block.reasons


def _is_own(block: Block) -> bool:
    """Tell whether a block is a change of tools, or heats or cools hot ends for one."""
    commands = commands_of(block.text)
    return _is_change(block) or (bool(commands) and all(map(hot_end_command, commands)))


def _foreign(block: Block) -> str:
    """Return in words what a block has that is no change of tools; empty: nothing."""
    if block.tower:
        return "a wipe tower is printed at changes of tools (--without-tower leaves it out)"
    if block.begin.relative_e != block.end.relative_e:
        return f"how E counts is another behind line {block.line}"
    if found := unknown_row(block.text, _QUIET):
        where, text = block.line + found[0], found[1]
        return f"what '{text}' (line {where}) does at a change of tools is not known"
    return ""


def _left(block: Block, net: float) -> str:
    """Return in words what a block leaves pushed or pulled with a tool; empty: about nothing."""
    if abs(net) <= MOST_MM:
        return ""
    does = "pushes" if net > 0.0 else "pulls"
    return f"the change of tools in line {block.line} {does} {abs(net):.1f} mm in all"


@dataclass(frozen=True, slots=True)
class StatedHeat:
    """How hot each tool is stated to be from which epoch on, and when it prints."""

    stated: dict[int, list[tuple[int, float | None]]]  # tool -> epoch and degrees, ascending
    prints: dict[int, list[int]]  # tool -> epochs, ascending
    touched: dict[int, set[int]]  # epoch -> tools that its block heats or cools

    @staticmethod
    def of(job: PrintJob, document: GcodeDocument) -> StatedHeat:
        """Find it, line by line."""
        tools = np.unique(job.contours.tool).tolist()
        every = heat_taken_by_heads(document, job) == "all"
        stated: dict[int, list[tuple[int, float | None]]] = {tool: [] for tool in tools}
        touched = dict[int, set[int]]()
        for given in hot_end_commands(document):
            for tool in tools if every and not given.named else [given.tool]:
                stated.setdefault(tool, []).append((given.epoch, given.command.degrees))
                touched.setdefault(given.epoch, set()).add(tool)
        pairs = {t: np.unique(job.contours.epoch[job.contours.tool == t]).tolist() for t in tools}
        return StatedHeat(stated, pairs, touched)

    def at(self, tool: int, epoch: int) -> float | None:
        """Return how hot a tool is told to be where it prints; None: nothing is known."""
        rows = self.stated.get(tool, [])
        k = bisect_left(rows, epoch + 1, key=lambda row: row[0])
        return rows[k - 1][1] if k else None

    def differs(self, block: Block) -> str:
        """Return in words which tool prints hotter or colder behind a block; empty: none."""
        for tool in self.touched.get(block.epoch, ()):
            prints = self.prints.get(tool, [])
            k = bisect_left(prints, block.epoch)
            if 0 < k < len(prints) and (self.at(tool, prints[k - 1]) != self.at(tool, prints[k])):
                return f"tool {tool} prints at another temperature from line {block.line} on"
            if k == len(prints) and prints and self.at(tool, block.epoch) == 0.0:
                return f"tool {tool} is switched off in line {block.line}"
        return ""

    def unlike(self, source: StatedHeat, job: PrintJob, theirs: PrintJob) -> str:
        """Return in words which tool would print at another temperature; empty: none."""
        pairs = np.stack([job.contours.tool, job.contours.epoch, theirs.contours.epoch], axis=1)
        for tool, here, there in np.unique(pairs, axis=0).tolist():
            if self.at(tool, here) != source.at(tool, there):
                return f"how hot tool {tool} prints depends on changes of tools that are walls"
        return ""


def _without(
    job: PrintJob, document: GcodeDocument, left: set[int], behind: dict[int, int],
    pushed: dict[int, Floats],
) -> Freed:  # fmt: skip
    """Return the print without some of its blocks.

    `behind` has these by the contour behind each, `pushed` what `_pushed_before` has for contours
    behind any.
    """
    contours = job.contours
    tools, firsts = np.unique(contours.tool, return_index=True)
    own = tuple(
        _own_start(document, tool, document.blocks[behind[first]])
        for tool, first in zip(tools.tolist(), firsts.tolist(), strict=True)
        if first in behind
    )
    notes = [note for note in job.notes if not _PLACES.match(note)]
    if places := len(document.blocks) - len(left):
        notes.append(f"{places} place{'s' * (places != 1)} nothing is moved across")
    pushed = {c: pushed[c] for c in behind if c in pushed}
    changes = {c: gap for c, gap in pushed.items() if contours.tool[c] != contours.tool[c - 1]}
    primes = _primes(job, changes)
    practices = _practices(job, document, left, primes, changes)
    owed = document.owed.copy()
    for c, gap in pushed.items():
        extra = primes.get(int(contours.tool[c]), 0.0) if c in changes else 0.0
        owed[c] = 0.0 if abs(_net(gap) - extra) < 1e-9 else extra - _net(gap)
    owed.setflags(write=False)
    job, document = without_blocks(job, document, left)
    document = replace(document, own_starts=own, owed=owed)
    return Freed(replace(job, notes=tuple(notes), practices=practices), document)


def _own_start(document: GcodeDocument, tool: int, block: Block) -> OwnStart:
    """Return what a tool's head is told of the block where the source takes the tool first."""
    rows = [row for row in block.text.split(b"\n") if command_of(row)]
    own = [row for row in rows if classify(row).kind not in HELD]
    own = [row.rstrip(b"\r") for row in own if not _FACTOR.match(command_of(row))]
    text = b"".join(row + document.newline for row in own)
    end = replace(block.end, state=document.start.state, position=document.start.position)
    return OwnStart(tool, text, block.begin.tool, end, block.last_line)


def _pushed_before(job: PrintJob, moves: Motions, behind: Collection[int]) -> dict[int, Floats]:
    """Return what a contour's tool has pushed in all, mm, before each move above these contours.

    Since the contour that it printed before, and with what it has pushed where the contour begins;
    nothing of its first.
    """
    of, tools, found = np.asarray(moves.contour), np.asarray(moves.tool), dict[int, Floats]()
    for tool in np.unique(job.contours.tool).tolist():
        mine = np.flatnonzero(job.contours.tool == tool)
        total = np.concatenate([[0.0], np.cumsum(np.where(tools == tool, moves.extrusion, 0.0))])
        laid = np.flatnonzero((of >= 0) & (tools == tool))
        wanted = np.intersect1d(mine[1:], list(behind))
        k = np.searchsorted(of[laid], wanted)  # contours are numbered in source order
        spans = zip(
            wanted.tolist(), (laid[k - 1] + 1).tolist(), (laid[k] + 1).tolist(), strict=True
        )
        found |= {c: total[begin:end] for c, begin, end in spans}
    return found


def _net(pushed: Floats) -> float:
    """Return what a gap pushes less what it pulls, mm."""
    return float(pushed[-1] - pushed[0])


def _primes(job: PrintJob, changes: dict[int, Floats]) -> dict[int, float]:
    """Return what primes each tool, mm, by the nets behind all changes to it; else nothing."""
    found = {}
    for tool in sorted({int(job.contours.tool[c]) for c in changes}):
        mine = [_net(gap) for c, gap in changes.items() if job.contours.tool[c] == tool]
        if min(mine) > PRIMES_MM and max(mine) - min(mine) <= ALIKE_MM:
            found[tool] = float(np.median(mine))
    return found


def _practices(
    job: PrintJob, document: GcodeDocument, left: set[int], primes: dict[int, float],
    changes: dict[int, Floats],
) -> tuple[tuple[int, Practice], ...]:  # fmt: skip
    """Return what the source does with each tool at the changes that are left out.

    It is pulled back as far as at the least of them, but for tools that are pulled out of the hot
    end.
    """
    found, own = [], heat_taken_by_heads(document, job) == OWN  # else they share one hot end
    for tool in np.unique(job.contours.tool).tolist():
        hot = [
            degrees
            for k in left
            if own and (block := document.blocks[k]).begin.tool == tool and _is_change(block)
            if (degrees := _last_stated(block, tool)) is not None and degrees > 0.0
        ]
        gaps = [gap for c, gap in changes.items() if job.contours.tool[c] == tool]
        deep = min((float(gap[0] - gap.min()) for gap in gaps), default=0.0)
        deep = deep if PRIMES_MM < deep <= UNLOAD_MM else 0.0
        practice = Practice(
            round(deep, DIGITS), round(primes.get(tool, 0.0), DIGITS), max(hot, default=None)
        )
        if practice != Practice():
            found.append((tool, practice))
    return tuple(found)


def _last_stated(block: Block, tool: int) -> float | None:
    """Return what a block last tells a tool's hot end, degrees; None: nothing."""
    commands = b"\n".join(commands_of(block.text))
    given = [each for each in hot_end_commands_in(commands, block.begin.tool) if each.tool == tool]
    return given[-1].command.degrees if given else None
