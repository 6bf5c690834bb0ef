"""What one head's file must be by itself: its head's actions, between the source's commands.

Its moves must be the actions of its head, one after the other. All other commands must be the
source's, as far as they concern this head. What the files of all heads do together is judged in
`sim.heads.together`.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from decmcts.arrays import Floats
from decmcts.formats.gcode import GcodeDocument
from decmcts.print.job import DEFAULT_TRAVEL, PrintJob, ProcessSettings
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, HeadActions, JointPlan
from sim.content.arcs import check_arcs, turns_between, turns_of_print
from sim.content.inventory import FEED_TOLERANCE_MM_S
from sim.faults import Fault, FaultKind, listed
from sim.files.commands import accepted, is_move, known_settings, states_in_force
from sim.files.extent import check_filament_feeds
from sim.files.written import check_line_numbers
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
    check = _FileCheck(file, actions, job, document, machine)
    low, high, part = check.outline()
    kept: Settings = frozenset()
    if low and check.several:
        state = int(file.track.at(check.file.rest[low - 1][0]))
        kept = kept_settings(file.track.table, state)
    check.check_end(part, kept)
    blocks = check.take_blocks(low, high)
    taken = {line for lines in blocks for line in lines}
    check.check_left(part, taken)
    idling = Idling.of(check.head.idle, actions, job, check.tool, timed=not read)
    walk = Walker(
        check.file, actions, job, document, part.begin, part.end, taken, waited, idling.practice,
        kept,
    ).run()  # fmt: skip
    check.words += walk.faults
    known = set(taken)
    if walk.complete:
        check.check_blocks(blocks, walk)
        known |= check.check_heat(walk, part, low, taken, idling)
    check.check_foreign(low, part, known)
    part = replace(part, blocks=tuple(map(tuple, blocks)))
    return Walked(file, part, walk, check.faults(part, waited), idling)


class _FileCheck:
    """What one head's file has besides its head's moves; `words` gets what is wrong with it."""

    def __init__(
        self, file: HeadFile, actions: HeadActions, job: PrintJob, document: GcodeDocument,
        machine: Machine,
    ) -> None:  # fmt: skip
        self.file, self.actions, self.job, self.document = file, actions, job, document
        self.head, self.words = machine.head(actions.head), list[str]()
        self.prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
        tools = np.unique(job.contours.tool[actions.contour[self.prints]])
        self.tool = int(tools[0]) if len(tools) else None  # it prints with; None: it prints nothing
        self.several = len(np.unique(job.contours.tool)) > 1
        ends_with = self._selected(document.end.tool)
        self.ends_with_other = self.tool is not None and ends_with not in (None, self.tool)
        self.heat = heat_due(document, job)
        # what starts its tool, where the source starts it later than the others
        self.own = document.own_start(self.tool)
        self.own_of = partial(own_commands, tool=self.tool, all_heat=self.heat.one_hot_end)
        self.of_end = partial(
            self.own_of, homes=False, relative_e=document.end.relative_e, selected=ends_with,
            all_off=True,
        )  # fmt: skip

    def _selected(self, tool: int) -> int | None:
        """Return the tool in use, None where a source has but one."""
        return tool if self.several else None

    def outline(self) -> tuple[int, int, FileParts]:
        """Return the rows of `rest` below the set-up and at the end code, and all parts.

        First rows that heat what the start code heats anyway are left out of the file.
        """
        text = self.document.preamble + (b"" if self.own is None else self.own.text)
        start = self.own_of(text, homes=True, relative_e=False, selected=self._selected(0))
        file, due = self.file, self.of_end(self.document.postamble)
        early = heats_early(file.rest, next((sync.line for sync in file.syncs), 0), start)
        self.file = file = replace(file, rest=file.rest[early:], others=file.others[early:])
        low, parked = self._match_start(start)
        high = len(file.rest) - len(due)
        if high < low or [code for _, code in file.rest[high:]] != due:
            self.words.append("the end code is not the source's, command by command")
            high = max(low, min(high, len(file.rest)))
        end_code = file.rest[high][0] if high < len(file.rest) else len(file.lines) + 1
        before = file.motion.before
        begin, end = int(before[min(parked, len(file.lines))]), int(before[end_code - 1])
        first = file.rest[0][0] if file.rest else 1
        return low, high, FileParts(first, parked, end_code, begin, max(begin, end))

    def _match_start(self, start: list[bytes]) -> tuple[int, int]:
        """Return the row of `rest` below the set-up, and the line that reaches the park position.

        The head goes there up, across, and down where something printed is in between, and on the
        way stays above what is printed already.
        """
        file, words, park = self.file, self.words, self.head.park
        mode = b"M83" if self.document.start.relative_e else b"M82"
        row = 0
        for wanted in [*start, b"G90", mode]:
            has = file.rest[row][1] if row < len(file.rest) else b""
            if has != wanted:
                line = file.rest[row][0] if has else len(file.lines)
                due = f"the start code has '{_text(wanted)}' here"
                words.append(f"line {line}: '{_text(has)}', {due}")
                return row, line
            row += 1
        while row < len(file.rest) and _SETS_E.match(file.rest[row][1]):
            row += 1
        parked, stands = _stands(file, row + 2)
        printed = self.job.printed
        if printed is not None and stands[2] < float(printed.top.max()):
            words.append(f"line {parked}: the head goes to its park through what is printed")
        forms = [_UPRIGHT, _ACROSS]
        if stands[2] > park[2] + SAME_MM and np.abs(stands[:2] - park[:2]).max() <= SAME_MM:
            forms.append(_UPRIGHT)
            parked, stands = _stands(file, row + 3)
        words += _amiss_to_park(file, row, forms, self.job.settings)
        if np.abs(stands - np.array(park)).max() > SAME_MM:
            words.append(f"line {parked}: the head is not at its park position {park}")
        return min(row + len(forms), len(file.rest)), parked

    def check_end(self, part: FileParts, kept: Settings) -> None:
        """Compare the state and the filament with the source's where its end code begins.

        Comments of it too; below it may stand a signal that it has run, last of all and with an
        M400 of its own. Where the source ends with another head's tool, filament is not compared.
        What the source's first bead leaves retracted behind the start code may stay so: a head that
        prints nothing has no bead that makes up for it.
        """
        file, due = self.file, self.document.end
        below, last = part.end_code - 1, file.syncs[-1] if file.syncs else None
        if last is not None and last.signal and not (file.rest and file.rest[-1][0] > last.line):
            below = min(below, last.line - 2)
        begins = begin_of_verbatim(file.lines.raw, below, self.document.postamble, self.of_end)
        above = max(begins - 1, 0)
        modes, owed = file.motion.modes[above], float(file.motion.extruder[above, 1])
        left = max(0.0, *(start.pulled - start.owed for start in self.document.starts))
        differs = not -OWED_MM <= owed - due.pulled <= left + OWED_MM
        differs |= bool(modes[3]) != due.firmware_retracted
        words = list[str]()
        if not self.ends_with_other and differs:
            words.append(f"{owed:.3f} mm are retracted, in the source {due.pulled:.3f}")
        if bool(modes[1]) != due.relative_e:
            words.append("E is counted in another way")
        has = states_in_force(file.track.table, int(file.track.at(above + 1)))
        words += words_of(has, states_in_force(self.document.states, due.state), kept)
        self.words += [f"before the end code {text}" for text in words]

    def take_blocks(self, low: int, high: int) -> list[list[int]]:
        """Return the lines of each block that stands at a barrier, between these rows of `rest`."""
        printed = set(self.actions.contour[self.prints].tolist())
        commands = []
        for block in self.document.blocks:
            due = self.own_of(
                block.text, homes=False, relative_e=block.begin.relative_e,
                selected=self._selected(block.begin.tool),
                fed=not belongs_to_bead(block) or behind(block, self.job) in printed,
            )  # fmt: skip
            moved = [b"G90", b"M83" if block.end.relative_e else b"M82"]
            commands.append(due + moved if block.moves else due)
        firsts = {due[0] for due in commands if due}
        if not firsts:
            return [[] for _ in commands]
        codes, found = [code for _, code in self.file.rest], list[list[int]]()
        places: dict[bytes, list[int]] = {code: [] for code in firsts}
        for r in range(low, high):  # the rows of each command a block may begin with
            if codes[r] in places:
                places[codes[r]].append(r)
        for block, due in zip(self.document.blocks, commands, strict=True):
            found.append([])
            if not due:
                continue
            rows = places[due[0]]
            beyond = (rows[k] for k in range(bisect_left(rows, low), len(rows)))
            at = next((r for r in beyond if codes[r : r + len(due)] == due), -1)
            if at < 0:
                gone = f"'{_text(due[0])}' of the source's line {block.line} is not there"
                self.words.append(gone)
                continue
            low = at + len(due)
            found[-1] = [line for line, _ in self.file.rest[at:low]]
        return found

    def check_left(self, part: FileParts, taken: set[int]) -> None:
        """Check that nothing is pushed back at the end where the source pushes nothing."""
        if not self.ends_with_other or not taken:
            return
        owed = self.file.motion.extruder[:, 1]
        pushed = float(owed[max(taken) - 1] - owed[max(part.end_code - 2, 0)])
        if pushed > OWED_MM:
            text = f"{pushed:.3f} mm are pushed back at the end, in the source they stay retracted"
            self.words.append(text)

    def check_blocks(self, blocks: list[list[int]], walk: Walk) -> None:
        """Check that blocks stand between the beads they stand between in the source."""
        epoch = self.job.contours.epoch[self.actions.contour[self.prints]]
        prints, epoch = self.prints[np.argsort(epoch, kind="stable")], np.sort(epoch)
        ended = np.maximum.accumulate(np.array(walk.last, np.int64)[prints])
        begun = np.minimum.accumulate(np.array(walk.first, np.int64)[prints][::-1])[::-1]
        for block, lines in zip(self.document.blocks, blocks, strict=True):
            if not lines:
                continue
            k = int(np.searchsorted(epoch, block.epoch))
            above = int(ended[k - 1]) if k else 0
            below = int(begun[k]) if k < len(begun) else lines[-1]
            if above > lines[0] or below < lines[-1]:
                what = f"what the source has at its line {block.line} is moved"
                self.words.append(f"line {lines[0]}: {what}")

    def check_heat(
        self, walk: Walk, part: FileParts, low: int, taken: set[int], idling: Idling
    ) -> set[int]:
        """Check how hot it is where it prints or stands idle; return the lines of standby."""
        cursor = self.document.start if self.own is None else self.own.end
        not_pulled = max(0.0, cursor.owed - cursor.pulled)
        wrong, at_standby = check_idle(
            self.file, walk, part.parked, part.end_code, taken, idling, not_pulled
        )
        self.words += wrong
        if len(self.prints):
            first = walk.first[int(self.prints[0])]
            verbatim = {line for line, _ in self.file.rest[:low]} | taken
            self.words += unheated(self.file.rest, self.file.others, first, self.heat, verbatim)
        return at_standby

    def check_foreign(self, low: int, part: FileParts, known: set[int]) -> None:
        """Check what stands between contours, but for lines that are known."""
        file, settings = self.file, known_settings(self.document)
        begin = file.rest[low][0] if low < len(file.rest) else part.end_code
        for line, code in file.others:
            if not begin <= line < part.end_code or line in known or is_move(code):
                continue
            if not accepted(file.lines.raw(line - 1), settings):
                what = f"'{_text(code)}' is not in the source at this place"
                self.words.append(f"line {line}: {what}")

    def faults(self, part: FileParts, waited: Mapping[int, int]) -> list[Fault]:
        """Return all faults, arcs and feeds too; `waited` as `last_points`.

        It has the arcs of the contours it prints, and no other. Those within which it signals may
        come in parts.
        """
        file, actions = self.file, self.actions
        words = self.words + [f"line {sync.line}{w}" for sync in file.syncs for w in sync.amiss]
        seen = listed(FaultKind.COMMAND, words) + check_line_numbers(file.numbered)
        seen += check_filament_feeds(file.motion, self.document.moves, above=1)
        faults = [Fault(fault.kind, f"head {actions.head}, {fault.text}") for fault in seen]
        signals = np.isin(self.prints, list(waited))
        moved = actions.contour[self.prints[(actions.entry[self.prints] > 0) | signals]]
        due = turns_of_print(self.job, self.document).of(set(actions.contour[self.prints].tolist()))
        ours = turns_between(file.motion, part.begin, part.end)
        return faults + check_arcs(ours, due, set(moved.tolist()))


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


def _text(code: bytes) -> str:
    return code[:60].decode("utf-8", "replace")
