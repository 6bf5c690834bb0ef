"""G-code per head: one file for each controller of a machine with several heads.

Every file is complete: the source's set-up commands, this head's contours with
the planned paths as they are, and the end. Heads share the bed, so moves that
no plan checked are left out: purge lines, wipes at the end, custom travel. Of a
source with several tools a head is told what is said to its own: temperatures and moves
of filament alone, by the tool they name or the one selected there. All heads are told what
heats the one hot end of a source (`decmcts.formats.gcode.writing.hot_ends`), and what switches hot
ends off in the end code. Heads are set up one after the other, and heat together: a head that
waits for its turn is told before how hot bed and hot end are to be, and waits for them in its turn.
A head retracts (and wipes along the bead it printed) before it says that a print has ended: what it
does afterwards is its next action's path and nothing else. The end code, which turns off bed and
motors, runs when all heads are done.

Where the plan orders actions of different heads the files hold

    M400
    SYNC_SIGNAL N=7      ; number 7 is reached, give it to the other controllers
    SYNC_WAIT N=7        ; do not go on before number 7 was given

Numbers are the same in all files of a plan. M400 lets the moves before it end first. A wait
has none: nothing behind it is read before it is over, so the moves above it run out. Where the
machine's controllers can `release` points, a head says between two moves, or behind the last
move of an action, without M400,

    SYNC_PASSED N=8      ; number 8 is reached when the move before this line has ended

This must neither stop the head nor run before the move above it has ended (docs/gcode.md). Such
heads stop only to signal where they have not moved.

The waiting head dwells behind its waits for as long as its lags ask, whenever the signal came:
files keep no time among each other. It dwells too, retracted, where the plan rests for cooling.

Where a head stands idle for long it is pulled back further, may cool to standby, and is heated
again by the clock before it has to go on (`decmcts.print.stands`):

    G1 E-9.2 F2400
    M400
    M104 S170
    G4 P93000            ; so long by the plan, less what heating takes
    M104 S210
    SYNC_WAIT N=7
    M109 S210

The commands are macros the machine's host provides; a machine may have other words for them
(`decmcts.print.sync_words`). A controller that ignores them must not run these files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, TextIO

import numpy as np

from decmcts.errors import InputError
from decmcts.formats.gcode.dialects.dialect import IDLE_MARK, UNKNOWN, WAIT_MARK
from decmcts.formats.gcode.document import Block, Cursor, GcodeDocument
from decmcts.formats.gcode.text.lines import command_of
from decmcts.formats.gcode.text.source_text import save_text
from decmcts.formats.gcode.writing.beads import Beads, Point
from decmcts.formats.gcode.writing.emitter import Emitter
from decmcts.formats.gcode.writing.hot_ends import (
    Hears,
    HotEndTold,
    early_heat,
    heats,
    refuse_cold,
    source_heats,
    told_to,
)
from decmcts.formats.gcode.writing.own_header import with_header
from decmcts.formats.gcode.writing.own_lines import owed_after, own_lines, pushed_by_moves, pushes
from decmcts.formats.gcode.writing.sync_points import SyncPoints, number_sync_points, refuse_words
from decmcts.formats.gcode.writing.writer import print_contour
from decmcts.print.idle import Idle
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine, Release
from decmcts.print.plan import ActionKind, HeadActions, JointPlan
from decmcts.print.stands import Stand, Standby, primed_before, standby_in, stands_of
from decmcts.print.sync_words import USUAL_WORDS, SyncWords, said
from decmcts.print.walls import walls_for

USUAL_IDLE = Idle()
PRIMES_MM = 0.1  # of filament; less primes nothing
LONGEST_DWELL_S = 600.0  # of one G4
OVER_PRINTED_MM = 5.0  # above what stands on the bed already, from start code to the park position
_PRINT, _TRAVEL, _PARK, _WAIT = map(int, ActionKind)  # plain numbers compare faster
_MOVES_ALONE = ("homing", "bed probing", "unknown macro", "filament change")
_NAMED_STATE = re.compile(r"M(221|900)(?= ).* T\d", re.I)
_ORIGIN = re.compile(rb"^[ \t]*+(?:N\d++[ \t]*+)?G92(?![0-9.])[^;(\n]*[XYZ][^\n]*", re.I | re.M)


def write_head_gcode(
    document: GcodeDocument,
    job: PrintJob,
    plan: JointPlan,
    head_index: int,
    out: Path | str | BinaryIO | TextIO,
    *,
    header_lines: Sequence[str] = (),
    words: SyncWords = USUAL_WORDS,
    park: tuple[float, float, float] | None = None,
    release: Release = "action",
    interval_s: float = 0.0,
    points: SyncPoints | None = None,
    idle: Idle = USUAL_IDLE,
) -> None:
    """Write the file of one head of a plan.

    Parameters
    ----------
    park : tuple of float | None
        Where the head stands while it has no action; needed where it has none
        at all, since homing leaves it where no plan looked.
    words : SyncWords
        The lines of synchronisation points.
    release : "point" or "action"
        What the machine's controllers can signal.
    interval_s : float
        The least time between two signals of a head, where they signal points.
    points : SyncPoints | None
        The plan's synchronisation points (`number_sync_points`), where they are known already.
    idle : Idle
        What the head does where it stands idle.

    Raises
    ------
    InputError
        When the head would have to change tools, when it would have to signal what its
        controller cannot, when the source moves the head
        by commands of its own during the print, or when `out` cannot be written.
    """
    text = head_gcode_bytes(
        document, job, plan, head_index, header_lines=header_lines, words=words,
        park=park, release=release, interval_s=interval_s, points=points, idle=idle,
    )  # fmt: skip
    save_text(text, out)


def head_gcode_bytes(
    document: GcodeDocument,
    job: PrintJob,
    plan: JointPlan,
    head_index: int,
    *,
    header_lines: Sequence[str] = (),
    words: SyncWords = USUAL_WORDS,
    park: tuple[float, float, float] | None = None,
    release: Release = "action",
    interval_s: float = 0.0,
    points: SyncPoints | None = None,
    idle: Idle = USUAL_IDLE,
) -> bytes:
    """Return what `write_head_gcode` writes."""
    head = plan.heads[head_index]
    _refuse_own_moves(document, job)
    tool = _only_tool(document, job, head)
    home = tuple(head.action_path(0)[0].tolist()) if len(head) else park
    if home is None:
        raise InputError(f"head {head.head} has nothing to do and no park position is given")
    apart_s = interval_s if release == "point" else 0.0
    if points is None:
        points = number_sync_points(plan, job, release, apart_s)
    if release == "action":
        _refuse_points(points, plan)
    file = _HeadFile(document, job, head_index, head, tool, points, words, apart_s, idle)
    file.prints.update(head.contour[head.kind == ActionKind.PRINT].tolist())
    header = [
        *header_lines,
        f"head {head.head}, file {head_index + 1} of {len(plan.heads)}: to be run together",
    ]
    file.begin(header, len(plan.heads), home)
    for k in range(len(head)):
        file.act(k)
    file.end(len(head))
    return file.emitter.text()


def _refuse_points(points: SyncPoints, plan: JointPlan) -> None:
    for h, action in points.passed:
        raise InputError(
            f"head {plan.heads[h].head} would have to signal within action {action}, "
            "in motion, and the machine's controllers only do so at rest",
            advice='plan for its release "action", or set release = "point" in the machine file',
        )


def refuse_for_heads(document: GcodeDocument, job: PrintJob, machine: Machine) -> None:
    """Raise InputError where no files of several heads can be written, whatever the plan.

    So before any plan: moves of the source's own, lines that would be read as sync points, heads
    that may print with more than one tool of the source, and tools that would print cold.
    """
    refuse_words(document, machine.words)
    _refuse_own_moves(document, job)
    _refuse_named_states(document)
    tools = np.unique(job.contours.tool).tolist()
    for head in machine.heads:
        _refuse_tools(document, head.name, [t for t in tools if not head.tools or t in head.tools])
    refuse_cold(document, job)


def unprimed_note(document: GcodeDocument) -> str | None:
    """Return the line to say where start code primes the nozzle by moves, which are left out."""
    pushed = pushed_by_moves(document.preamble, document.path)
    if pushed < PRIMES_MM:
        return None
    return (
        f"the source's start code extrudes {pushed:.1f} mm of filament on the bed; heads share the "
        "bed, so it is left out: prime each head before its file is run, or in the start code by "
        "E alone"
    )


def _only_tool(document: GcodeDocument, job: PrintJob, head: HeadActions) -> int | None:
    """Return the tool a head prints with; None when it prints nothing."""
    printed = head.contour[head.kind == ActionKind.PRINT]
    tools = np.unique(job.contours.tool[printed]).tolist()
    _refuse_tools(document, head.head, tools)
    return int(tools[0]) if tools else None


def _refuse_tools(document: GcodeDocument, head: str, tools: list[int]) -> None:
    if len(tools) > 1:
        raise InputError(
            f"head {head} would print with tools {', '.join(map(str, tools))}; a head of "
            "several has one tool",
            path=document.path,
            advice=f"leave {head} one of them (`tools` of the machine file), others to other heads",
        )


def _refuse_named_states(document: GcodeDocument) -> None:
    """Raise InputError for what sets a state of a tool by its name: a head has but one."""
    for text in document.states.values:
        if _NAMED_STATE.match(text):
            rows = document.preamble.decode("utf-8", "surrogateescape").split("\n")
            at = next((k for k, row in enumerate(rows, 1) if row.startswith(text)), None)
            raise InputError(
                f"'{text}' names the tool whose setting it is, and a head of several has one",
                path=document.path,
                line=at,
                advice="leave its T out",
            )


def _refuse_own_moves(document: GcodeDocument, job: PrintJob) -> None:
    for barrier in job.barriers:
        if barrier.reason in _MOVES_ALONE:
            raise InputError(
                f"'{barrier.text}' ({barrier.reason}) may move the head while another prints",
                path=document.path,
                line=barrier.line,
                advice="remove it from the slicer's custom G-code for a machine with several heads",
            )
    if place := _ORIGIN.search(document.preamble):
        text = place.group(0).decode("utf-8", "replace").strip()
        raise InputError(
            f"'{text}' sets a position that moves left out of a head's file have led to",
            path=document.path,
            advice="remove it from the start G-code for a machine with several heads",
        )


class _HeadFile:
    """The file of one head while it is written."""

    def __init__(
        self,
        document: GcodeDocument,
        job: PrintJob,
        index: int,
        head: HeadActions,
        tool: int | None,
        points: SyncPoints,
        words: SyncWords,
        apart_s: float,
        idle: Idle,
    ) -> None:
        self.emitter = Emitter(document, job.settings, walls_for(job))
        if tool is not None:
            self.emitter.use(tool)
        self.document, self.job, self.index, self.tool = document, job, index, tool
        self.points, self.words, self.apart_s = points, words, apart_s
        self.blocks = list(document.blocks)
        self.shared = tool is not None and len(np.unique(job.contours.tool)) > 1
        self.told = told_to(document, job)
        self.left = 0.0  # filament retracted, mm, when the source left this head's tool
        self.own_start = document.own_start(tool)  # where changes of tools are no walls
        self.start = document.start if self.own_start is None else self.own_start.end
        changes = (b for b in document.blocks if b.begin.tool != b.end.tool == tool)
        self.first_use = next(changes, None) if self._is_other(self.start.tool) else None
        self.beads = Beads.of(document, job)
        self.head = head
        self.kinds: list[int] = head.kind.tolist()  # of the head's actions
        self.contours, self.epochs = head.contour.tolist(), job.contours.epoch.tolist()
        self.reversed, self.entries = head.reversed.tolist(), head.entry.tolist()
        self.begins_s, self.ends_s = head.begin_s.tolist(), head.end_s.tolist()
        sizes, laid = np.diff(head.path_offsets), head.kind == ActionKind.PRINT
        self.bounds = np.concatenate([[0], np.cumsum(np.where(laid, 0, sizes))]).tolist()
        self.path: list[Point] = list(map(tuple, head.path[~np.repeat(laid, sizes)].tolist()))
        self.prints: set[int] = set()  # contours
        self.due: dict[int, float] = {}  # filament, mm, to be pushed for contours behind blocks
        self.idle, self.practice = idle, idle.over(job.practice(tool))
        self.stands = stands_of(head, index, job.contours.epoch, idle.after_s)
        self.hot_end = HotEndTold()
        self.primed: list[bool] = primed_before(head, idle.after_s).tolist()

    def begin(self, header: Sequence[str], n_heads: int, park: tuple[float, float, float]) -> None:
        """Set up and go to the park position, one head after the other."""
        emitter, document = self.emitter, self.document
        text = document.preamble + (b"" if self.own_start is None else self.own_start.text)
        preamble = self._own(text, keep_homing=True, relative_e=False)
        # moves are left out, so it is counted anew what is retracted
        emitter.owed = self._owed_after(preamble, 0.0, 0.0, relative_e=False)
        emitter.cold = self.shared and source_heats(document) and not heats(preamble)
        if self._is_other(document.start.tool):
            emitter.firmware_retracted = False
        self.left = emitter.owed
        if not self._is_other(self.start.tool):
            emitter.owed += self.start.owed - self.start.pulled
        elif self.first_use is not None:  # so it is not retracted once more until then
            emitter.owed += self.first_use.end.owed - self.first_use.end.pulled
        first, rest = _split_first(with_header(preamble, header, document.newline), header)
        emitter.verbatim(first)
        if self.index > 0:
            for line in early_heat(rest):
                emitter.say(line)
            self._wait(self.index)
        emitter.verbatim(rest)
        self.hot_end.take(preamble)
        self._resume(document.start)
        (x, y, z), z_feed = park, (emitter.settings.z_feed or 10.0) * 60
        over = max(z, self._over_printed())
        emitter.say(f"G1 Z{over:.3f} F{z_feed:.0f}")
        emitter.say(f"G1 X{x:.3f} Y{y:.3f} F{emitter.travel_feed * 60:.0f}")
        if over > z:
            emitter.say(f"G1 Z{z:.3f} F{z_feed:.0f}")
        emitter.at, emitter.feed = (x, y, z), emitter.travel_feed
        if n_heads > 1:
            self._signal(self.index + 1)
            if self.index + 1 < n_heads:
                self._wait(n_heads)

    def _over_printed(self) -> float:
        """Return the height at which a head clears what stands on the bed already, mm."""
        printed = self.job.printed
        return -np.inf if printed is None else float(printed.top.max()) + OVER_PRINTED_MM

    def _resume(self, cursor: Cursor) -> None:
        """Set modes and E as the source has them, after lines of it were left out."""
        emitter = self.emitter
        emitter.say("G90")
        emitter.say("M83" if cursor.relative_e else "M82")  # G90 resets E too in some firmwares
        self._count_from(cursor)

    def _count_from(self, cursor: Cursor) -> None:
        """Set E as the source has it: what it stands at in this file is not known."""
        if not cursor.relative_e:
            self.emitter.e = np.inf
            self.emitter.set_e(cursor.e)

    def act(self, k: int) -> None:
        """Write action k with what it waits for and what it signals."""
        place = self.index, k
        self._stand(k)
        passed: dict[int, str] | None = None
        if (given := self.points.passed.get(place)) is not None:
            passed = {p: self._said(self.words.passed, number) for p, number in given.items()}
        kind = self.kinds[k]
        if kind == _PRINT:
            self._print(k, passed)
        elif kind != _WAIT:
            self.emitter.travel(self._path(k), passed)
        if (number := self.points.signals.get(place, 0)) > 0:
            self._end_of(k, number)

    def _stand(self, k: int) -> None:
        """Write what action k waits for, and for how long the head stands before it."""
        stand, place = self.stands.get(k), (self.index, k)
        numbers, lag_s = self.points.waits.get(place, ()), self.points.lags.get(place, 0.0)
        rested_s = self.ends_s[k] - self.begins_s[k] if self.kinds[k] == _WAIT else 0.0
        rests = None if stand is None else self._withdraw(stand)
        hot, standby = self.hot_end.degrees, self.practice.standby_c
        if rests is None or hot is None or standby is None:
            self._wait_for(numbers, lag_s, rested_s)
            return
        heat = f"S{hot:g}"
        self.emitter.say("M400")
        self.emitter.say(f"M104 S{standby:g} {IDLE_MARK}")
        if not rests.behind:
            self._dwell(rests.cool_s, IDLE_MARK)
            self.emitter.say(f"M104 {heat}")
            self._wait_for(numbers, lag_s, rested_s)
        else:
            self._wait_for(numbers, rests.cool_s)
            self.emitter.say(f"M104 {heat}")
            self._dwell(rests.heat_s)
        self.emitter.say(f"M109 {heat}")

    def _withdraw(self, stand: Stand) -> Standby | None:
        """Pull the filament back for a stand; return how the hot end cools in it."""
        self.emitter.withdraw(self.practice.retract_mm)
        hot, standby = self.hot_end.degrees, self.practice.standby_c
        if hot is None or standby is None or self.emitter.cold:
            return None
        return standby_in(stand, hot - standby, self.idle)

    def _wait_for(self, numbers: Sequence[int], *seconds: float) -> None:
        """Wait for numbers, and stand still behind them."""
        for number in numbers:
            self._wait(number)
        for part in seconds:
            self._dwell(part)

    def _print(self, k: int, passed: Mapping[int, str] | None) -> None:
        """Write what stands before a contour in the source's own lines, and the contour."""
        emitter, contour = self.emitter, self.contours[k]
        changed = self._cross(self.epochs[contour])
        if self.primed[k] and not changed:
            emitter.owed += self.practice.prime_mm
        emitter.owed += self.due.pop(contour, 0.0)
        print_contour(
            emitter, self.beads, contour, [], is_reversed=self.reversed[k], entry=self.entries[k],
            passed=passed,
        )  # fmt: skip
        self._retract_for(k + 1)

    def _path(self, k: int) -> list[Point]:
        """Return the path of an action that prints nothing."""
        return self.path[self.bounds[k] : self.bounds[k + 1]]

    def _end_of(self, k: int, number: int) -> None:
        """Signal that an action has ended, without a stop where the controllers can."""
        if (self.index, k) in self.points.at_rest:
            self._stand_apart(k)
            self._signal(number)
        else:
            self.emitter.say(self._said(self.words.passed, number))

    def _stand_apart(self, k: int) -> None:
        """Stand still before a signal at rest that is too near to the one before."""
        if (self.index, k) in self.points.apart:
            self._dwell(self.apart_s)

    def _dwell(self, seconds: float, mark: str = WAIT_MARK) -> None:
        """Stand still, in as many parts as controllers take."""
        while seconds > 0.0:
            part = min(seconds, LONGEST_DWELL_S)
            self.emitter.dwell(part, mark)
            seconds -= part

    def _retract_for(self, k: int) -> None:
        """Retract for action k before others may count on this head's way being clear.

        One that is going to rest retracts here too, for it must not wipe back later. So does one
        that waits for others before it goes on with the same bead: nobody knows for how long.
        """
        ahead = self.kinds[k : k + 2]
        waits = ahead[:1] == [_PRINT] and (self.index, k) in self.points.waits
        if waits or ahead[:1] == [_WAIT] or ahead == [_TRAVEL, _WAIT]:
            self.emitter.retract()
        if ahead[:1] in ([_TRAVEL], [_PARK]):
            self.emitter.retract_for(self._path(k))

    def end(self, count: int) -> None:
        """Write what the source does at its end, without its moves, when all heads are done.

        `count` is the number of its actions.
        """
        emitter, end, points = self.emitter, self.document.end, self.points
        if len(points.done) > 1:
            self._stand_apart(count)
            self._signal(points.done[self.index])
            for number in points.done[: self.index] + points.done[self.index + 1 :]:
                self._wait(number)
            if self.index > 0:
                self._wait(points.ended[self.index - 1])
            if self.index + 1 < len(points.ended):
                self._dwell(self.apart_s)  # a signal stands below the end code, too
        self._cross(2**31)
        if not self._is_other(end.tool):
            emitter.owe(end.owed, firmware=end.firmware_retracted)
        emitter.set_state(end.state)
        emitter.set_e(end.e)
        told: Hears = "all" if self.told == "all" else "off"
        text = self.document.postamble
        own = self._own(
            text, keep_homing=False, relative_e=end.relative_e, tool=end.tool, told=told
        )
        emitter.verbatim(own)
        if self.index + 1 < len(points.ended):
            self._signal(points.ended[self.index])

    def _cross(self, epoch: int) -> bool:
        """Write the blocks of all epochs up to `epoch`, without their moves.

        Returns whether tools change in some of them.
        """
        changed = False
        while self.blocks and self.blocks[0].epoch <= epoch:
            block = self.blocks.pop(0)
            changed |= "tool change" in block.reasons
            emitter, begin = self.emitter, block.begin
            stood, feed = emitter.at, emitter.feed
            behind = int(np.searchsorted(self.job.contours.epoch, block.epoch))
            spares = _feeds_one_bead(block) and behind not in self.prints
            text = self._own(
                block.text, keep_homing=False, relative_e=begin.relative_e, tool=begin.tool,
                fed=not spares,
            )  # fmt: skip
            if spares:
                pass  # what is pushed and pulled here is for a bead of another head
            elif not self._is_other(begin.tool):
                emitter.owe(begin.owed, firmware=begin.firmware_retracted)
            elif pushes(text):
                emitter.owe(self.left, firmware=emitter.firmware_retracted)
            emitter.set_state(begin.state)
            emitter.set_e(begin.e)
            emitter.verbatim(text)
            self.hot_end.take(text)
            emitter.cold = emitter.cold and not heats(text)
            self._take(block, text, spares=spares, behind=behind)
            if block.moves:
                self._resume(block.end)
            elif begin.relative_e:  # E stood where this head had come
                self._count_from(block.end)
            emitter.at, emitter.feed = stood, -1.0 if block.moves else feed
        return changed

    def _take(self, block: Block, text: bytes, *, spares: bool, behind: int) -> None:
        """Take over from a block; what moves left out have retracted is not this head's.

        What the source pushes behind it, beyond what it shows retracted, is for the contour
        behind it, or, where a command may have pulled unseen, for the head that has run it.
        """
        emitter, owed = self.emitter, self.emitter.owed
        pulled = emitter.firmware_retracted
        emitter.take(block.end)
        emitter.owed = self._owed_after(
            text, owed, block.begin.e, relative_e=block.begin.relative_e
        )
        if spares or self._is_other(block.end.tool):
            emitter.firmware_retracted = pulled
        if not self._is_other(block.begin.tool):
            self.left = emitter.owed
        beyond = block.end.owed - block.end.pulled
        if _feeds_one_bead(block):
            self.due[behind] = beyond
        elif (
            block is not self.first_use
            and not self._is_other(block.end.tool)
            and (block.moves or block.begin.tool != block.end.tool or _commands(text))
        ):
            emitter.owed += beyond

    def _owed_after(self, text: bytes, owed: float, e: float, *, relative_e: bool) -> float:
        return owed_after(text, owed, e=e, relative_e=relative_e, e_area=self.document.e_area)

    def _is_other(self, tool: int) -> bool:
        """Tell whether a tool is another head's."""
        return self.shared and tool != self.tool

    def _said(self, line: str, number: int) -> str:
        return said(line, number, *self.points.given[number])

    def _signal(self, number: int) -> None:
        """Signal at rest."""
        self.emitter.say("M400")
        self.emitter.say(self._said(self.words.signal, number))

    def _wait(self, number: int) -> None:
        """Wait for a number; the moves above run out by themselves."""
        self.emitter.say(self._said(self.words.wait, number))

    def _own(
        self, text: bytes, *, keep_homing: bool, relative_e: bool, tool: int = 0,
        told: Hears | None = None, fed: bool = True,
    ) -> bytes:  # fmt: skip
        """Return lines as this controller needs them; `tool` is in use above them."""
        return own_lines(
            text, self.tool, selected=tool if self.shared else None, keep_homing=keep_homing,
            relative_e=relative_e, newline=self.document.newline, told=told or self.told, fed=fed,
        )  # fmt: skip


def _feeds_one_bead(block: Block) -> bool:
    """Tell whether what a block does with filament is for the bead behind it, and no other.

    Not where something may move filament unseen, or tools change: each head that has these lines
    does so with its own filament.
    """
    return not UNKNOWN.union({"tool change"}).intersection(block.reasons)


def _commands(text: bytes) -> bool:
    """Tell whether some of these lines command anything."""
    return any(map(command_of, text.split(b"\n")))


def _split_first(text: bytes, header: Sequence[str]) -> tuple[bytes, bytes]:
    """Return the opening comments (with our header) and the rest."""
    at = 0 if header or text[:1] == b";" else -1
    if header:
        at = text.find(header[-1].splitlines()[-1].encode("utf-8", "surrogateescape"))
    at = text.find(b"\n", at) + 1 if at >= 0 else 0
    return text[:at], text[at:]
