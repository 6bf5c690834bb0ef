"""Files of several heads judged together against the plan they were made from.

Each file is read back. Its moves must be its head's actions, one after the other. All other
commands must be the source's, as far as they concern this head. The sync points of all files
together must order what the plan orders (`sim.heads.order`), so a single file proves nothing.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from decmcts.errors import InputError
from decmcts.formats.gcode import GcodeDocument
from decmcts.print.idle import Idle
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine, Release
from decmcts.print.plan import ActionKind, HeadActions, JointPlan
from decmcts.print.sync_words import USUAL_WORDS, SyncWords
from sim.arrays import Floats
from sim.content.arcs import Turns, check_arcs, turns_between, turns_of_print
from sim.faults import Fault, FaultKind, Verdict, listed
from sim.files.command_book import check_heads_book
from sim.files.commands import accepted, is_move, known_settings
from sim.files.extent import check_filament_feeds
from sim.files.written import check_line_numbers, moves_of, source_text
from sim.heads.changes import check_hot_ends
from sim.heads.file import HeadFile, begin_of_verbatim, own_commands, read_head_file
from sim.heads.heat import heat_due, heats_early, unheated
from sim.heads.idle import Idling, check_idle
from sim.heads.laid import SAME_MM
from sim.heads.ledger import Printed, behind, belongs_to_bead, check_filament, dues_of
from sim.heads.order import FileParts, Intervals, check_order, check_sync, last_points
from sim.heads.states import Settings, differing, kept_settings
from sim.heads.sync import Knowledge
from sim.heads.walk import OWED_MM, Walk, Walker
from sim.heads.words import check_words

Point = tuple[float, float, float]


def verify_heads(
    paths: Sequence[Path | str | HeadFile],
    plan: JointPlan,
    job: PrintJob,
    document: GcodeDocument,
    *,
    parks: Sequence[Point],
    release: Release = "action",
    interval_s: float = 0.0,
    words: SyncWords = USUAL_WORDS,
    idles: Sequence[Idle] | None = None,
    read: bool = False,
) -> Verdict:
    """Check the files of all heads of a plan, in the plan's order of heads.

    Parameters
    ----------
    paths : sequence of paths or files
        Which may be read already.
    job, document
        The source the plan was made from.
    parks : sequence of points
        Where each head stands before its first action.
    release : "point" or "action"
        Whether the machine's controllers can signal in motion.
    interval_s : float
        The least time between two signals of a head, where they signal in motion.
    words : SyncWords
        The lines with which the machine's files signal and wait.
    idles : sequence of Idle | None
        What each head does where it stands idle; None: as the source.
    read : bool
        Whether the plan was read from these files (`sim.heads.plan`).
    """
    try:
        files = [one if isinstance(one, HeadFile) else read_head_file(one, words) for one in paths]
    except InputError as error:
        return unreadable(error)
    if faults := check_names(files, plan):
        return Verdict(tuple(faults))
    walked = []
    for h, (file, park) in enumerate(zip(files, parks, strict=True)):
        idle = Idle() if idles is None else idles[h]
        walked.append(walk_file(file, h, plan, job, document, park, idle, read=read))
    return judge_together(
        walked, plan, job, document, release=release, interval_s=interval_s, words=words, read=read
    )


def verify_heads_on(
    machine: Machine, paths: Sequence[Path | str | HeadFile], plan: JointPlan, job: PrintJob,
    document: GcodeDocument, *, read: bool = False,
) -> Verdict:  # fmt: skip
    """Check the files of all heads of a plan for a machine, as `verify_heads` does."""
    heads = [machine.head(actions.head) for actions in plan.heads]
    return verify_heads(
        paths, plan, job, document, parks=[head.park for head in heads], release=machine.release,
        interval_s=machine.signal_interval_s, words=machine.words,
        idles=[head.idle for head in heads], read=read,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Walked:
    """One head's file walked along its actions."""

    file: HeadFile
    part: FileParts
    walk: Walk
    faults: list[Fault]
    idling: Idling


def unreadable(error: InputError) -> Verdict:
    """Return the verdict on files of which one cannot be read."""
    return Verdict((Fault(FaultKind.STATE, f"a file cannot be read back: {error}"),))


def walk_file(
    file: HeadFile, head: int, plan: JointPlan, job: PrintJob, document: GcodeDocument, park: Point,
    idle: Idle, *, read: bool = False,
) -> Walked:  # fmt: skip
    """Check all that one head's file has by itself; the order between files is checked later."""
    actions, waited = plan.heads[head], last_points(plan, head)
    due, tool = heat_due(document, job), _tool_of(actions, job)
    idling = Idling.of(idle, actions, head, job, tool, timed=not read)
    words: list[str] = []
    own_of = partial(own_commands, tool=tool, all_heat=due.one_hot_end)
    more = document.own_start(tool)
    begins_with = document.preamble + (b"" if more is None else more.text)
    start = own_of(begins_with, homes=True, relative_e=False, selected=_selected(job, 0))
    waits = next((sync.line for sync in file.syncs), 0)
    early, whole = heats_early(file.rest, waits, start), file
    file = replace(file, rest=file.rest[early:], others=file.others[early:])
    over = -np.inf if job.printed is None else float(job.printed.top.max())
    low, parked = _match_start(file, document, start, park, words, over)
    own_end = partial(
        own_of, homes=False, relative_e=document.end.relative_e,
        selected=_selected(job, document.end.tool), all_off=True,
    )  # fmt: skip
    ending = own_end(document.postamble)
    high = len(file.rest) - len(ending)
    if high < low or [code for _, code in file.rest[high:]] != ending:
        words.append("the end code is not the source's, command by command")
        high = max(low, min(high, len(file.rest)))
    beyond = len(file.lines) + 1
    end_code = file.rest[high][0] if high < len(file.rest) else beyond
    begin = int(file.motion.before[min(parked, len(file.lines))])
    end = int(file.motion.before[min(end_code, beyond) - 1])
    part = FileParts(file.rest[0][0] if file.rest else 1, parked, end_code, begin, max(begin, end))
    others = tool is not None and _selected(job, document.end.tool) not in (None, tool)
    begins = begin_of_verbatim(
        file.lines.raw, min(end_code, _below_end(file)) - 1, document.postamble, own_end
    )
    kept: Settings = frozenset()
    if low and len(np.unique(job.contours.tool)) > 1:
        kept = kept_settings(file.track.table, int(file.track.at(file.rest[low - 1][0])))
    words += _check_end(file, document, begins, kept, others=others)
    printed = set(actions.contour[actions.kind == ActionKind.PRINT].tolist())
    theirs = [
        own_of(
            b.text,
            homes=False,
            relative_e=b.begin.relative_e,
            selected=_selected(job, b.begin.tool),
            fed=not belongs_to_bead(b) or behind(b, job) in printed,
        )
        for b in document.blocks
    ]
    blocks = _take_blocks(file, document, theirs, low, high, words)
    part = replace(part, blocks=tuple(map(tuple, blocks)))
    taken = {line for found in blocks for line in found}
    if others and taken:
        words += _check_left(file, max(taken), end_code)
    walk = Walker(
        file,
        actions,
        job,
        document,
        part.begin,
        part.end,
        taken,
        waited,
        idling.practice,
        kept,
    ).run()
    words += walk.faults
    words += _check_blocks(file, actions, job, document, blocks, walk)
    at_standby = set[int]()
    if walk.complete:
        cursor = document.start if more is None else more.end
        not_pulled = max(0.0, cursor.owed - cursor.pulled)
        wrong, at_standby = check_idle(file, walk, parked, end_code, taken, idling, not_pulled)
        words += wrong
    if walk.complete and tool is not None:
        prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
        own = {line for line, _ in file.rest[:low]} | taken
        words += unheated(file.rest, file.others, walk.first[int(prints[0])], due, own)
    begins_body = file.rest[low][0] if low < len(file.rest) else beyond
    last = end_code if high < len(file.rest) else beyond
    words += _foreign(file, document, range(begins_body, last), taken | at_standby)
    words += [f"line {sync.line}{what}" for sync in file.syncs for what in sync.amiss]
    where = f"head {actions.head}, "
    faults = listed(FaultKind.COMMAND, [where + text for text in words])
    seen = check_line_numbers(file.numbered) + _check_feeds(file, document)
    faults += [Fault(fault.kind, where + fault.text) for fault in seen]
    faults += _check_arcs(file, part, actions, waited, turns_of_print(job, document))
    return Walked(whole, part, walk, faults, idling)


def _check_feeds(file: HeadFile, document: GcodeDocument) -> list[Fault]:
    """Check the feeds of filament alone; those of travels and beads are compared on the walk."""
    source = moves_of(document)
    return [] if source is None else check_filament_feeds(file.motion, source, above=1)


def _tool_of(actions: HeadActions, job: PrintJob) -> int | None:
    """Return the tool that a head prints with first; None: it prints nothing."""
    tools = np.unique(job.contours.tool[actions.contour[actions.kind == ActionKind.PRINT]])
    return int(tools[0]) if len(tools) else None


def judge_together(
    walked: Sequence[Walked], plan: JointPlan, job: PrintJob, document: GcodeDocument, *,
    release: Release, interval_s: float, words: SyncWords, read: bool = False,
) -> Verdict:  # fmt: skip
    """Check what the files of all heads do together; of each the faults found so far come first."""
    files, parts = [each.file for each in walked], [each.part for each in walked]
    if named := check_names(files, plan):
        return Verdict(tuple(named))
    walks = [each.walk for each in walked]
    faults = [fault for each in walked for fault in each.faults]
    complete = all(walk.complete for walk in walks)
    if complete:
        faults += _check_filament(walked, plan, job, document)
    if (source := source_text(document)) is not None:
        faults += check_heads_book([file.lines.text for file in files], source)
        if document.own_starts and complete:
            laid = [(each.file, each.walk.laid) for each in walked]
            faults += check_hot_ends(laid, source, job, document)
    known = Knowledge([file.syncs for file in files])
    faults += check_words(words, release) + check_sync(files, known, release)
    intervals = Intervals(files, interval_s if release == "point" else 0.0)
    faults += intervals.check()
    if complete and not known.stuck:
        faults += check_order(files, plan, known, parts, walks, intervals, read=read)
    signals = sum(len(file.syncs) for file in files)
    return Verdict(tuple(faults), {"files": float(len(files)), "signals": float(signals)})


def _check_filament(
    walked: Sequence[Walked], plan: JointPlan, job: PrintJob, document: GcodeDocument
) -> list[Fault]:
    """Check what all files give against what the source gives, by tool and between beads."""
    source = moves_of(document)
    if source is None or not len(job.contours):
        return []
    heads = []
    for each, actions in zip(walked, plan.heads, strict=True):
        part, laid, idling = each.part, each.walk.laid, each.idling
        if laid:
            tool = int(job.contours.tool[laid[0].contour])
            practice = idling.practice
            heads.append(
                Printed(
                    actions.head, each.file, tool, part.begin, laid, part.blocks, part.end,
                    practice.prime_mm, idling.primed, practice.retract_mm,
                    idling.pulled_before(actions),
                )
            )  # fmt: skip
    return check_filament(heads, dues_of(source, job, document), job, document)


def _check_arcs(
    file: HeadFile, part: FileParts, actions: HeadActions, waited: Mapping[int, int], arcs: Turns
) -> list[Fault]:
    """Check that a head's file has the arcs of the contours it prints, and no other.

    Those within which it signals may come in parts (`waited`, of actions).
    """
    prints = actions.kind == ActionKind.PRINT
    told = np.isin(np.arange(len(actions)), list(waited))
    moved = set(actions.contour[prints & ((actions.entry > 0) | told)].tolist())
    due = arcs.of(set(actions.contour[prints].tolist()))
    return check_arcs(turns_between(file.motion, part.begin, part.end), due, moved)


def check_names(files: Sequence[HeadFile], plan: JointPlan) -> list[Fault]:
    """Check that there is one file for each head, and that each says so."""
    if len(files) != len(plan.heads):
        there = {file.name for file in files}
        absent = ", ".join(actions.head for actions in plan.heads if actions.head not in there)
        text = f"{len(files)} files for {len(plan.heads)} heads; name the files of all heads"
        return [Fault(FaultKind.FILE, text + (f", that of {absent} too" if absent else ""))]
    lines = []
    for k, (file, actions) in enumerate(zip(files, plan.heads, strict=True)):
        if file.name != actions.head or file.place != (k + 1, len(files)):
            says = f"head {file.name}, file {file.place[0]} of {file.place[1]}"
            lines.append(
                f"{Path(file.path).name} says it is for {says if file.name else 'no head'}, it "
                f"should be for head {actions.head}, file {k + 1} of {len(files)}"
            )
    return listed(FaultKind.COMMAND, lines)


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
    file: HeadFile, document: GcodeDocument, start: list[bytes], park: Point, words: list[str],
    over: float,
) -> tuple[int, int]:  # fmt: skip
    """Return the row of `rest` below the set-up, and the line that reaches the park position.

    On the way there the head stays above `over`, the top of what is printed already. Writes what
    is wrong into `words`.
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
    while row < len(file.rest) and file.rest[row][1].startswith(b"G92 E"):  # as decmcts writes it
        row += 1
    row += 2  # up, then across
    parked, stands = _stands(file, row)
    if stands[2] < over:
        words.append(f"line {parked}: the head goes to its park through what is printed")
    if stands[2] > park[2] + SAME_MM and np.abs(stands[:2] - park[:2]).max() <= SAME_MM:
        row += 1  # and down, where something printed is in between
        parked, stands = _stands(file, row)
    if np.abs(stands - np.array(park)).max() > SAME_MM:
        words.append(f"line {parked}: the head is not at its park position {park}")
    return min(row, len(file.rest)), parked


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
    words += differing(file.track.table, state, document.states, end.state, kept)
    return [f"before the end code {text}" for text in words]


def _below_end(file: HeadFile) -> int:
    """Return the first line (from 1) below the end code: a signal that it has run, if it is last.

    Such a signal has an M400 of its own.
    """
    beyond, last = len(file.lines) + 1, file.syncs[-1] if file.syncs else None
    if last is None or not last.signal or any(line > last.line for line, _ in file.rest[-1:]):
        return beyond
    return last.line - 1


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
    file: HeadFile, actions: HeadActions, job: PrintJob, document: GcodeDocument,
    blocks: list[list[int]], walk: Walk,
) -> list[str]:  # fmt: skip
    """Return the blocks that do not stand between the beads they stand between in the source."""
    if not walk.complete:
        return []
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
