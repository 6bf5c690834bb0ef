"""A source of several tools as those heads print it that are left, each with one tool.

Where one tool is left, its head's own text is the text of the print: what the source says to other
tools is left out, as in the files of heads (`own_lines`), and so are changes of tools. What another
tool should have printed may be printed with it: such a contour keeps its place, filament and feed.
Fans, and settings of the tool in use, are for it as the source has them for the tool it is printed
with, in the nearest layer, of the same role if there is one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from decmcts.arrays import Ints
from decmcts.errors import InputError
from decmcts.formats.gcode.dialects.dialect import OF_TOOL
from decmcts.formats.gcode.document import Block, Cursor, GcodeDocument, MoreStates, OwnStart
from decmcts.formats.gcode.text.lines import command_of, commands_of
from decmcts.formats.gcode.writing.hot_ends import HeatTaken, heat_taken_by_heads, hot_end_command
from decmcts.formats.gcode.writing.own_lines import own_lines
from decmcts.formats.gcode.writing.own_tools import Freed, StatedHeat, first_use, with_own_tools
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob

PrintText = tuple[PrintJob, GcodeDocument]


def with_tool_left(
    job: PrintJob, document: GcodeDocument, tool: int, other: Mapping[int, int], *, first: int = 0
) -> PrintText:  # fmt: skip
    """Return a source of several tools as the head of one prints its part of it.

    Parameters
    ----------
    other : Mapping[int, int]
        Tools whose contours are printed with this one; contours of all others stay what they are,
        and are not to be printed.
    first : int
        The first contour that is left to print.

    Raises
    ------
    InputError
        Where `other` names tools, and changes of tools are not understood, or the tool would print
        at a temperature that the source never prints with it at.
    """
    freed = with_own_tools(job, document)
    if isinstance(freed, str) or freed.barred:
        if not other:
            return job, document
        why = freed if isinstance(freed, str) else freed.barred
        raise InputError(
            f"what another tool should print cannot be printed with tool {tool}: {why}",
            path=document.path,
        )
    contours = printed_with(freed.job.contours, other)
    own = first_use(job, document, tool)
    heat_taken = heat_taken_by_heads(document, job)
    alone = _Text(freed, document, tool, other, heat_taken, first).alone(own)
    found = replace(freed.job, contours=contours, practices=())
    why = _other_heat(found, alone, tool, (job, document), first)
    if why and other:
        raise InputError(why, path=document.path)
    return (job, document) if why else (found, alone)


def printed_with(contours: Contours, other: Mapping[int, int]) -> Contours:
    """Return contours with the tools they are printed with, by the other tool of a tool."""
    tool = contours.tool.copy()
    for due, has in other.items():
        tool[contours.tool == due] = has
    return replace(contours, tool=tool)


class _Text:
    """The text of a source for the head of one tool."""

    def __init__(
        self, freed: Freed, document: GcodeDocument, tool: int, other: Mapping[int, int],
        heat_taken: HeatTaken, first: int,
    ) -> None:  # fmt: skip
        self.freed, self.document, self.tool, self.other = freed, document, tool, other
        self.states, self.heat_taken, self.start = _States(freed, other), heat_taken, document.start
        self._own = partial(own_lines, tool=tool, newline=document.newline, heat_taken=heat_taken)
        self.begins = int(freed.job.contours.epoch[first])
        self.own = np.flatnonzero(printed_with(freed.job.contours, other).tool == tool)

    def alone(self, own: OwnStart | None) -> GcodeDocument:
        """Return the document of that head alone, which is told so behind the start code."""
        document = self.document
        start = self.start = document.start if own is None else own.end
        preamble = document.preamble + (b"" if own is None else own.text)
        lines = self._own(preamble, selected=0, relative_e=False, keep_homing=True)
        if not start.relative_e:  # what lines that are left out have led E to
            lines += b"G92 E%.5f" % start.e + document.newline
        taken = 0 if own is None else own.line
        blocks = (
            self._block(block) for block in self.freed.document.blocks if block.last_line != taken
        )
        end = document.end
        postamble = self._own(
            document.postamble, selected=end.tool, relative_e=end.relative_e,
            heat_taken="all" if self.heat_taken == "all" else "off",
        )  # fmt: skip
        found = replace(
            self.freed.document, preamble=self._selecting(lines), postamble=postamble,
            start=replace(start, tool=self.tool), end=self._end(end),
            blocks=tuple(block for block in blocks if block is not None), own_starts=(),
        )  # fmt: skip
        states = self.states  # all of them are known only now
        return replace(found, states=states.more.table(), point_state=states.point_state)

    def _end(self, end: Cursor) -> Cursor:
        """Return where the head's controller stands below its last bead."""
        cursor = self._cursor(end, len(self.own))
        used = self.other.get(end.tool, end.tool) == self.tool
        return cursor if used else self._retracted(cursor)

    def _block(self, block: Block) -> Block | None:
        """Return a block as the head has it; None: it has nothing of it."""
        begin, changes = block.begin, "tool change" in block.reasons
        text = (
            block.text if self.heat_taken == "all" else self._without_heat(block, changes=changes)
        )
        selected = begin.tool if changes else self.other.get(begin.tool, begin.tool)
        lines = self._own(text, selected=selected, relative_e=begin.relative_e, fed=not changes)
        if not commands_of(lines):
            return None
        epochs = self.freed.job.contours.epoch[self.own]
        behind = int(np.searchsorted(epochs, block.epoch))
        begin, end = self._cursor(begin, behind), self._cursor(block.end, behind)
        end = replace(end, feed=-1.0) if block.moves else end
        if changes or selected != self.tool:  # what is pulled there is another tool's
            begin, end = self._as_between_beads(block, begin), self._as_between_beads(block, end)
        return replace(block, text=lines, begin=begin, end=end, moves=False)

    def _as_between_beads(self, block: Block, cursor: Cursor) -> Cursor:
        """Return a place where the head stands as it does between beads, or before the first."""
        if block.epoch <= self.begins:
            start = self.start
            return replace(
                cursor, owed=start.owed, pulled=start.pulled,
                firmware_retracted=start.firmware_retracted,
            )  # fmt: skip
        return self._retracted(cursor)

    def _retracted(self, cursor: Cursor) -> Cursor:
        deep = self.freed.job.settings.for_tool(self.tool).retract_mm
        return replace(cursor, owed=deep, pulled=deep, firmware_retracted=False)

    def _without_heat(self, block: Block, *, changes: bool) -> bytes:
        """Return the text of a block without temperatures that are not for this tool's beads.

        Of another tool's that it prints for, and those of its own standby.
        """
        standby = changes and block.end.tool != self.tool
        of_other = not changes and block.begin.tool in self.other
        if not (standby or of_other):
            return block.text
        kept = []
        for row in block.text.splitlines(keepends=True):
            command = hot_end_command(command_of(row))
            if command is None or not (standby or (of_other and command.tool is None)):
                kept.append(row)
        return b"".join(kept)

    def _cursor(self, cursor: Cursor, behind: int) -> Cursor:
        """Return where the head's controller stands; `behind` counts its contours above."""
        if cursor.tool == self.tool:
            return cursor
        like = int(self.own[min(behind, len(self.own) - 1)])
        state = self.states.of(cursor.state, self.states.begins(like))
        return replace(cursor, tool=self.tool, state=state)

    def _selecting(self, preamble: bytes) -> bytes:
        """Return start code that selects the tool above its first command."""
        if not self.tool:
            return preamble
        rows = preamble.splitlines(keepends=True)
        at = next((k for k, row in enumerate(rows) if command_of(row)), len(rows))
        return b"".join([*rows[:at], b"T%d" % self.tool + self.document.newline, *rows[at:]])


class _States:
    """States of a source, where fans and settings of the tool in use are another tool's."""

    def __init__(self, freed: Freed, other: Mapping[int, int]) -> None:
        document, self.contours = freed.document, freed.job.contours
        self.point_state, self.more = document.point_state.copy(), MoreStates(document.states)
        slots = document.states.slots
        self._its = [k for k, s in enumerate(slots) if s.startswith("fan") or s in OF_TOOL]
        owner = np.repeat(np.arange(len(self.contours)), np.diff(self.contours.offsets))
        for due, has in other.items():
            like = _nearest(self.contours, due, has)
            points = np.flatnonzero(self.contours.tool[owner] == due)
            models = document.point_state[self.contours.offsets[like[owner[points]]] + 1]
            pairs = np.stack([document.point_state[points], models], axis=1)
            pairs, place = np.unique(pairs, axis=0, return_inverse=True)
            found = [self.of(*pair) for pair in pairs.tolist()]
            self.point_state[points] = np.array(found, np.int32)[place.ravel()]

    def of(self, state: int, model: int) -> int:
        """Return the state that is like one, but for what goes with a tool: that is the model's."""
        row = self.more.rows[model]
        return self.more.like(state, {k: row[k] for k in self._its})

    def begins(self, contour: int) -> int:
        """Return the state in which a contour begins."""
        return int(self.point_state[self.contours.offsets[contour] + 1])


def _nearest(contours: Contours, due: int, has: int) -> Ints:
    """Return for each contour of tool `due` one of tool `has` that is most like it, (n,).

    In the nearest layer, of the same role if there is one.
    """
    kinds = np.stack([contours.layer, contours.role], axis=1).astype(np.int64)
    theirs = np.flatnonzero(contours.tool == has)
    known, first = np.unique(kinds[theirs], axis=0, return_index=True)
    like = np.full(len(contours), -1, np.int64)
    mine = np.flatnonzero(contours.tool == due)
    asked, place = np.unique(kinds[mine], axis=0, return_inverse=True)
    best = [
        int(np.argmin(2 * np.abs(known[:, 0] - layer) + (known[:, 1] != role)))
        for layer, role in asked.tolist()
    ]
    like[mine] = theirs[first[np.array(best, np.int64)]][place.ravel()]
    return like


def _other_heat(
    job: PrintJob, document: GcodeDocument, tool: int, source: PrintText, first: int
) -> str:
    """Return in words where a tool would print as hot as the source never has it; or nothing.

    Its own contours are printed as hot as in the source. Looked at from contour `first` on.
    """
    heat, was, contours = StatedHeat.of(job, document), StatedHeat.of(*source), source[0].contours
    pairs = np.stack([contours.tool == tool, job.contours.epoch, contours.epoch], axis=1)
    known = {was.at(tool, before) for _, _, before in np.unique(pairs[pairs[:, 0] == 1], axis=0)}
    left = (job.contours.tool == tool) & (np.arange(len(contours)) >= first)
    for own, now, before in np.unique(pairs[left], axis=0).tolist():
        due = {was.at(tool, before)} if own else known
        if (degrees := heat.at(tool, now)) not in due:
            stated = ", ".join(f"{one:g}" for one in sorted(filter(None, due)))
            return (
                f"tool {tool} would print at {degrees or 0.0:g} degrees, in the source it does at "
                f"{stated or 'none that is known'}"
            )
    return ""
