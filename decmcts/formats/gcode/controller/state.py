"""The sticky machine state along a file, interned, and the lines nothing crosses.

Reads the meaning of lines from `dialect`; knows nothing of contours.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.gcode.controller.held import Held
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.controller.moves_kernels import RELATIVE_E, RELATIVE_XYZ
from decmcts.formats.gcode.controller.targets import Targets, target_of
from decmcts.formats.gcode.dialects.dialect import OF_TOOL, Event, Kind, classify, without_brackets
from decmcts.formats.gcode.dialects.layers import with_note
from decmcts.formats.gcode.dialects.roles import CANONICAL, trailing_role
from decmcts.formats.gcode.document import UNSET, StateTable
from decmcts.formats.gcode.text.lines import EXPONENT, Lines
from decmcts.print.contours import Role

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
    lines: NDArray[np.int64]  # (k,) lines after which a state holds, ascending, first -1
    states: NDArray[np.int32]  # (k,) the state that holds from there
    layer_lines: NDArray[np.int64]  # lines that begin a layer
    barriers: dict[int, str]  # line -> reason
    splits: NDArray[np.int64]  # lines that part contours and nothing else
    sections: NDArray[np.int64]  # (s, 2) first and last line of a slicer's tool change
    repeats: NDArray[np.int64]  # lines that set a temperature that is in force, and do nothing
    idle: NDArray[np.int64]  # commands that end an object where none is open, and do nothing
    left: frozenset[int]  # values of another tool: of the one in use nothing was said since

    def at(self, line: NDArray[np.int64] | int) -> NDArray[np.int32]:
        """Return the state in force when a line begins."""
        return np.asarray(self.states[np.searchsorted(self.lines, line, side="left") - 1])


@dataclass(slots=True)
class _Recorder:
    """Collects while the lines go by; mutates only itself."""

    lines: Lines
    slots: dict[str, int] = field(default_factory=dict)
    values: dict[tuple[str, bool], int] = field(default_factory=lambda: {("", False): UNSET})
    tools: set[str] = field(default_factory=set)
    tool: str = "0"  # in use
    factor: str = "M220 S100"  # of speed, that M220 B has kept
    texts: list[str] = field(default_factory=lambda: [""])  # of `values`
    leave: dict[int, str] = field(default_factory=dict)
    merged: dict[str, Held] = field(default_factory=dict)
    current: list[int] = field(default_factory=list)
    rows: dict[tuple[int, ...], int] = field(default_factory=lambda: {(): 0})
    at: list[int] = field(default_factory=lambda: [-1])
    ids: list[int] = field(default_factory=lambda: [0])

    def put(self, slot: str, text: str, line: int, *, left: bool = False) -> None:
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
        self.tools.add(code)
        if len(self.tools) > MOST_TOOLS:
            raise self.lines.refuse(
                line, f"over {MOST_TOOLS} tools", "is it G-code of one printer?"
            )
        tool = (found[1].lstrip("0") or "0") if (found := _TOOL.match(code)) else code
        if tool != self.tool:
            self.tool = tool
            for slot in sorted(OF_TOOL & self.slots.keys()):
                self.merged.pop(slot, None)
                self.put(slot, self.get(slot), line, left=self.get(slot) != "")

    def get(self, slot: str) -> str:
        """Return the text in a slot."""
        where = self.slots.get(slot)
        return "" if where is None else self.texts[self.current[where]]

    def take(self, event: Event, line: int) -> None:
        """Set what a line sets, whole or parameter by parameter."""
        if event.tools is not None:
            for name in event.tools or (self.tool,):
                said = _EXTRUDER.fullmatch(name)
                tool = (said[1] or "0") if said else name.lstrip("0") or "0"
                slot = event.slot if tool == self.tool else f"{event.slot} {tool}"
                joint = "" if len(event.names) < 2 else "="
                form = f"{event.names}{joint}{name}" if event.tools else ""
                self.merge(slot, event, line, form)
        elif event.params:
            self.merge(event.slot, event, line)
        else:
            self.put(event.slot, event.text, line)

    def merge(self, slot: str, event: Event, line: int, form: str = "") -> None:
        """Set the parameters of a command that holds them one by one."""
        held = self.merged.get(slot)
        if held is None or held.command != event.text:
            held = self.merged[slot] = Held(event.text)
        self.put(slot, held.say(event.params, form=form, whole=event.whole), line)

    def keep_factor(self, code: str, line: int) -> None:
        """Take an M220 that keeps the factor of speed (B) or puts it back (R)."""
        if not (found := _FACTOR.match(without_brackets(code).strip())):
            return
        words = found[1].upper()
        if "B" in words:
            self.factor = self.get("speed factor") or self.factor
        if "R" in words:
            self.put("speed factor", self.factor, line)
        if new := re.search(r"S\s*([\d.]+)", words):
            self.put("speed factor", f"M220 S{new[1]}", line)

    def leave_slot(self, slot: str, text: str, line: int) -> bool:
        """End the object in a slot and keep the words that end it; False where none is open."""
        where = self.slots.get(slot)
        if where is None or where >= len(self.current) or self.current[where] == UNSET:
            return False
        self.leave[self.current[where]] = text
        self.put(slot, "", line)
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

    Raises
    ------
    InputError
        At a line with a number that is read in different ways, and where more is set than any
        machine has.
    """
    recorder, targets = _Recorder(lines), Targets()
    layers, splits = list[int](), list[int]()
    barriers: dict[int, str] = {}
    repeats, idle = list[int](), list[int]()
    sections: list[tuple[int, int]] = []
    opened, last_layer = -1, ""
    known = cache(classify)  # most lines say what others said
    moves = (lines.letter == 71) & (lines.code <= 30)
    for line in _event_lines(lines, moves).tolist():
        if moves[line]:
            _trailing(recorder, lines, line, layers)
            continue
        event = known(lines.raw(line))
        kind = event.kind
        if kind == Kind.UNREADABLE:
            raise lines.refuse(line, EXPONENT, "write it without")
        if kind == Kind.STATE:
            recorder.take(event, line)
        elif kind == Kind.LAYER:
            layers.append(line)
            last_layer = event.text
            recorder.put("layer", last_layer, line)
        elif kind == Kind.LAYER_NOTE:
            last_layer = _note(recorder, event, line, last_layer)
        elif kind == Kind.LEAVE:
            if not recorder.leave_slot(event.slot, event.text, line) and event.slot == "object":
                idle.append(line)
        elif kind == Kind.SPLIT:
            splits.append(line)
        elif kind == Kind.SECTION:
            opened = line
        elif kind == Kind.SECTION_END and opened >= 0:
            sections.append((opened, line))
            opened = -1
        elif kind == Kind.BARRIER or (kind == Kind.MODE and _changes(motion, line)):
            reason = event.text if kind == Kind.BARRIER else "coordinate mode"
            code = _code(lines, line)
            if targets.again(code, reason):
                repeats.append(line)
                continue
            barriers[line] = reason
            if event.slot:
                recorder.put(event.slot, target_of(code), line)
            if event.slot == "tool":
                recorder.select(code, line)
            recorder.keep_factor(code, line)
    return Track(
        recorder.table(), np.asarray(recorder.at, np.int64), np.asarray(recorder.ids, np.int32),
        np.asarray(layers, np.int64), barriers, np.asarray(splits, np.int64),
        np.asarray(sections, np.int64).reshape(-1, 2), np.asarray(repeats, np.int64),
        np.asarray(idle, np.int64),
        frozenset(value for (_, left), value in recorder.values.items() if left),
    )  # fmt: skip


def _code(lines: Lines, line: int) -> str:
    """Return the command of a line without comment, line number and checksum."""
    text = lines.raw(line).decode("utf-8", "surrogateescape").split(";", 1)[0]
    return " ".join(re.sub(r"^\s*[Nn]\d+|\*\d+\s*$", "", text).split())


def _note(recorder: _Recorder, event: Event, line: int, last_layer: str) -> str:
    """Append a line to the marker or object it belongs to; returns the marker."""
    if event.slot == "layer":
        if last_layer:
            last_layer = with_note(last_layer, event.text)
            recorder.put("layer", last_layer, line)
        return last_layer
    now = recorder.get("object")
    if now and event.text not in now.split("\n"):
        recorder.put("object", f"{now}\n{event.text}", line)
    return last_layer


def _event_lines(lines: Lines, moves: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the lines to classify: no moves, unless only their comments name roles."""
    wanted = ~moves & (lines.ends > lines.starts)
    if not _TYPED.search(lines.text):
        wanted |= moves & (lines.comment < lines.ends)
    return np.flatnonzero(wanted).astype(np.int64)


def _trailing(recorder: _Recorder, lines: Lines, line: int, layers: list[int]) -> None:
    """Take role and layer from the comment behind a move, as if written above it."""
    comment = lines.text[lines.comment[line] : lines.ends[line]].decode("utf-8", "replace")
    if (role := trailing_role(comment)) != Role.UNKNOWN:
        recorder.put("type", f";TYPE:{CANONICAL[role]}", line - 1)
    elif match := _NEXT_LAYER.match(comment):
        layers.append(line)
        recorder.put("layer", f";LAYER:{match.group(1)}", line)


def _changes(motion: Motion, line: int) -> bool:
    """Tell whether a G90, G91, M82 or M83 line changed a mode."""
    if line == 0:
        return False
    before, after = motion.modes[line - 1], motion.modes[line]
    return bool((before[[RELATIVE_XYZ, RELATIVE_E]] != after[[RELATIVE_XYZ, RELATIVE_E]]).any())
