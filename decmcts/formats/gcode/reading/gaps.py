"""What lies between contours: retraction habits, and blocks that stay as they are.

A gap is made again from its habits unless it holds a barrier; then the lines
from its first barrier to its last stay together, verbatim. Where a barrier may move filament and
what the gap pulls and pushes does not add up without it, or where the gap leaves filament, the
whole gap stays.

A gap is what lies between two contours. What its moves push less what they pull is its *net*. The
net goes with the contour behind the gap, whatever comes before that in another order, so that each
tool gives in all orders what it gives in the source. Net and not retraction is counted: what a
macro has pushed or pulled is not known, and must not be made up for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.formats.gcode.controller.limits import travel_kinds
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.controller.moves_kernels import FIRMWARE_RETRACTED, RELATIVE_E, TOOL
from decmcts.formats.gcode.dialects.dialect import UNKNOWN
from decmcts.formats.gcode.document import UNSET, Block, Cursor
from decmcts.formats.gcode.reading.beads import Parsed
from decmcts.formats.gcode.text.lines import Lines
from decmcts.formats.gcode.text.scan_kernels import X, Z
from decmcts.print.job import Barrier

DEPOSIT_MM = 0.2  # filament left in a gap beyond the habit: a blob, not a retraction
SETTLED_MM = 0.01  # of filament; a gap whose net is less has pushed back what it pulled
PULLED = 0.01  # mm of filament that counts as a retraction


@dataclass(frozen=True, slots=True)
class Gaps:
    """What lies between contours k and k + 1, each (n - 1,)."""

    begin: Ints  # its first move,
    end: Ints  # and the move behind its last
    tool: Ints  # in use where the gap ends
    changes: Flags  # another tool was in use where it begins
    net: Floats  # pushed less pulled, mm, by all tools
    depth: Floats  # most that is pulled and not pushed back within it, mm
    firmware: Flags  # the firmware retracts in it

    @property
    def pulled(self) -> Flags:
        """Whether the source retracts there."""
        return np.asarray(self.firmware | (self.depth > PULLED))


def gaps_of(parsed: Parsed) -> Gaps:
    """Return the book of a source's gaps; linear in its moves."""
    motion, runs = parsed.motion, parsed.runs
    begin, end = runs.last[:-1] + 1, runs.first[1:]
    total = np.concatenate([[0.0], np.cumsum(motion.extrusion)])  # pushed less pulled before moves
    tool = motion.tool()
    lowest = total[begin]
    if len(begin):
        pairs = np.stack([begin, end + 1], axis=1).ravel()
        lowest = np.minimum.reduceat(np.append(total, np.inf), pairs)[::2]
    retracted = np.concatenate([[0], np.cumsum(motion.modes[:, FIRMWARE_RETRACTED])])
    return Gaps(
        begin, end, tool[end], tool[end] != tool[runs.last[:-1]], total[end] - total[begin],
        total[begin] - lowest,
        retracted[motion.line[end]] > retracted[motion.line[runs.last[:-1]] + 1],
    )  # fmt: skip


def deposits(motion: Motion, gaps: Gaps) -> Flags:
    """Tell which gaps leave filament that no contour has, (n - 1,).

    Beyond what the tool usually leaves, be it nothing, or what a restart distance adds. In
    a gap in which the tool changes neither the one that comes nor both together may do so: what
    one has pulled another may push, when it is used for the first time.
    """
    net, kept = gaps.net, ~gaps.changes
    usual = np.zeros(len(net))
    for tool in np.unique(gaps.tool[kept]).tolist():
        own = gaps.tool == tool
        usual[own] = np.median(net[own & kept])
    over = net > np.maximum(usual, 0.0) + DEPOSIT_MM
    under = net < np.minimum(usual, 0.0) - DEPOSIT_MM
    found = kept & (over | under)
    found[gaps.changes] = _left_by_changes(motion, gaps)
    return np.asarray(found)


def _left_by_changes(motion: Motion, gaps: Gaps) -> Flags:
    """Tell which of the gaps with a change of tools leave filament, in their order."""
    held: dict[int, float] = {}  # net of each tool since its last contour
    found = list[bool]()
    for k in np.flatnonzero(gaps.changes).tolist():
        span = slice(int(gaps.begin[k]), int(gaps.end[k]))
        pushes = zip(motion.tool(span).tolist(), motion.extrusion[span].tolist(), strict=True)
        for tool, filament in pushes:
            held[tool] = held.get(tool, 0.0) + filament
        left = held.pop(int(gaps.tool[k]), 0.0)
        found.append(abs(left) > DEPOSIT_MM and abs(gaps.net[k]) > DEPOSIT_MM)
    return np.array(found, np.bool_)


def unsettled(gaps: Gaps, unknown: Flags) -> Flags:
    """Tell which gaps leave to a macro what they pull or push, (n - 1,).

    Of `unknown` ones, (n - 1,), it is not known what a line in them does to the filament.
    """
    usual = float(np.median(gaps.net[~unknown])) if (~unknown).any() else 0.0
    settled = np.abs(gaps.net - (usual if abs(usual) < DEPOSIT_MM else 0.0)) <= SETTLED_MM
    return np.asarray(unknown & ~settled & ~(np.abs(gaps.net) <= SETTLED_MM))


def net_before(parsed: Parsed, line: int) -> float:
    """Return the net, mm, of the moves above a line that come after the last contour there."""
    motion, runs = parsed.motion, parsed.runs
    move = int(motion.before[line])
    k = int(np.searchsorted(runs.last, move)) - 1
    since = int(runs.last[k]) + 1 if k >= 0 else move
    return float(motion.extrusion[since:move].sum())


def net_behind(parsed: Parsed, line: int) -> float:
    """Return the net, mm, of the moves from a line on that come before the next contour."""
    motion, runs = parsed.motion, parsed.runs
    move = int(motion.before[line])
    k = int(np.searchsorted(runs.first, move))
    until = int(runs.first[k]) if k < len(runs.first) else move
    return float(motion.extrusion[move:until].sum())


def due_at_begins(gaps: Gaps, parted: Flags) -> Floats:
    """Return what the source leaves pulled where each contour begins, (n,) mm.

    Below 0 where it has pushed more than it pulled. What lies around the lines of a block
    (`parted`, (n,): one stands before the contour) is the block's.
    """
    due = np.zeros(len(parted))
    due[1:] = -gaps.net
    due[parted] = 0.0
    due[np.abs(due) < 1e-9] = 0.0
    due.setflags(write=False)
    return due


def travel_states(parsed: Parsed) -> Int32s:
    """Return the state in which the source travels to beads of each state, -1: unknown.

    It is that in which it travels furthest to beads of the state; where none is travelled to, that
    of the last travel before its first bead. One in which something is not set yet comes last: it
    cannot be put back.
    """
    motion, track = parsed.motion, parsed.track
    across = np.hypot(*np.diff(motion.points[:, :2], axis=0).T)
    travels = (across > 1e-9) & (motion.extrusion == 0.0) & ~motion.placed[motion.line]
    leads = np.maximum.accumulate(np.where(travels, np.arange(len(travels)), -1))
    laid = np.flatnonzero(parsed.runs.contour >= 0)
    reached = leads[laid] > np.concatenate([[-1], laid[:-1]])
    lead, states = leads[laid], track.at(motion.line)
    laid, reached, lead = laid[lead >= 0], reached[lead >= 0], lead[lead >= 0]
    pairs = np.stack([states[laid], states[lead]], axis=1)
    kinds, first, kind = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    far = np.bincount(kind.ravel(), across[lead] * reached, len(kinds))
    found = np.full(len(track.table.rows), -1, np.int32)
    limits = track.table.rows[:, travel_kinds(track.table)[0]] != UNSET
    can_be_set = ~(limits[kinds[:, 0]] & ~limits[kinds[:, 1]]).any(axis=1)
    best = kinds[np.lexsort((-first, far, can_be_set))]  # of each state the last counts
    found[best[:, 0]] = best[:, 1]
    return found


@dataclass(frozen=True, slots=True)
class Blocks:
    """Verbatim blocks, the epochs they bound, and the barriers in them."""

    blocks: tuple[Block, ...]
    barriers: tuple[Barrier, ...]
    epoch: Int32s  # (n,)
    tied: Flags  # (n,) part of a verbatim sequence, may not be reversed
    held: Flags  # (n,) what is pushed or pulled above belongs to it: it stays first
    parted: Flags  # (n,) a block stands before it


def cursor_at(parsed: Parsed, line: int, *, owed: float) -> Cursor:
    """Return where the controller stands before a line; for `owed` see `Cursor`."""
    motion = parsed.motion
    move = int(motion.before[line])
    x, y, z = motion.points[move].tolist()
    above = max(line - 1, 0)
    modes = motion.modes[above]
    return Cursor(
        (x, y, z), float(motion.extruder[above, 0]),
        float(motion.feed[move - 1]) if move else 0.0, owed, float(motion.extruder[above, 1]),
        bool(modes[FIRMWARE_RETRACTED]), bool(modes[RELATIVE_E]), int(parsed.track.at(line)),
        int(modes[TOOL]),
    )  # fmt: skip


def find_blocks(parsed: Parsed, gaps: Gaps, *, edges: Flags, towers: Flags) -> Blocks:
    """Return the blocks of a print.

    Parameters
    ----------
    edges : (n,) bool
        Contours an epoch begins at although no line says so (first layer).
    towers : (n,) bool
        Contours of a tool change: they stay in their sequence, word for word.
    """
    motion, runs, track = parsed.motion, parsed.runs, parsed.track
    n = len(runs)
    begin = motion.line[runs.last[:-1]] + 1  # lines of gap k + 1: begin[k]..end[k] - 1
    end = motion.line[runs.first[1:]]
    whole = np.zeros(n, np.bool_)
    whole[1:] = towers[1:] & towers[:-1]
    held = np.zeros(n, np.bool_)
    unknown = track.stops(UNKNOWN)
    unseen = np.searchsorted(unknown, end) > np.searchsorted(unknown, begin)
    held[1:] = deposits(motion, gaps) | unsettled(gaps, np.asarray(unseen))
    whole |= held
    walls = track.stops()
    low, high = np.searchsorted(walls, begin), np.searchsorted(walls, end)
    broken = np.zeros(n, np.bool_)
    broken[1:] = high > low
    breaks = broken | whole | edges
    breaks[1:] |= towers[1:] | towers[:-1]
    breaks[0] = False
    epoch = np.cumsum(breaks).astype(np.int32)
    blocks = []
    for c in np.flatnonzero(broken | whole).tolist():
        span = (int(begin[c - 1]), int(end[c - 1]))
        if not whole[c]:
            span = (int(walls[low[c - 1]]), int(walls[high[c - 1] - 1]) + 1)
        block = _block(parsed, span, int(epoch[c]))
        beside = bool(towers[c] or towers[c - 1])
        blocks.append(replace(block, edge=bool(edges[c]), tower=beside))
    tied = towers | whole
    tied[:-1] |= whole[1:]
    named = [b for b in track.barriers.items() if begin[0] <= b[0] < end[-1]] if n > 1 else []
    barriers = _named(parsed.lines, named, blocks)
    return Blocks(tuple(blocks), barriers, epoch, tied, held, broken | whole)


def _block(parsed: Parsed, span: tuple[int, int], epoch: int) -> Block:
    lines, motion, barriers = parsed.lines, parsed.motion, parsed.track.barriers
    first, last = span
    inside = [barriers[k] for k in range(first, last) if k in barriers]
    moved = motion.points[motion.before[first] : motion.before[last] + 1]
    moves = (lines.letter[first:last] == 71) & (lines.code[first:last] <= 30)
    placed = moves[:, None] & ~np.isnan(lines.values[first:last, X : Z + 1])
    return Block(
        epoch, lines.span(first, last),
        cursor_at(parsed, first, owed=-net_before(parsed, first)),
        cursor_at(parsed, last, owed=net_behind(parsed, last)),
        bool(placed.any() or np.ptp(moved, axis=0).max() > 1e-9), first + 1,
        inside[0] if inside else "extrusion outside a contour", tuple(inside),
    )  # fmt: skip


def _named(
    lines: Lines, barriers: list[tuple[int, str]], blocks: list[Block]
) -> tuple[Barrier, ...]:
    """Return each kind of barrier once, with its first line."""
    seen: dict[tuple[str, str], Barrier] = {}
    for line, reason in barriers:
        text = lines.raw(line).decode("utf-8", "replace").split(";", 1)[0].strip()
        word = text.split(None, 1)[0] if text else ""
        seen.setdefault((word, reason), Barrier(text, line + 1, reason))
    for block in blocks:
        if block.reason == "extrusion outside a contour":
            text = block.text.decode("utf-8", "replace").strip().split("\n", 1)[0].strip()
            seen.setdefault(("", block.reason), Barrier(text, block.line, block.reason))
    return tuple(seen.values())
