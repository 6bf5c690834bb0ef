"""The sticky machine state along a file, interned, and the lines nothing crosses.

Reads the meaning of lines from `dialect`; knows nothing of contours.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from decmcts.arrays import Flags, Int32s, Ints
from decmcts.formats.gcode.controller.held import Targets, WordsInForce, target_of
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.controller.moves_kernels import LAST_TOOL, RELATIVE_E, RELATIVE_XYZ
from decmcts.formats.gcode.dialects.dialect import (
    BY_NAME,
    CANONICAL,
    OF_TOOL,
    Kind,
    LineMeaning,
    classify,
    with_note,
    without_brackets,
)
from decmcts.formats.gcode.document import UNSET, StateTable
from decmcts.formats.gcode.text.lines import EXPONENT, Lines

_TYPED = re.compile(rb"^;\s*(TYPE|FEATURE):", re.M)
_NEXT_LAYER = re.compile(r"; move to next layer \((\d+)\)")
_TOOL = re.compile(r"T(\d++)")
_EXTRUDER = re.compile(r"extruder(\d*)")
_FACTOR = re.compile(r"M0*220(?![\d.])(.*)", re.I)


MOST_SLOTS = 200  # settings, among them fans and extruders by number: real files have up to 23
MOST_WORDS = 200  # of what is in force in one of them: real files have up to 20
MOST_TOOLS = 64
MOST_CELLS = 5 * 10**7  # settings times states: half a GiB, real files have up to 500,000


@dataclass(frozen=True, slots=True)
class Track:
    """State changes and barriers by line."""

    table: StateTable
    lines: Ints  # (k,) lines after which a state holds, ascending, first -1
    states: Int32s  # (k,) the state that holds from there
    layer_lines: Ints  # lines that begin a layer
    barriers: dict[int, str]  # line -> reason
    splits: Ints  # lines that part contours and nothing else
    sections: Ints  # (s, 2) first and last line of a slicer's tool change
    repeats: Ints  # lines that set a temperature that is in force, and do nothing
    idle: Ints  # commands that end an object where none is open, and do nothing
    left: frozenset[int]  # values of another tool: of the one in use nothing was said since

    def at(self, line: Ints | int) -> Int32s:
        """Return the state in force when a line begins."""
        return np.asarray(self.states[np.searchsorted(self.lines, line, side="left") - 1])

    def stops(self, reasons: Collection[str] | None = None) -> Ints:
        """Return the lines of all barriers, or of those for some reasons, ascending."""
        due = [k for k, reason in self.barriers.items() if reasons is None or reason in reasons]
        return np.array(sorted(due), np.int64)

    def in_section(self, line: Ints) -> Flags:
        """Tell which lines stand in a slicer's tool change."""
        k = np.searchsorted(self.sections[:, 0], line) - 1  # -1: above the first
        return np.asarray(line < np.append(self.sections[:, 1], 0)[k])


@dataclass(slots=True)
class _StateCollector:
    """Collects while the lines go by; mutates only itself."""

    lines: Lines
    motion: Motion
    slots: dict[str, int] = field(default_factory=dict)
    values: dict[tuple[str, bool], int] = field(default_factory=lambda: {("", False): UNSET})
    tools: set[str] = field(default_factory=set)
    tool: str = "0"  # in use
    factor: str = "M220 S100"  # of speed, that M220 B has kept
    texts: list[str] = field(default_factory=lambda: [""])  # of `values`
    leave: dict[int, str] = field(default_factory=dict)
    merged: dict[str, WordsInForce] = field(default_factory=dict)
    current: list[int] = field(default_factory=list)
    rows: dict[tuple[int, ...], int] = field(default_factory=lambda: {(): 0})
    at: list[int] = field(default_factory=lambda: [-1])
    ids: list[int] = field(default_factory=lambda: [0])
    targets: Targets = field(default_factory=Targets)
    layers: list[int] = field(default_factory=list)  # these and the rest as `Track` has them
    barriers: dict[int, str] = field(default_factory=dict)
    splits: list[int] = field(default_factory=list)
    sections: list[tuple[int, int]] = field(default_factory=list)
    repeats: list[int] = field(default_factory=list)
    idle: list[int] = field(default_factory=list)
    opened: int = -1  # line at which a section has begun
    marker: str = ""  # of the last layer, with its notes

    def record(self, event: LineMeaning, line: int) -> None:
        """Take a line that is no move."""
        kind = event.kind
        if kind == Kind.UNREADABLE:
            raise self.lines.refuse(line, EXPONENT, "write it without")
        if kind == Kind.STATE:
            self.take(event, line)
        elif kind == Kind.LAYER:
            self.layers.append(line)
            self.marker = event.text
            self.set_slot("layer", self.marker, line)
        elif kind == Kind.LAYER_NOTE:
            self.note(event, line)
        elif kind == Kind.LEAVE:
            if not self.leave_slot(event.slot, event.text, line) and event.slot == "object":
                self.idle.append(line)
        elif kind == Kind.SPLIT:
            self.splits.append(line)
        elif kind == Kind.SECTION:
            self.opened = line
        elif kind == Kind.SECTION_END and self.opened >= 0:
            self.sections.append((self.opened, line))
            self.opened = -1
        elif kind == Kind.BARRIER:
            self.stop(event.text, event.slot, line)
        elif kind == Kind.MODE and line > 0:
            modes = self.motion.modes[line - 1 : line + 1, [RELATIVE_XYZ, RELATIVE_E]]
            if (modes[0] != modes[1]).any():
                self.stop("coordinate mode", "", line)

    def stop(self, reason: str, slot: str, line: int) -> None:
        """Take a barrier, unless it only repeats a temperature, and what it sets."""
        text = self.lines.raw(line).decode("utf-8", "surrogateescape").split(";", 1)[0]
        code = " ".join(re.sub(r"^\s*[Nn]\d+|\*\d+\s*$", "", text).split())
        if self.targets.again(code, reason):
            self.repeats.append(line)
            return
        self.barriers[line] = reason
        if slot:
            self.set_slot(slot, target_of(code), line)
        if slot == "tool":
            self.select(code, line)
        self.keep_factor(code, line)

    def note(self, event: LineMeaning, line: int) -> None:
        """Append a line to the layer's marker or the object it belongs to."""
        if event.slot == "layer":
            if self.marker:
                self.marker = with_note(self.marker, event.text)
                self.set_slot("layer", self.marker, line)
            return
        now = self.get("object")
        if now and event.text not in now.split("\n"):
            self.set_slot("object", f"{now}\n{event.text}", line)

    def take_comment(self, line: int) -> None:
        """Take role and layer from the comment behind a move, as if written above it."""
        lines = self.lines
        comment = lines.text[lines.comment[line] : lines.ends[line]].decode("utf-8", "replace")
        role = BY_NAME.get(comment.lstrip("; ").strip().lower())  # Slic3r's ``--gcode-comments``
        if role:
            self.set_slot("type", f";TYPE:{CANONICAL[role]}", line - 1)
        elif match := _NEXT_LAYER.match(comment):
            self.layers.append(line)
            self.set_slot("layer", f";LAYER:{match.group(1)}", line)

    def set_slot(self, slot: str, text: str, line: int, *, left: bool = False) -> None:
        """Set a slot from `line` on; `left` where another tool has left it so."""
        where = self.slots.setdefault(slot, len(self.slots))
        if where == len(self.current):
            self.current.append(UNSET)
        value = self.values.setdefault((text, left), len(self.values))
        if value == len(self.texts):
            self.texts.append(text)
        if self.current[where] == value:
            return
        self.current[where] = value
        self.at.append(line)
        self.ids.append(self.rows.setdefault(tuple(self.current), len(self.rows)))
        self._refuse_too_much(text, line)

    def _refuse_too_much(self, text: str, line: int) -> None:
        """Raise InputError for states of no printer: each would cost more than the last."""
        n, what = len(self.current), ""
        if n > MOST_SLOTS:
            what = f"over {MOST_SLOTS} settings of a machine are in force at a time"
        elif len(text) > MOST_WORDS and len(text.split()) > MOST_WORDS:
            what = f"a setting, layer or object of over {MOST_WORDS} words"
        elif n * len(self.rows) > MOST_CELLS:
            what = f"over {len(self.rows):,} different states of a machine"
        if what:
            raise self.lines.refuse(max(line, 0), what, "is it G-code of one printer?")

    def select(self, code: str, line: int) -> None:
        """Take a tool into use, of which nothing is known but what was said of it by name.

        Books are kept of each in each stretch, so their number is limited.
        """
        if (found := _TOOL.match(code)) and int(found[1]) > LAST_TOOL:
            return
        self.tools.add(code)
        if len(self.tools) > MOST_TOOLS:
            raise self.lines.refuse(
                line, f"over {MOST_TOOLS} tools", "is it G-code of one printer?"
            )
        tool = (found[1].lstrip("0") or "0") if found else code
        if tool != self.tool:
            self.tool = tool
            for slot in sorted(OF_TOOL & self.slots.keys()):
                self.merged.pop(slot, None)
                self.set_slot(slot, self.get(slot), line, left=self.get(slot) != "")

    def get(self, slot: str) -> str:
        """Return the text in a slot."""
        where = self.slots.get(slot)
        return "" if where is None else self.texts[self.current[where]]

    def take(self, event: LineMeaning, line: int) -> None:
        """Set what a line sets, whole or parameter by parameter."""
        if event.tools is not None:
            for name in event.tools or (self.tool,):
                extruder = _EXTRUDER.fullmatch(name)
                tool = (extruder[1] or "0") if extruder else name.lstrip("0") or "0"
                slot = event.slot if tool == self.tool else f"{event.slot} {tool}"
                joint = "" if len(event.names) < 2 else "="
                form = f"{event.names}{joint}{name}" if event.tools else ""
                self.merge(slot, event, line, form)
        elif event.params:
            self.merge(event.slot, event, line)
        else:
            text, above = event.text, self.get("type").split("\n")[0]
            if event.slot == "type" and ":" in above and ":" not in text:
                text = f"{above}\n{text}"  # of the type it is a kind of (Cura's `;BRIDGE`)
            self.set_slot(event.slot, text, line)

    def merge(self, slot: str, event: LineMeaning, line: int, form: str = "") -> None:
        """Set the parameters of a command that holds them one by one."""
        held = self.merged.get(slot)
        if held is None or held.command != event.text:
            held = self.merged[slot] = WordsInForce(event.text)
        self.set_slot(slot, held.take(event.params, form=form, whole=event.whole), line)

    def keep_factor(self, code: str, line: int) -> None:
        """Take an M220 that keeps the factor of speed (B) or puts it back (R)."""
        if not (found := _FACTOR.match(without_brackets(code).strip())):
            return
        words = found[1].upper()
        if "B" in words:
            self.factor = self.get("speed factor") or self.factor
        if "R" in words:
            self.set_slot("speed factor", self.factor, line)
        if new := re.search(r"S\s*([\d.]+)", words):
            self.set_slot("speed factor", f"M220 S{new[1]}", line)

    def leave_slot(self, slot: str, text: str, line: int) -> bool:
        """End the object in a slot and keep the words that end it; False where none is open."""
        where = self.slots.get(slot)
        if where is None or self.current[where] == UNSET:
            return False
        self.leave[self.current[where]] = text
        self.set_slot(slot, "", line)
        return True

    def table(self) -> StateTable:
        """Return the states as a frozen table."""
        rows = np.zeros((len(self.rows), len(self.slots)), np.int32)
        for key, row in self.rows.items():
            rows[row, : len(key)] = key
        leave = tuple(self.leave.get(k, "") for k in range(len(self.values)))
        return StateTable(tuple(self.slots), tuple(self.texts), leave, rows)


def track_state(lines: Lines, motion: Motion) -> Track:
    """Return the machine state and the barriers of a file.

    Raises InputError at a line with a number that is read in different ways, and where more is set
    than any machine has.
    """
    collector = _StateCollector(lines, motion)
    known = cache(classify)  # most lines say what others said
    moves = lines.moves
    wanted = ~moves & (lines.ends > lines.starts)
    if not _TYPED.search(lines.text):  # only comments behind moves name roles
        wanted |= moves & (lines.comment < lines.ends)
    for line in np.flatnonzero(wanted).tolist():
        if moves[line]:
            collector.take_comment(line)
        else:
            collector.record(known(lines.raw(line)), line)
    integers = (collector.layers, collector.splits, collector.repeats, collector.idle)
    layers, splits, repeats, idle = (np.asarray(each, np.int64) for each in integers)
    return Track(
        collector.table(), np.asarray(collector.at, np.int64), np.asarray(collector.ids, np.int32),
        layers, collector.barriers, splits,
        np.asarray(collector.sections, np.int64).reshape(-1, 2), repeats, idle,
        frozenset(value for (_, left), value in collector.values.items() if left),
    )  # fmt: skip
