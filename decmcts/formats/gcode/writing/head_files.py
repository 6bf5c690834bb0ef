"""G-code per head: one file for each controller of a machine with several heads.

Every file is complete: the source's set-up commands, this head's contours with the planned paths
as they are, and the end. Moves that no plan checked are left out: purge lines, wipes at the end,
custom travel. A head is told what is said to its own tool (`own_lines`, `hot_ends`). Heads are set
up one after the other, and heat together. The end code, which turns off bed and motors, runs when
all heads are done.

A head retracts (and wipes along the bead it printed) before it says that a print has ended: what
it does afterwards is its next action's path and nothing else. Signals, waits and what idle heads do
are described in docs/gcode.md: a controller that ignores them must not run these files.

A file that takes a head to its park where a print was broken off has moves, and nothing else, in
the coordinates of the head's file of that print: no start code, homing, heating or filament.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO, TextIO

import numpy as np

from decmcts.formats.gcode.document import Cursor, GcodeDocument
from decmcts.formats.gcode.text.source_text import save_text
from decmcts.formats.gcode.writing.beads import BeadRows, Point
from decmcts.formats.gcode.writing.emitter import Emitter
from decmcts.formats.gcode.writing.head_refusals import only_tool, refuse_own_moves, refuse_points
from decmcts.formats.gcode.writing.hot_ends import (
    HeatTaken,
    HotEndTarget,
    early_heat,
    heat_taken_by_heads,
    heats,
    hot_end_commands,
)
from decmcts.formats.gcode.writing.own_header import with_header
from decmcts.formats.gcode.writing.own_lines import OwnFilament, feeds_one_bead, own_lines
from decmcts.formats.gcode.writing.sync_points import HeadWaits, SyncPoints, number_sync_points
from decmcts.formats.gcode.writing.writer import first_state, print_contour, prints_ahead
from decmcts.print.job import DEFAULT_TRAVEL, PrintJob, ProcessSettings
from decmcts.print.machine import Idle, Machine
from decmcts.print.plan import ActionKind, HeadActions, JointPlan
from decmcts.print.stands import primed_before, standby_in, stands_of
from decmcts.print.walls import walls_for

OVER_PRINTED_MM = 5.0  # above what stands on the bed already, from start code to the park position
_PRINT, _TRAVEL, _PARK, _WAIT = map(int, ActionKind)  # plain numbers compare faster


def write_head_gcode(
    document: GcodeDocument,
    job: PrintJob,
    plan: JointPlan,
    head_index: int,
    out: Path | str | BinaryIO | TextIO,
    *,
    machine: Machine,
    header_lines: Sequence[str] = (),
    points: SyncPoints | None = None,
) -> None:
    """Write the file of one head of a plan.

    Parameters
    ----------
    machine : Machine
        The plan's: the words of its synchronisation points, what its controllers can signal, and
        where each head parks and what it does where it stands idle.
    points : SyncPoints | None
        The plan's synchronisation points (`number_sync_points`), where they are known already.

    Raises
    ------
    InputError
        When the head would have to change tools, when it would have to signal what its
        controller cannot, when the source moves the head
        by commands of its own during the print, or when `out` cannot be written.
    """
    head, release = plan.heads[head_index], machine.release
    own = machine.head(head.head)
    refuse_own_moves(document, job)
    tool = only_tool(document, job, head)
    apart_s = machine.signal_interval_s if release == "point" else 0.0
    if points is None:
        points = number_sync_points(plan, job, release, apart_s)
    if release == "action":
        refuse_points(points, plan)
    emitter = Emitter(document, job.settings, walls_for(job))
    waits = HeadWaits(emitter, points, machine.words, head_index, apart_s)
    file = _HeadFileWriter(emitter, waits, job, head, tool, own.idle)
    place = f"head {head.head}, file {head_index + 1} of {len(plan.heads)}: to be run together"
    x, y, z = head.action_path(0)[0].tolist() if len(head) else own.park
    file.begin([*header_lines, place], (x, y, z))
    for k in range(len(head)):
        file.act(k)
    file.end()
    save_text(emitter.text(), out)


class _HeadFileWriter:
    """The file of one head while it is written."""

    def __init__(
        self, emitter: Emitter, waits: HeadWaits, job: PrintJob, head: HeadActions,
        tool: int | None, idle: Idle,
    ) -> None:  # fmt: skip
        self.emitter, self.waits, self.document = emitter, waits, emitter.document
        if tool is not None:
            emitter.use(tool)
        self.job, self.head, self.tool = job, head, tool
        self.blocks = list(self.document.blocks)
        shared = tool is not None and len(np.unique(job.contours.tool)) > 1
        self.filament = OwnFilament(emitter, self.document, tool, shared=shared)
        self.heat_taken = heat_taken_by_heads(self.document, job)
        self.beads = BeadRows.of(self.document, job)
        self.kinds: list[int] = head.kind.tolist()  # of the head's actions
        self.contours, self.epochs = head.contour.tolist(), job.contours.epoch.tolist()
        self.prints, self.ahead = set(self.contours), prints_ahead(head)
        self.idle, self.practice = idle, idle.over(job.practice(tool))
        self.stands = stands_of(head, waits.head, job.contours.epoch, idle.after_s)
        self.hot_end = HotEndTarget()
        self.primed: list[bool] = primed_before(head, idle.after_s).tolist()

    def begin(self, header: Sequence[str], park: Point) -> None:
        """Set up and go to the park position, one head after the other."""
        emitter, document, head = self.emitter, self.document, self.waits.head
        own_start = document.own_start(self.tool)  # where changes of tools are no walls
        text = document.preamble + (b"" if own_start is None else own_start.text)
        preamble = self._own(text, keep_homing=True, relative_e=False)
        self.filament.begin(preamble)
        heated = any(given.command.heats for given in hot_end_commands(document))
        emitter.cold = self.filament.shared and heated and not heats(preamble)
        first, rest = _split_first(with_header(preamble, header, document.newline), header)
        emitter.verbatim(first)
        if head > 0:
            for line in early_heat(rest):
                emitter.emit(line)
            self.waits.wait(head)
        emitter.verbatim(rest)
        self.hot_end.take(preamble)
        self._resume(document.start)
        self._park(park)
        self.waits.take_turn()

    def _park(self, park: Point) -> None:
        """Go to the park position, over what stands on the bed already."""
        emitter, printed = self.emitter, self.job.printed
        (x, y, z), z_feed = park, emitter.settings.z_feed or Z_FEED
        over = z if printed is None else max(z, float(printed.top.max()) + OVER_PRINTED_MM)
        emitter.emit(f"G1 Z{over:.3f} F{emitter.feed_word(z_feed)}")
        emitter.emit(f"G1 X{x:.3f} Y{y:.3f} F{emitter.feed_word(emitter.travel_feed)}")
        emitter.at, emitter.feed = park, emitter.travel_feed
        if over > z:
            emitter.emit(f"G1 Z{z:.3f} F{emitter.feed_word(z_feed)}")
            emitter.feed = z_feed

    def _resume(self, cursor: Cursor) -> None:
        """Set modes and E as the source has them, after lines of it were left out."""
        self.emitter.emit("G90")
        self.emitter.emit("M83" if cursor.relative_e else "M82")  # G90 may reset E too
        self._count_from(cursor)

    def _count_from(self, cursor: Cursor) -> None:
        """Set E as the source has it: what it stands at in this file is not known."""
        if not cursor.relative_e:
            self.emitter.e = np.inf
            self.emitter.set_e(cursor.e)

    def act(self, k: int) -> None:
        """Write action k with what it waits for and what it signals."""
        self._stand(k)
        passed, kind = self.waits.passed(k), self.kinds[k]
        if kind == _PRINT:
            self._print(k, passed)
        elif kind != _WAIT:
            if (ahead := self.ahead[k]) >= 0:
                state = first_state(self.beads, self.document, self.head, ahead)
                self.emitter.states.set_travel(state)
            self.emitter.travel(self._path(k), passed)
        self.waits.ended(k)

    def _stand(self, k: int) -> None:
        """Write what action k waits for; in a long stand filament is pulled back and may cool."""
        rested_s = 0.0
        if self.kinds[k] == _WAIT:
            rested_s = float(self.head.end_s[k]) - float(self.head.begin_s[k])
        hot, cold, standby = self.hot_end.degrees or 0.0, self.practice.standby_c, None
        if (stand := self.stands.get(k)) is not None:
            self.emitter.withdraw(self.practice.retract_mm)
            if hot and cold is not None and not self.emitter.cold:
                standby = standby_in(stand, hot - cold, self.idle)
        self.waits.stand(k, rested_s, standby, hot=hot, cold=cold or 0.0)

    def _print(self, k: int, passed: dict[int, str] | None) -> None:
        """Write what stands before a contour in the source's own lines, and the contour."""
        contour = self.contours[k]
        changed = self._cross(self.epochs[contour])
        if self.primed[k] and not changed:
            self.emitter.owed += self.practice.prime_mm
        self.filament.feed(contour)
        print_contour(
            self.emitter, self.beads, contour, [], is_reversed=bool(self.head.reversed[k]),
            entry=int(self.head.entry[k]), passed=passed,
        )  # fmt: skip
        self._retract_for(k + 1)

    def _path(self, k: int) -> list[Point]:
        return list(map(tuple, self.head.action_path(k).tolist()))

    def _retract_for(self, k: int) -> None:
        """Retract for action k before others may count on this head's way being clear.

        One that is going to rest retracts here too, for it must not wipe back later. So does one
        that waits for others before it goes on with the same bead: nobody knows for how long.
        """
        ahead = self.kinds[k : k + 2]
        waits = ahead[:1] == [_PRINT] and self.waits.any_before(k)
        if waits or ahead[:1] == [_WAIT] or ahead == [_TRAVEL, _WAIT]:
            self.emitter.retract()
        if ahead[:1] in ([_TRAVEL], [_PARK]):
            self.emitter.retract_for(self._path(k))

    def end(self) -> None:
        """Write what the source does at its end, without its moves, when all heads are done."""
        emitter, end = self.emitter, self.document.end
        self.waits.wait_for_all(len(self.kinds))
        self._cross(2**31)
        if not self.filament.is_other(end.tool):
            emitter.owe(end.owed, firmware=end.firmware_retracted, exact=True)
        emitter.states.set(end.state)
        emitter.set_e(end.e)
        heat_taken: HeatTaken = "all" if self.heat_taken == "all" else "off"
        text = self.document.postamble
        emitter.verbatim(
            self._own(text, relative_e=end.relative_e, tool=end.tool, heat_taken=heat_taken)
        )
        self.waits.pass_turn()

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
            spared = feeds_one_bead(block) and behind not in self.prints
            text = self._own(
                block.text, relative_e=begin.relative_e, tool=begin.tool, fed=not spared
            )
            self.filament.owe(block, text, spared=spared)
            emitter.states.set(begin.state)
            emitter.set_e(begin.e)
            emitter.verbatim(text)
            self.hot_end.take(text)
            emitter.cold = emitter.cold and not heats(text)
            self.filament.take(block, text, spared=spared, behind=behind)
            if block.moves:
                self._resume(block.end)
            elif begin.relative_e:  # E stood where this head had come
                self._count_from(block.end)
            emitter.at, emitter.feed = stood, -1.0 if block.moves else feed
        return changed

    def _own(
        self, text: bytes, *, relative_e: bool, keep_homing: bool = False, tool: int = 0,
        heat_taken: HeatTaken | None = None, fed: bool = True,
    ) -> bytes:  # fmt: skip
        """Return lines as this controller needs them; `tool` is in use above them."""
        return own_lines(
            text, self.tool, selected=tool if self.filament.shared else None, fed=fed,
            keep_homing=keep_homing, relative_e=relative_e, newline=self.document.newline,
            heat_taken=heat_taken or self.heat_taken,
        )  # fmt: skip


def _split_first(text: bytes, header: Sequence[str]) -> tuple[bytes, bytes]:
    """Return the opening comments (with our header) and the rest."""
    at = 0 if header or text[:1] == b";" else -1
    if header:
        at = text.find(header[-1].splitlines()[-1].encode("utf-8", "surrogateescape"))
    at = text.find(b"\n", at) + 1 if at >= 0 else 0
    return text[:at], text[at:]


Z_FEED = 10.0  # mm/s, where the source names none

AxisWords = tuple[float | None, float | None, float | None]  # where a move ends; None: as it was


def park_gcode(
    comments: Sequence[str], moves: Sequence[AxisWords], settings: ProcessSettings, newline: bytes
) -> bytes:
    """Return the text of a file with these comments and moves; settings have the feeds."""
    z_feed, feed = settings.z_feed or Z_FEED, settings.travel_feed or DEFAULT_TRAVEL
    lines = [*(f"; {comment}" for comment in comments), "G21 ; mm", "G90 ; absolute"]
    for words in moves:
        named = [f"{axis}{at:.3f}" for axis, at in zip("XYZ", words, strict=True) if at is not None]
        lines.append(f"G1 {' '.join(named)} F{(z_feed if words[2] is not None else feed) * 60:.0f}")
    lines.append("M400")
    return b"".join(line.encode("utf-8", "surrogateescape") + newline for line in lines)
