"""Files of several heads judged together against the plan they were made from.

Each file is read back. Its moves are its head's actions, one after the other; its sync
points, taken with the others', must order all that the plan orders, and never stop for
good; what else it commands is the source's, as far as one controller of several is to be
told of it. A single file proves nothing. Where a head waits for a point within another's
action, files that wait for its end keep that too; what waits for less is not judged, and
neither are lags, since files keep no time among each other.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from decmcts.errors import InputError
from decmcts.formats.gcode import GcodeDocument
from decmcts.print.job import PrintJob
from decmcts.print.plan import ActionKind, HeadActions, JointPlan
from sim.commands import accepted, known_settings
from sim.faults import Fault, FaultKind, Verdict, listed
from sim.head_file import HeadFile, own_commands, read_head_file
from sim.head_sync import Knowledge
from sim.head_walk import OWED_MM, SAME_MM, Walk, Walker, differing

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of one head's file, by line from 1."""

    first: int  # first command
    parked: int  # the head has reached its park position
    end_code: int  # the first line of the end code; below all lines where it has none
    begin: int  # first move of the body
    end: int  # past its last move


def verify_heads(
    paths: Sequence[Path | str],
    plan: JointPlan,
    job: PrintJob,
    document: GcodeDocument,
    *,
    parks: Sequence[Point],
) -> Verdict:
    """Check the files of all heads of a plan, in the plan's order of heads.

    Parameters
    ----------
    job, document
        The source the plan was made from.
    parks : sequence of points
        Where each head stands before its first action.
    """
    try:
        files = [read_head_file(path) for path in paths]
    except InputError as error:
        return Verdict((Fault(FaultKind.STATE, f"a file cannot be read back: {error}"),))
    faults = _check_names(files, plan) or _check_lags(plan)
    if faults:
        return Verdict(tuple(faults))
    parts, walks = [], []
    for file, lane, park in zip(files, plan.heads, parks, strict=True):
        part, walk, found = _judge_one(file, lane, job, document, park)
        faults += found
        parts.append(part)
        walks.append(walk)
    known = Knowledge([file.syncs for file in files])
    faults += _check_sync(files, known)
    if not known.stuck and all(walk.complete for walk in walks):
        faults += _check_order(files, plan, known, parts, walks)
    return Verdict(tuple(faults), {"files": float(len(files))})


def _check_names(files: Sequence[HeadFile], plan: JointPlan) -> list[Fault]:
    """Check that there is one file for each head, and that each says so."""
    if len(files) != len(plan.heads):
        return [Fault(FaultKind.MISSING, f"{len(files)} files for {len(plan.heads)} heads")]
    lines = []
    for k, (file, lane) in enumerate(zip(files, plan.heads, strict=True)):
        if file.name != lane.head or file.place != (k + 1, len(files)):
            says = f"head {file.name}, file {file.place[0]} of {file.place[1]}"
            lines.append(
                f"{Path(file.path).name} says it is for {says if file.name else 'no head'}, it "
                f"should be for head {lane.head}, file {k + 1} of {len(files)}"
            )
    return listed(FaultKind.COMMAND, lines)


def _check_lags(plan: JointPlan) -> list[Fault]:
    """Refuse a plan whose lags nobody could find in its files."""
    lines = [
        f"head {lane.head} action {k} is to begin {edge.lag_s:g} s after what head "
        f"{plan.heads[edge.head].head} does; files of several heads keep no lags"
        for lane in plan.heads
        for k in np.flatnonzero(np.diff(lane.after_offsets)).tolist()
        for edge in lane.after_edges(k)
        if edge.lag_s != 0.0
    ]
    return listed(FaultKind.PRECEDENCE, lines)


def _judge_one(
    file: HeadFile, lane: HeadActions, job: PrintJob, document: GcodeDocument, park: Point
) -> tuple[Parts, Walk, list[Fault]]:
    """Check one file against its head's actions; what the files order comes later."""
    tools = np.unique(job.contours.tool[lane.contour[lane.kind == ActionKind.PRINT]]).tolist()
    tool = int(tools[0]) if tools else None
    words: list[str] = []
    low, parked = _match_start(file, document, tool, park, words)
    ending = own_commands(document.postamble, tool, homes=False)
    high = len(file.rest) - len(ending)
    if high < low or [code for _, code in file.rest[high:]] != ending:
        words.append("the end code is not the source's, command by command")
        high = max(low, min(high, len(file.rest)))
    beyond = len(file.lines) + 1
    end_code = file.rest[high][0] if high < len(file.rest) else beyond
    begin = int(file.motion.before[min(parked, len(file.lines))])
    end = int(file.motion.before[min(end_code, beyond) - 1])
    part = Parts(file.rest[0][0] if file.rest else 1, parked, end_code, begin, max(begin, end))
    words += _check_end(file, document, end_code)
    blocks = _take_blocks(file, document, tool, low, high, words)
    taken = {line for found in blocks for line in found}
    walk = Walker(file, lane, job, document, part.begin, part.end, taken).run()
    words += walk.faults
    words += _check_blocks(file, lane, job, document, blocks, walk)
    known = known_settings(document)
    for line, code in file.rest[low:high]:
        if line not in taken and not accepted(file.row(line), known):
            words.append(f"line {line}: '{_text(code)}' is not in the source at this place")
    words += [f"line {line}: no M400 stands before this sync point" for line in file.loose]
    where = f"head {lane.head}, "
    return part, walk, listed(FaultKind.COMMAND, [where + text for text in words])


def _match_start(
    file: HeadFile, document: GcodeDocument, tool: int | None, park: Point, words: list[str]
) -> tuple[int, int]:
    """Return the row of `rest` below the set-up, and the line that reaches the park position.

    Writes what is wrong into `words`.
    """
    mode = b"M83" if document.start.relative_e else b"M82"
    due = [*own_commands(document.preamble, tool, homes=True), b"G90", mode]
    row = 0
    for wanted in due:
        while (
            row < len(file.rest)
            and file.rest[row][1].startswith(b"G92 E")
            and (file.rest[row][1] != wanted)
        ):
            row += 1
        has = file.rest[row][1] if row < len(file.rest) else b""
        if has != wanted:
            line = file.rest[row][0] if has else len(file.lines)
            words.append(f"line {line}: '{_text(has)}', the start code has '{_text(wanted)}' here")
            return row, line
        row += 1
    while row < len(file.rest) and file.rest[row][1].startswith(b"G92 E"):
        row += 1
    row += 2  # up, then across
    parked = file.rest[min(row, len(file.rest)) - 1][0]
    stands = file.motion.points[file.motion.before[min(parked, len(file.lines))]]
    if np.abs(stands - np.array(park)).max() > SAME_MM:
        words.append(f"line {parked}: the head is not at its park position {park}")
    return min(row, len(file.rest)), parked


def _check_end(file: HeadFile, document: GcodeDocument, line: int) -> list[str]:
    """Return what is in force, or retracted, otherwise than where the source's end code begins."""
    above, end = min(line, len(file.lines)) - 2, document.end
    modes, owed = file.motion.modes[max(above, 0)], float(file.motion.extruder[max(above, 0), 1])
    words = []
    if abs(owed - end.owed) > OWED_MM or bool(modes[3]) != end.firmware_retracted:
        words.append(f"{owed:.3f} mm are retracted, in the source {end.owed:.3f}")
    if bool(modes[1]) != end.relative_e:
        words.append("E is counted in another way")
    state = int(file.track.at(max(above, 0) + 1))
    words += differing(file.track.table, state, document.states, end.state)
    return [f"before the end code {text}" for text in words]


def _take_blocks(
    file: HeadFile, document: GcodeDocument, tool: int | None, low: int, high: int,
    words: list[str],
) -> list[list[int]]:  # fmt: skip
    """Return the lines of each block that stands at a barrier; missing ones go into `words`."""
    found: list[list[int]] = []
    codes = [code for _, code in file.rest]
    for block in document.blocks:
        due = own_commands(block.text, tool, homes=False)
        if block.moves:
            due += [b"G90", b"M83" if block.end.relative_e else b"M82"]
        if not due:
            found.append([])
            continue
        at = next((r for r in range(low, high) if codes[r : r + len(due)] == due), -1)
        if at < 0:
            words.append(f"'{_text(due[0])}' of the source's line {block.line} is not there")
            found.append([])
            continue
        found.append([line for line, _ in file.rest[at : at + len(due)]])
        low = at + len(due)
    return found


def _check_blocks(
    file: HeadFile, lane: HeadActions, job: PrintJob, document: GcodeDocument,
    blocks: list[list[int]], walk: Walk,
) -> list[str]:  # fmt: skip
    """Return the blocks that do not stand between the beads they stand between in the source."""
    if not walk.complete:
        return []
    words = []
    prints = [k for k in range(len(lane)) if lane.kind[k] == ActionKind.PRINT]
    epoch = [int(job.contours.epoch[lane.contour[k]]) for k in prints]
    for block, lines in zip(document.blocks, blocks, strict=True):
        if not lines:
            continue
        above = [walk.last[k] for k, e in zip(prints, epoch, strict=True) if e < block.epoch]
        below = [walk.first[k] for k, e in zip(prints, epoch, strict=True) if e >= block.epoch]
        if max(above, default=0) > lines[0] or min(below, default=lines[-1]) < lines[-1]:
            words.append(f"line {lines[0]}: what the source has at its line {block.line} is moved")
    return words


def _check_sync(files: Sequence[HeadFile], known: Knowledge) -> list[Fault]:
    """Check that every number is given once and waited for, and that no file stops for good."""
    lines = [f"{Path(files[h].path).name} line {line} waits for ever" for h, line in known.stuck]
    return listed(FaultKind.DEADLOCK, lines) + listed(FaultKind.PRECEDENCE, known.faults)


def _check_order(
    files: Sequence[HeadFile], plan: JointPlan, known: Knowledge, parts: list[Parts],
    walks: list[Walk],
) -> list[Fault]:  # fmt: skip
    """Check that the files order what the plan orders, set-up before it and end code behind."""
    lines = []
    heads = range(len(files))
    for h in heads:
        name = plan.heads[h].head
        first = next((line for line in walks[h].first if line > 0), parts[h].end_code)
        for g in heads:
            if g == h:
                continue
            other = plan.heads[g].head
            if g < h and known.done(h, parts[h].first, g) <= parts[g].parked:
                lines.append(f"head {name} sets up before head {other} is parked")
            if known.done(h, first, g) <= parts[g].parked:
                lines.append(f"head {name} begins before head {other} is parked")
            ended = max(walks[g].last, default=parts[g].parked)
            if known.done(h, parts[h].end_code, g) <= ended:
                lines.append(f"head {name} ends before head {other} has printed all it has to")
            if g == h - 1 and known.done(h, parts[h].end_code, g) < _last_end(files[g], parts[g]):
                lines.append(f"the end codes of heads {other} and {name} may run at once")
        lines += _unkept(plan, known, walks, h)
        lines += _unplanned(files, plan, parts, walks, h)
    return listed(FaultKind.PRECEDENCE, lines)


def _last_end(file: HeadFile, part: Parts) -> int:
    """Return the last line of a head's end code; 0 where it has none."""
    return file.rest[-1][0] if file.rest and part.end_code <= len(file.lines) else 0


def _unkept(plan: JointPlan, known: Knowledge, walks: list[Walk], h: int) -> list[str]:
    """Return the edges into one head that its waits do not keep, each held to its action's end."""
    lane, lines = plan.heads[h], []
    beyond = walks[h].last[-1] if walks[h].last else 0
    for k in range(len(lane)):
        first = next((line for line in walks[h].first[k:] if line > 0), beyond + 1)
        for g, a in lane.after(k):
            if g != h and known.done(h, first, g) <= walks[g].last[a]:
                lines.append(
                    f"head {lane.head} action {k} does not wait for action {a} of head "
                    f"{plan.heads[g].head}"
                )
    return lines


def _unplanned(
    files: Sequence[HeadFile], plan: JointPlan, parts: list[Parts], walks: list[Walk], h: int
) -> list[str]:
    """Return the waits of one head's body that stand for no edge of the plan."""
    given = {s.number: (g, s.line) for g, file in enumerate(files) for s in file.syncs if s.signal}
    low, high = _windows(walks[h], parts[h])
    lines = []
    for sync in files[h].syncs:
        if sync.signal or not parts[h].parked < sync.line < max(walks[h].last, default=0):
            continue
        g, line = given[sync.number]
        other_low, other_high = _windows(walks[g], parts[g])
        actions = range(bisect_right(high, sync.line), bisect_left(low, sync.line))
        ended = range(bisect_right(other_high, line) - 1, bisect_left(other_low, line) - 1)
        meant = {pair for k in actions for pair in plan.heads[h].after(k)}
        set_up = line < next((f for f in walks[g].first if f > 0), parts[g].end_code)
        if not set_up and not any((g, a) in meant for a in ended):
            lines.append(f"head {plan.heads[h].head} line {sync.line} waits where no plan does")
    return lines


def _windows(walk: Walk, part: Parts) -> tuple[list[int], list[int]]:
    """Return between which lines a sync point before each action, and behind the last, stands."""
    low = [part.parked, *walk.last]
    high = [part.end_code] * (len(walk.first) + 1)
    for k in range(len(walk.first) - 1, -1, -1):
        high[k] = walk.first[k] if walk.first[k] > 0 else high[k + 1]
    return low, high


def _text(code: bytes) -> str:
    return code[:60].decode("utf-8", "replace")
