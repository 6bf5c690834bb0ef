"""What one head's file must be by itself: its head's actions, between the source's commands.

Its moves must be the actions of its head, one after the other. All other commands must be the
source's, as far as they concern this head. What the files of all heads do together is judged in
`sim.heads.together`.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from decmcts.formats.gcode import GcodeDocument
from decmcts.formats.gcode.document import OwnStart
from decmcts.print.job import DEFAULT_TRAVEL, PrintJob, ProcessSettings
from decmcts.print.machine import Machine, Point
from decmcts.print.plan import ActionKind, HeadActions, JointPlan
from sim.arrays import Floats
from sim.content.arcs import Turns, check_arcs, turns_between, turns_of_print
from sim.content.inventory import FEED_TOLERANCE_MM_S
from sim.faults import Fault, FaultKind, listed
from sim.files.commands import accepted, is_move, known_settings
from sim.files.extent import check_filament_feeds
from sim.files.written import check_line_numbers, states_in_force
from sim.heads.changes import behind, belongs_to_bead
from sim.heads.file import (
    SAME_MM,
    FileParts,
    HeadFile,
    Settings,
    begin_of_verbatim,
    kept_settings,
    own_commands,
    words_of,
)
from sim.heads.heat import heat_due, heats_early, unheated
from sim.heads.idle import Idling, check_idle
from sim.heads.walk import OWED_MM, Walk, Walker, last_points

_NUMBER = rb"-?[0-9.]+"
_SETS_E = re.compile(rb"G92 E%b\Z" % _NUMBER)  # and no other axis
_UPRIGHT = re.compile(rb"G1 Z%b F[0-9.]+\Z" % _NUMBER)
_ACROSS = re.compile(rb"G1 X%b Y%b F[0-9.]+\Z" % (_NUMBER, _NUMBER))
UPRIGHT_FEED = 10.0  # mm/s to the park, where the source moves in Z alone at no feed of its own


@dataclass(frozen=True, slots=True)
class Walked:
    """One head's file walked along its actions."""

    file: HeadFile
    part: FileParts
    walk: Walk
    faults: list[Fault]
    idling: Idling


def walk_file(
    file: HeadFile, head: int, plan: JointPlan, job: PrintJob, document: GcodeDocument,
    machine: Machine, *, read: bool = False,
) -> Walked:  # fmt: skip
    """Check all that one head's file has by itself; the order between files is checked later."""
    actions, waited = plan.heads[head], last_points(plan, head)
    own = machine.head(actions.head)
    tool, heat = _tool_of(actions, job), heat_due(document, job)
    idling = Idling.of(own.idle, actions, job, tool, timed=not read)
    due = _DueCommands.of(actions, job, document, tool, all_heat=heat.one_hot_end)
    whole, words = file, list[str]()
    early = heats_early(file.rest, next((sync.line for sync in file.syncs), 0), due.start)
    file = replace(file, rest=file.rest[early:], others=file.others[early:])
    low, high, part = _outlined(file, job, document, due, own.park, words)
    others = tool is not None and _selected(job, document.end.tool) not in (None, tool)
    kept: Settings = frozenset()
    if low and len(np.unique(job.contours.tool)) > 1:
        kept = kept_settings(file.track.table, int(file.track.at(file.rest[low - 1][0])))
    begins = _begin_of_end(file, document, due, part)
    words += _check_end(file, document, begins, kept, others=others)
    blocks = _take_blocks(file, document, due.blocks, low, high, words)
    taken = {line for lines in blocks for line in lines}
    if others and taken:
        words += _check_left(file, max(taken), part.end_code)
    walk = Walker(
        file, actions, job, document, part.begin, part.end, taken, waited, idling.practice, kept
    ).run()
    words += walk.faults
    at_standby = set[int]()
    if walk.complete:
        words += _check_blocks(actions, job, document, blocks, walk)
        cursor = document.start if due.own is None else due.own.end
        not_pulled = max(0.0, cursor.owed - cursor.pulled)
        wrong, at_standby = check_idle(
            file, walk, part.parked, part.end_code, taken, idling, not_pulled
        )
        words += wrong
        if tool is not None:
            first = walk.first[int(np.flatnonzero(actions.kind == ActionKind.PRINT)[0])]
            verbatim = {line for line, _ in file.rest[:low]} | taken
            words += unheated(file.rest, file.others, first, heat, verbatim)
    body = file.rest[low][0] if low < len(file.rest) else part.end_code
    words += _foreign(file, document, range(body, part.end_code), taken | at_standby)
    words += [f"line {sync.line}{what}" for sync in file.syncs for what in sync.amiss]
    where = f"head {actions.head}, "
    faults = listed(FaultKind.COMMAND, [where + text for text in words])
    seen = check_line_numbers(file.numbered)
    seen += check_filament_feeds(file.motion, document.moves, above=1)
    faults += [Fault(fault.kind, where + fault.text) for fault in seen]
    part = replace(part, blocks=tuple(map(tuple, blocks)))
    faults += _check_arcs(file, part, actions, waited, turns_of_print(job, document))
    return Walked(whole, part, walk, faults, idling)


@dataclass(frozen=True, slots=True)
class _DueCommands:
    """The commands of the source that one head's file must have."""

    own: OwnStart | None  # what starts its tool, where the source starts it later than the others
    start: list[bytes]
    blocks: list[list[bytes]]  # of each block at a barrier
    end: list[bytes]
    of_end: Callable[[bytes], list[bytes]]  # those of lines of the end code

    @classmethod
    def of(
        cls, actions: HeadActions, job: PrintJob, document: GcodeDocument, tool: int | None, *,
        all_heat: bool,
    ) -> _DueCommands:  # fmt: skip
        """Find them; with `all_heat` temperatures that name no tool are for every head."""
        own_of = partial(own_commands, tool=tool, all_heat=all_heat)
        own = document.own_start(tool)
        text = document.preamble + (b"" if own is None else own.text)
        start = own_of(text, homes=True, relative_e=False, selected=_selected(job, 0))
        printed = set(actions.contour[actions.kind == ActionKind.PRINT].tolist())
        blocks = [
            own_of(
                block.text, homes=False, relative_e=block.begin.relative_e,
                selected=_selected(job, block.begin.tool),
                fed=not belongs_to_bead(block) or behind(block, job) in printed,
            )
            for block in document.blocks
        ]  # fmt: skip
        of_end = partial(
            own_of, homes=False, relative_e=document.end.relative_e,
            selected=_selected(job, document.end.tool), all_off=True,
        )  # fmt: skip
        return cls(own, start, blocks, of_end(document.postamble), of_end)


def _outlined(
    file: HeadFile,
    job: PrintJob,
    document: GcodeDocument,
    due: _DueCommands,
    park: Point,
    words: list[str],
) -> tuple[int, int, FileParts]:
    """Return where the parts of a file begin; writes what is wrong with them into `words`.

    First the rows of `rest` below the set-up and at which the end code begins.
    """
    low, parked = _match_start(file, job, document, due.start, park, words)
    high = len(file.rest) - len(due.end)
    if high < low or [code for _, code in file.rest[high:]] != due.end:
        words.append("the end code is not the source's, command by command")
        high = max(low, min(high, len(file.rest)))
    end_code = file.rest[high][0] if high < len(file.rest) else len(file.lines) + 1
    before = file.motion.before
    begin, end = int(before[min(parked, len(file.lines))]), int(before[end_code - 1])
    first = file.rest[0][0] if file.rest else 1
    return low, high, FileParts(first, parked, end_code, begin, max(begin, end))


def _begin_of_end(
    file: HeadFile, document: GcodeDocument, due: _DueCommands, part: FileParts
) -> int:
    """Return the row at which the source's end code begins, comments of it too.

    Below it may stand a signal that it has run, last of all and with an M400 of its own.
    """
    above, last = part.end_code - 1, file.syncs[-1] if file.syncs else None
    if last is not None and last.signal and not (file.rest and file.rest[-1][0] > last.line):
        above = min(above, last.line - 2)
    return begin_of_verbatim(file.lines.raw, above, document.postamble, due.of_end)


def _tool_of(actions: HeadActions, job: PrintJob) -> int | None:
    tools = np.unique(job.contours.tool[actions.contour[actions.kind == ActionKind.PRINT]])
    return int(tools[0]) if len(tools) else None


def _check_arcs(
    file: HeadFile, part: FileParts, actions: HeadActions, waited: Mapping[int, int], arcs: Turns
) -> list[Fault]:
    """Check that a head's file has the arcs of the contours it prints, and no other.

    Those within which it signals may come in parts (`waited`, of actions).
    """
    prints = actions.kind == ActionKind.PRINT
    signals = np.isin(np.arange(len(actions)), list(waited))
    moved = set(actions.contour[prints & ((actions.entry > 0) | signals)].tolist())
    due = arcs.of(set(actions.contour[prints].tolist()))
    return check_arcs(turns_between(file.motion, part.begin, part.end), due, moved)


def _foreign(
    file: HeadFile, document: GcodeDocument, lines: range, known: set[int]
) -> Iterator[str]:
    """Yield what may not stand between contours, in these lines but for those that are known."""
    settings = known_settings(document)
    for line, code in file.others:
        if line not in lines or line in known:
            continue
        if not (is_move(code) or accepted(file.row(line), settings)):
            yield f"line {line}: '{_text(code)}' is not in the source at this place"


def _selected(job: PrintJob, tool: int) -> int | None:
    """Return the tool in use, None where a source has but one."""
    return tool if len(np.unique(job.contours.tool)) > 1 else None


def _match_start(
    file: HeadFile, job: PrintJob, document: GcodeDocument, start: list[bytes], park: Point,
    words: list[str],
) -> tuple[int, int]:  # fmt: skip
    """Return the row of `rest` below the set-up, and the line that reaches the park position.

    The head goes there up, across, and down where something printed is in between, and on the way
    stays above what is printed already. Writes what is wrong into `words`.
    """
    mode = b"M83" if document.start.relative_e else b"M82"
    due = [*start, b"G90", mode]
    row = 0
    for wanted in due:
        has = file.rest[row][1] if row < len(file.rest) else b""
        if has != wanted:
            line = file.rest[row][0] if has else len(file.lines)
            words.append(f"line {line}: '{_text(has)}', the start code has '{_text(wanted)}' here")
            return row, line
        row += 1
    while row < len(file.rest) and _SETS_E.match(file.rest[row][1]):
        row += 1
    parked, stands = _stands(file, row + 2)
    over = -np.inf if job.printed is None else float(job.printed.top.max())
    if stands[2] < over:
        words.append(f"line {parked}: the head goes to its park through what is printed")
    forms = [_UPRIGHT, _ACROSS]
    if stands[2] > park[2] + SAME_MM and np.abs(stands[:2] - park[:2]).max() <= SAME_MM:
        forms.append(_UPRIGHT)
        parked, stands = _stands(file, row + 3)
    words += _amiss_to_park(file, row, forms, job.settings)
    if np.abs(stands - np.array(park)).max() > SAME_MM:
        words.append(f"line {parked}: the head is not at its park position {park}")
    return min(row + len(forms), len(file.rest)), parked


def _amiss_to_park(
    file: HeadFile, row: int, forms: list[re.Pattern[bytes]], settings: ProcessSettings
) -> Iterator[str]:
    """Yield what is wrong with the moves to the park position, from a row of `rest` on."""
    feeds = {
        _UPRIGHT: settings.z_feed or UPRIGHT_FEED,
        _ACROSS: settings.travel_feed or DEFAULT_TRAVEL,
    }
    for form, (line, code) in zip(forms, file.rest[row:], strict=False):
        if not form.match(code):
            yield f"line {line}: '{_text(code)}' on the way to the park, which is up, then across"
            continue
        feed = float(file.motion.feed[file.motion.before[line - 1]])
        if abs(feed - feeds[form]) > FEED_TOLERANCE_MM_S:
            yield f"line {line}: to the park at {feed:.3f} mm/s, {feeds[form]:.3f} are due"


def _stands(file: HeadFile, row: int) -> tuple[int, Floats]:
    """Return the line above a row of `rest`, and where the head stands behind it, (3,) mm."""
    line = file.rest[min(row, len(file.rest)) - 1][0]
    return line, file.motion.points[file.motion.before[min(line, len(file.lines))]]


def _check_end(
    file: HeadFile, document: GcodeDocument, begins: int, kept: Settings, *, others: bool
) -> list[str]:
    """Return how the state and the filament differ from the source's where its end code begins.

    That is at row `begins`. With `others` the source ends with another head's tool, and filament
    is not compared. What the source's first bead leaves retracted behind the start code may stay
    so: a head that prints nothing has no bead that makes up for it.
    """
    above, end = begins - 1, document.end
    modes, owed = file.motion.modes[max(above, 0)], float(file.motion.extruder[max(above, 0), 1])
    words = []
    left = max(0.0, *(start.pulled - start.owed for start in document.starts))
    more = owed - end.pulled
    differs = not -OWED_MM <= more <= left + OWED_MM or bool(modes[3]) != end.firmware_retracted
    if not others and differs:
        words.append(f"{owed:.3f} mm are retracted, in the source {end.pulled:.3f}")
    if bool(modes[1]) != end.relative_e:
        words.append("E is counted in another way")
    state = int(file.track.at(max(above, 0) + 1))
    has = states_in_force(file.track.table, state)
    words += words_of(has, states_in_force(document.states, end.state), kept)
    return [f"before the end code {text}" for text in words]


def _check_left(file: HeadFile, last: int, end_code: int) -> list[str]:
    """Return a line if filament is pushed back after line `last`, where the source pushes none."""
    owed = file.motion.extruder[:, 1]
    pushed = float(owed[last - 1] - owed[max(end_code - 2, 0)])
    if pushed <= OWED_MM:
        return []
    return [f"{pushed:.3f} mm are pushed back at the end, in the source they stay retracted"]


def _take_blocks(
    file: HeadFile, document: GcodeDocument, commands: list[list[bytes]], low: int, high: int,
    words: list[str],
) -> list[list[int]]:  # fmt: skip
    """Return the lines of each block that stands at a barrier; adds missing ones to `words`."""
    found: list[list[int]] = []
    if not any(commands) and not any(block.moves for block in document.blocks):
        return [[] for _ in commands]
    codes = [code for _, code in file.rest]
    firsts = {code[0] for code in commands if code} | {b"G90"}
    places: dict[bytes, list[int]] = {code: [] for code in firsts}
    for r in range(low, high):  # the rows of each command a block may begin with
        if codes[r] in places:
            places[codes[r]].append(r)
    for block, own in zip(document.blocks, commands, strict=True):
        due = list(own)
        if block.moves:
            due += [b"G90", b"M83" if block.end.relative_e else b"M82"]
        if not due:
            found.append([])
            continue
        rows = places.get(due[0], [])
        beyond = (rows[k] for k in range(bisect_left(rows, low), len(rows)))
        at = next((r for r in beyond if codes[r : r + len(due)] == due), -1)
        if at < 0:
            words.append(f"'{_text(due[0])}' of the source's line {block.line} is not there")
            found.append([])
            continue
        found.append([line for line, _ in file.rest[at : at + len(due)]])
        low = at + len(due)
    return found


def _check_blocks(
    actions: HeadActions, job: PrintJob, document: GcodeDocument, blocks: list[list[int]],
    walk: Walk,
) -> list[str]:  # fmt: skip
    """Return the blocks that do not stand between the beads they stand between in the source."""
    words = []
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
    epoch = job.contours.epoch[actions.contour[prints]]
    prints = prints[np.argsort(epoch, kind="stable")]
    epoch = np.sort(epoch)
    ended = np.maximum.accumulate(np.array(walk.last, np.int64)[prints])
    begun = np.minimum.accumulate(np.array(walk.first, np.int64)[prints][::-1])[::-1]
    for block, lines in zip(document.blocks, blocks, strict=True):
        if not lines:
            continue
        k = int(np.searchsorted(epoch, block.epoch))
        above = int(ended[k - 1]) if k else 0
        below = int(begun[k]) if k < len(begun) else lines[-1]
        if above > lines[0] or below < lines[-1]:
            words.append(f"line {lines[0]}: what the source has at its line {block.line} is moved")
    return words


def _text(code: bytes) -> str:
    return code[:60].decode("utf-8", "replace")
