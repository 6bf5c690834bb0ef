"""Lines of a source as one head of several runs them: no unplanned moves, no other tools.

Of a source with several tools a head's controller gets temperatures of hot ends and moves of
filament alone only where they are of its own tool: the one they name, else the one selected.
Of temperatures that name none it may get more, see `decmcts.formats.gcode.writing.hot_ends`.

What is retracted behind such lines is counted anew, by the E words that are left of them.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from decmcts.formats.gcode.controller.motion import interpret
from decmcts.formats.gcode.controller.moves_kernels import LAST_TOOL
from decmcts.formats.gcode.dialects.dialect import UNKNOWN
from decmcts.formats.gcode.dialects.stated_times import without_progress
from decmcts.formats.gcode.document import Block, Cursor, GcodeDocument
from decmcts.formats.gcode.text.lines import commands_of, split_lines
from decmcts.formats.gcode.writing.emitter import Emitter
from decmcts.formats.gcode.writing.hot_ends import OWN, HeatTaken, hot_end_command, selected_by

MOVE = re.compile(rb"^\s*G0*[0123](?![0-9.])(?=[^;(]*[XYZIJ])", re.I)
FILAMENT = re.compile(rb"^\s*G0*(?:[01](?![0-9.])(?=[^;(]*E)|1[01](?![0-9.])(?![^;(]*L))", re.I)
E_WORD = re.compile(rb"^[^;(]*?E\s*([-+]?[0-9.]+)", re.I)
_E_MODE = re.compile(rb"^\s*(M8[23]|G9[01])(?![0-9.])", re.I)
_SETS_E = re.compile(rb"^\s*G92(?![0-9.])[^;(]*E", re.I)
_HOMING = re.compile(rb"^\s*G2[89](?![0-9.])", re.I)
_FOR_TOOL = re.compile(
    rb"^(\s*(?!M0*(?:20[1-5]|593)(?![0-9.])|[MG]\d++\.)[MG]\d[^;]*?)(?:(?<!\s)\s++|(?<=[0-9.]))T(\d++)(?=[\s;A-Z(]|$)",
    re.I,
)


class OwnFilament:
    """What a head has retracted as the source's lines go by; keeps its emitter's count."""

    def __init__(
        self, emitter: Emitter, document: GcodeDocument, tool: int | None, *, shared: bool
    ):
        self.emitter, self.document, self.tool, self.shared = emitter, document, tool, shared
        own_start = document.own_start(tool)
        self._start = document.start if own_start is None else own_start.end
        changes = (b for b in document.blocks if b.begin.tool != b.end.tool == tool)
        self._first_use = next(changes, None) if self.is_other(self._start.tool) else None
        self._left = 0.0  # mm retracted when the source left this head's tool
        self._due: dict[int, float] = {}  # mm to be pushed for contours behind blocks

    def is_other(self, tool: int) -> bool:
        """Tell whether a tool is another head's."""
        return self.shared and tool != self.tool

    def begin(self, preamble: bytes) -> None:
        """Take the start code as this head runs it."""
        emitter = self.emitter
        emitter.owed = self._owed_after(preamble, 0.0, 0.0, relative_e=False)
        if self.is_other(self.document.start.tool):
            emitter.firmware_retracted = False
        self._left = emitter.owed
        if not self.is_other(self._start.tool):
            emitter.owed += _beyond(self._start)
        elif self._first_use is not None:  # so it is not retracted once more until then
            emitter.owed += _beyond(self._first_use.end)

    def owe(self, block: Block, text: bytes, *, spared: bool) -> None:
        """Retract as the source has where a block begins; `text` is what stays of it.

        With `spared` what is pushed and pulled there is for a bead of another head.
        """
        if spared:
            return
        if not self.is_other(block.begin.tool):
            self.emitter.owe(block.begin.owed, firmware=block.begin.firmware_retracted)
        elif any(map(FILAMENT.match, text.splitlines())):
            self.emitter.owe(self._left, firmware=self.emitter.firmware_retracted)

    def take(self, block: Block, text: bytes, *, spared: bool, behind: int) -> None:
        """Take over from a block; what moves left out have retracted is not this head's.

        What the source pushes behind it, beyond what it shows retracted, is for the contour
        `behind` it, or, where a command may have pulled unseen, for the head that has run it.
        """
        emitter, owed, begin = self.emitter, self.emitter.owed, block.begin
        pulled = emitter.firmware_retracted
        emitter.take(block.end)
        emitter.owed = self._owed_after(text, owed, begin.e, relative_e=begin.relative_e)
        if spared or self.is_other(block.end.tool):
            emitter.firmware_retracted = pulled
        if not self.is_other(begin.tool):
            self._left = emitter.owed
        if feeds_one_bead(block):
            self._due[behind] = _beyond(block.end)
        elif (
            block is not self._first_use
            and not self.is_other(block.end.tool)
            and (block.moves or begin.tool != block.end.tool or commands_of(text))
        ):
            emitter.owed += _beyond(block.end)

    def feed(self, contour: int) -> None:
        """Count what the blocks above a contour have left to be pushed for it."""
        self.emitter.owed += self._due.pop(contour, 0.0)

    def _owed_after(self, text: bytes, owed: float, e: float, *, relative_e: bool) -> float:
        """Return how much, mm, is retracted behind lines above which `owed` is, and E at `e`.

        E is in mm³ where it is volumetric.
        """
        for line in text.splitlines():
            relative_e = relative_after(line, relative_e)
            word = E_WORD.match(line)
            if word and _SETS_E.match(line):
                e = float(word[1])
            elif word and FILAMENT.match(line):
                to = float(word[1]) + (e if relative_e else 0.0)
                owed, e = max(0.0, owed - (to - e) / (self.document.e_area or 1.0)), to
        return owed


def _beyond(cursor: Cursor) -> float:
    """Return what the source pushes from there to the next contour beyond what it has retracted."""
    return cursor.owed - cursor.pulled


def feeds_one_bead(block: Block) -> bool:
    """Tell whether what a block does with filament is for the bead behind it, and no other.

    Not where something may move filament unseen, or tools change: each head that has these lines
    does so with its own filament.
    """
    return not UNKNOWN.union({"tool change"}).intersection(block.reasons)


def pushed_by_moves(text: bytes, path: Path | str) -> float:
    """Return the filament, mm, that the moves of start code along an axis push: purge lines."""
    lines = split_lines(text, path)
    motion = interpret(lines)
    moves = [bool(MOVE.match(lines.raw(line))) for line in motion.line.tolist()]
    return float(motion.extrusion[np.array(moves, np.bool_) & (motion.extrusion > 0.0)].sum())


def relative_after(line: bytes, relative_e: bool) -> bool:
    """Return how E counts after a line: M82, M83 and, as in Marlin, G90 and G91 say so."""
    mode = _E_MODE.match(line)
    return relative_e if mode is None else mode.group(1).upper() in (b"M83", b"G91")


def own_lines(
    text: bytes,
    tool: int | None,
    *,
    selected: int | None,
    keep_homing: bool = False,
    relative_e: bool,
    newline: bytes,
    heat_taken: HeatTaken = OWN,
    fed: bool = True,
) -> bytes:
    """Return lines as a head's controller needs them; what is left out stays as a comment.

    Parameters
    ----------
    tool : int | None
        What the head prints with; None: nothing.
    selected : int | None
        The tool in use above the lines; None: the source has one tool, or the head prints none.
    relative_e : bool
        How E counts above the lines.
    heat_taken : HeatTaken
        Of temperatures that name no tool, which the head takes while another is selected.
    fed : bool
        Whether what moves filament alone is this head's.
    """
    kept: list[bytes] = []
    for line in without_progress(text):
        relative_e = relative_after(line, relative_e)
        others = selected is not None and selected != tool
        moves = MOVE.match(line) or (not keep_homing and _HOMING.match(line))
        if moves or ((others or not fed) and FILAMENT.match(line)):
            why = b"another head's tool" if others else b"another head's bead"
            why = b"heads share the bed" if moves else why
            kept.append(b"; left out, " + why + b": " + line)
            if (e := E_WORD.match(line)) and not relative_e:  # later E words count from here
                kept.append((b"" if line.endswith(b"\n") else newline) + b"G92 E" + e.group(1))
                kept.append(newline)
        elif (chosen := selected_by(line)) is not None:
            selected = None if selected is None else chosen
            kept.append(b"; left out, one tool: " + line)
        else:
            kept.append(_for_own_tool(line, tool, heat_taken if others else None))
    return b"".join(kept)


def _for_own_tool(line: bytes, tool: int | None, heat_taken: HeatTaken | None) -> bytes:
    """Return a command without the tool it names, as a comment if that is another head's.

    `heat_taken` is given where another tool is selected.
    """
    named = _FOR_TOOL.match(line)
    if named and int(named.group(2)) > LAST_TOOL:  # degrees, say
        named = None
    if named and (tool is None or int(named.group(2)) == tool):
        return named.group(1) + line[named.end() :]
    command = hot_end_command(line) if heat_taken in ("own", "off") else None
    is_others = command is not None and (heat_taken == "own" or command.heats)
    return b"; left out, another head's tool: " + line if named or is_others else line
