"""Changes of tools that follow one pattern, so that one head can make fewer of them.

A change is the block with which a source takes another tool. It is *free* if its text, the filament
pulled above it and pushed behind it, are those of the most changes between the same two tools, and
if it moves no axis and stands beside no wipe tower. Between two blocks that are not free, contours
may then be printed in any order of tools: what a change from one tool to another takes is known.

Nothing here knows which order is safe or good (`decmcts.planning.problem.fewer_changes`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Int32s
from decmcts.formats.gcode.document import DESCRIBES, Block, Cursor, GcodeDocument, MoreStates
from decmcts.formats.gcode.text.lines import command_of, commands_of
from decmcts.formats.gcode.writing.hot_ends import unknown_row
from decmcts.print.job import PrintJob

_QUIET = re.compile(rb"(?:G0*(?:[0-4]|1[01](?![^;]*P)|9[0-2])|M(?:400|8[23]))(?![0-9.])", re.I)
ALIKE_DIGITS = 3  # of filament, mm
Pair = tuple[int, int]


@dataclass(frozen=True, slots=True)
class FreeChanges:
    """The changes of a source that follow a pattern."""

    of_pair: dict[Pair, Block]  # what the source writes between two tools
    blocks: frozenset[int]  # numbers of the blocks that are free
    walls: int  # changes that are not
    why: str  # in words, why the first of them is not; empty: all are

    def stretches(self, job: PrintJob, document: GcodeDocument) -> Int32s:
        """Return between which walls each contour lies, counted from 0, (n,)."""
        stays = np.ones(int(job.contours.epoch.max(initial=0)) + 1, np.bool_)
        stays[0] = False
        stays[[document.blocks[k].epoch for k in self.blocks]] = False
        return np.cumsum(stays).astype(np.int32)[job.contours.epoch]


def free_changes(document: GcodeDocument) -> FreeChanges | str:
    """Return which changes of a source follow a pattern, or why none does."""
    changes = [k for k, b in enumerate(document.blocks) if b.begin.tool != b.end.tool]
    if not changes:
        return "the source has no changes of tools that stand by themselves"
    twice = Counter(block.epoch for block in document.blocks)
    signs = {k: _sign(document.blocks[k]) for k in changes}
    usual: dict[Pair, tuple[object, ...]] = {}
    for pair in {_pair(document.blocks[k]) for k in changes}:
        found = Counter(signs[k] for k in changes if _pair(document.blocks[k]) == pair)
        usual[pair] = found.most_common(1)[0][0]
    free, why, taken = dict[int, Block](), "", set[int]()
    for k, block in enumerate(document.blocks):
        what = ""
        if k in signs:
            what = _unlike(block, signs[k] == usual[_pair(block)], twice[block.epoch] > 1)
            what = what or _first(block, taken)
            why = why or what
        if k in signs and not what:
            free[k] = block
        elif k not in signs:
            taken.clear()
        taken.add(block.end.tool)
    of_pair = {_pair(block): block for block in reversed(free.values())}
    if len(of_pair) < 2:
        return why or "no tool is taken twice"
    return FreeChanges(of_pair, frozenset(free), len(changes) - len(free), why)


def _pair(block: Block) -> Pair:
    return block.begin.tool, block.end.tool


def _sign(block: Block) -> tuple[object, ...]:
    """Return what two changes have in common that can stand for each other."""
    begin, end = block.begin, block.end
    filament = [round(x, ALIKE_DIGITS) for x in (begin.owed, end.owed, end.pulled)]
    firmware = begin.firmware_retracted, end.firmware_retracted
    return tuple(commands_of(block.text)), *filament, *firmware, begin.relative_e, end.relative_e


def _unlike(block: Block, usual: bool, parted: bool) -> str:
    """Return in words why a change is not free; empty: it is."""
    where = f"the change of tools in line {block.line}"
    if block.tower:
        return "a wipe tower is printed at changes of tools"
    if block.moves:
        return f"{where} moves the head"
    if block.edge or parted:
        return f"{where} stands where something else is set"
    return "" if usual else f"{where} is unlike most between these tools"


def _first(block: Block, taken: set[int]) -> str:
    """Return in words whether a change is the first to a tool whose heat a macro may set.

    `taken` are the tools that changes have taken since the last wall. From then on a tool is as
    hot as the macro leaves it, before as other lines did.
    """
    if block.end.tool in taken:
        return ""
    if found := unknown_row(block.text, _QUIET):
        return f"what '{found[1]}' (line {block.line}) does to temperatures is not known"
    return ""


def with_runs(
    job: PrintJob, document: GcodeDocument, free: FreeChanges, order: Int32s, run: Int32s
) -> tuple[PrintJob, GcodeDocument]:
    """Return a source whose tools change where an order asks for it.

    Parameters
    ----------
    order : (n,)
        The contours as they are to be printed; no wall is crossed.
    run : (n,)
        The number of each place's run, never falling: the tool changes or a wall stands where it
        grows.
    """
    tool, was = job.contours.tool[order], job.contours.epoch[order]
    stretch = free.stretches(job, document)[order]
    epoch = np.empty(len(order), np.int32)
    blocks, states = list[Block](), MoreStates(document.states)
    walls = {b.epoch: b for k, b in enumerate(document.blocks) if k not in free.blocks}
    stands = sorted(walls)
    begins = np.flatnonzero(np.diff(run, prepend=-1))
    first = np.full(int(stretch.max(initial=0)) + 1, np.iinfo(np.int32).max, np.int32)
    np.minimum.at(first, stretch, was)
    number, placed, refills = -1, 0, set[int]()
    for k in begins.tolist():
        number += 1
        if k and stretch[k] != stretch[k - 1]:
            while placed < len(stands) and stands[placed] <= first[stretch[k]]:
                blocks.append(replace(walls[stands[placed]], epoch=number))
                refills |= {number} if stands[placed] in job.refills else set()
                placed += 1
        elif k:
            change = free.of_pair[int(tool[k - 1]), int(tool[k])]
            blocks.append(_placed(change, job, document, int(order[k - 1]), states, number))
            refills |= {number} if change.epoch in job.refills else set()
    epoch[order] = np.cumsum(np.diff(run, prepend=run[:1]) != 0)
    blocks += [replace(walls[e], epoch=number + 1) for e in stands[placed:]]
    job = replace(
        job, contours=replace(job.contours, epoch=epoch), refills=tuple(sorted(refills))
    )  # fmt: skip
    return job, replace(document, blocks=tuple(blocks), states=states.table())


def _placed(
    change: Block,
    job: PrintJob,
    document: GcodeDocument,
    behind: int,
    states: MoreStates,
    epoch: int,
) -> Block:
    """Return a change as it stands behind a contour."""
    last = int(job.contours.offsets[behind + 1]) - 1
    stood = int(document.point_state[last])
    at = tuple(job.contours.points[last].tolist())
    slots, states_of = document.states.slots, document.states.rows
    was, now = (states_of[k].tolist() for k in (change.begin.state, change.end.state))
    sets = {k: now[k] for k, slot in enumerate(slots) if was[k] != now[k] and slot not in DESCRIBES}
    state = states.like(stood, sets)
    begin = _at(change.begin, at, stood, float(job.contours.feed[last]))
    rows = [row for row in change.text.split(b"\n") if command_of(row)]
    text = b"".join(row.rstrip(b"\r") + document.newline for row in rows)
    end = _at(change.end, at, state, change.end.feed)
    return replace(change, epoch=epoch, text=text, begin=begin, end=end)


def _at(cursor: Cursor, at: Sequence[float], state: int, feed: float) -> Cursor:
    x, y, z = at
    return replace(cursor, position=(x, y, z), state=state, feed=feed or cursor.feed)
