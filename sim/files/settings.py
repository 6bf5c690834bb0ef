"""The judge's book of settings: what is in force when a bead is laid, and where a head travels.

Each bead is laid with the fan, the factors of speed and flow, accelerations, pressure advance and
the like that it is laid with in the source. A setting is a word of a command (`M204 P`), for the
axis that it names or for both (`M593 X F`). `M204 S` is P and T at once. Of some settings each tool
has its own (`M900 T1 K`). Firmwares differ in whether one that names no tool is of the tool in use
or of all, so such a setting is kept in both ways, and both have to agree. The tool in use is a
setting, too, and so is the object that a bead belongs to, by command or by comment: printers leave
out objects that are cancelled. Both texts are read by `sim.files.commands`, not by the reader that
made the result.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.files.commands import commands_of, in_force

FAR_MM = 0.05  # across the bed: what is less is no travel
_FAN = re.compile(rb"M(10[67]|12[67])(?![\d.]|[A-Z_]{2})(.*)", re.I | re.S)
_SET = re.compile(
    rb"(M(?:20[13-8]|22[01]|566|572|593|74|900)(?![\d.]|[A-Z_]{2})"
    rb"|SET_(?:VELOCITY_LIMIT|PRESSURE_ADVANCE|RETRACTION|FAN_SPEED)\b)(.*)",
    re.I | re.S,
)
_WORDS = re.compile(
    rb"(?<![A-Z_])([A-Z_]++) ?(?:= ?([^\s=]+)|(\"[^\"]*+\"|[-+]?[\d.]*\d[\d.]*+(?::[-+\d.]++)*+))",
    re.I,
)
_QUOTED = re.compile(rb'"[^"]*+"')
_AXIS = re.compile(rb"(?<![A-Z_])[XY](?![A-Z_=])", re.I)
_SELECTS = re.compile(rb"T ?0*(25[0-4]|2[0-4]\d|1?\d?\d)(?!\d)")  # none is above 254
_EXTRUDER = re.compile(r"extruder(\d*)", re.I)
_OF_TOOL = {  # the words that say of which tool
    b"M221": (b"T", b"D"), b"M900": (b"T",), b"M572": (b"D",),
    b"SET_PRESSURE_ADVANCE": (b"EXTRUDER",),
}  # fmt: skip
_OF_TRAVELS = re.compile(r"M204 T|SET_VELOCITY_LIMIT|M20[135]|M220|M566|M593")  # how they begin
_OBJECT = re.compile(rb"(?:M624|EXCLUDE_OBJECT_START)\b|M486 ?S ?+(?!-)|(M625|EXCLUDE_OBJECT_END"
                     rb"|M486 ?S ?-)", re.I)  # fmt: skip
_LABELS = b"printing object"
_LABEL = re.compile(rb"[\s;(]*(start |stop )?printing object(, unique)?")
_UNSET = {  # in force where nothing was set
    "fan": "0", "M220 S": "100", "M221 S": "100", "tool": "0", "object": "none", "label": "none",
    "numbered label": "none",
}  # fmt: skip

SettingLines = dict[str, list[tuple[int, str]]]
"""Of each setting the lines, from 1, that set it, and to what."""
_SettingBook = tuple[list[tuple[int, str]], list[tuple[int, str]]]  # file and source


def check_settings(
    ours: SettingLines, theirs: SettingLines, line: Ints, source_line: Ints,
    alike: Ints | None = None,
) -> list[Fault]:  # fmt: skip
    """Check that each bead is laid under the settings it is laid under in the source.

    Each is laid in `line` of the file and in `source_line` of the source, from 1, (n,). `alike` is
    equal for beads that are alike in place, filament and feed: each may be any of them.
    """
    books = {
        name: (ours.get(name, []), theirs.get(name, [])) for name in dict.fromkeys([*theirs, *ours])
    }
    if alike is not None:
        source_line = _exchanged(books, line, source_line, alike)
    lines, total = list[str](), 0
    for name, book in books.items():
        values, a, b = _compared(name, book, line, source_line)
        wrong = np.flatnonzero(a != b)
        total += len(wrong)
        lines += [
            f"line {line[k]} is printed with {name} {values[a[k]] or 'not set'}, in the "
            f"source with {values[b[k]] or 'not set'} (line {source_line[k]} there)"
            for k in wrong[:LIMIT].tolist()
        ]
    return listed(FaultKind.STATE, lines[:LIMIT], total=total)


@dataclass(frozen=True, slots=True)
class TravelSettings:
    """What limits the travels of a source: of each setting the values in force on any of them."""

    values: dict[str, set[str]]

    @staticmethod
    def of(theirs: SettingLines, line: Ints) -> TravelSettings:
        """Find them; `line`, (n,), is where the source travels, from 1."""
        found = {}
        for name, due in theirs.items():
            if len(line) and _OF_TRAVELS.match(name):
                held, names = _held(name, due, line)
                if held.all() or names[0]:  # else it also travels as the machine begins
                    found[name] = {names[k] for k in np.unique(held).tolist()}
        return TravelSettings(found)

    def differing(self, ours: SettingLines, line: Ints) -> Iterator[str]:
        """Yield where a file that was made from it travels with other values, in words.

        Where the file has not set anything yet, what the machine begins with is in force.
        """
        for name, known in self.values.items():
            held, names = _held(name, ours.get(name, []), line)
            other = [k > 0 and value not in known for k, value in enumerate(names)]
            for row in np.flatnonzero(np.array(other)[held]).tolist():
                value = names[held[row]]
                yield f"line {line[row]} travels with {name} {value}, and the source never does"


def _held(name: str, changes: list[tuple[int, str]], line: Ints) -> tuple[Ints, list[str]]:
    """Return which value of a setting is in force at each line, and the values; 0: none was set."""
    first = (0, _UNSET.get(name, ""))
    names = list(dict.fromkeys(value for _, value in [first, *changes]))
    return in_force([first, *changes], {value: k for k, value in enumerate(names)}, line), names


def travelling(points: Floats, extrusion: Floats, placed: Flags | None) -> Ints:
    """Return the moves across the bed that lay nothing, from the first that does to the last."""
    across = np.hypot(*np.diff(points[:, :2], axis=0).T) > FAR_MM
    if placed is not None:
        across &= ~placed
    laid = np.flatnonzero(across & (extrusion > 0.0))
    if not len(laid):
        return laid
    between = np.flatnonzero(across & (extrusion == 0.0))
    return np.asarray(between[(between > laid[0]) & (between < laid[-1])])


def _compared(
    name: str, book: _SettingBook, line: Ints, source_line: Ints
) -> tuple[list[str], Ints, Ints]:
    """Return the values of a setting, and which is in force at lines of the file and the source.

    The first is in force where nothing was set.
    """
    has, due = ([(0, _UNSET.get(name, "")), *changes] for changes in book)
    values = list(dict.fromkeys(value for _, value in has + due))
    number = {value: k for k, value in enumerate(values)}
    return values, in_force(has, number, line), in_force(due, number, source_line)


def _exchanged(books: dict[str, _SettingBook], line: Ints, source_line: Ints, alike: Ints) -> Ints:
    """Return the source's lines with beads that are alike exchanged where their settings differ."""
    held = [_compared(name, book, line, source_line)[1:] for name, book in books.items()]
    wrong = np.zeros(len(line), np.bool_)
    for a, b in held:
        wrong |= a != b
    rows = np.flatnonzero(np.isin(alike, alike[wrong]))
    mine = np.lexsort([*(a[rows] for a, _ in held), alike[rows]])
    theirs = np.lexsort([*(b[rows] for _, b in held), alike[rows]])
    exchanged = source_line.copy()
    exchanged[rows[mine]] = source_line[rows[theirs]]
    return exchanged


def settings_of(text: bytes) -> SettingLines:
    """Return what a text sets, and where; linear in its length."""
    found: SettingLines = {}
    tool, kept = "0", "100"
    for line, command in commands_of(text):
        if selects := _SELECTS.match(command):
            tool = selects[1].decode().lstrip("0") or "0"
            sets = [("tool", tool)]
        elif of := _OBJECT.match(command):
            sets = [("object", "none" if of[1] else command.decode("latin-1"))]
        elif fan := _FAN.match(command):
            sets = [_fan(fan[1], fan[2])]
        elif named := _SET.match(command):
            sets = list(_set_by(named[1].upper(), named[2], tool))
            if named[1].upper() == b"M220":
                now = found["M220 S"][-1][1] if "M220 S" in found else "100"
                kept = now if re.search(rb"B", named[2], re.I) else kept
                sets = [("M220 S", kept), *sets] if re.search(rb"R", named[2], re.I) else sets
        else:
            continue
        for name, value in sets:
            found.setdefault(name, []).append((line, value))
    for line, name, value in _labels(text):
        found.setdefault(name, []).append((line, value))
    return found


def _labels(text: bytes) -> Iterator[tuple[int, str, str]]:
    """Yield line, kind and text of the comments that say which object is printed; linear."""
    lower, at, line = text.lower(), 0, 1
    while (found := lower.find(_LABELS, at)) >= 0:
        begin, end = lower.rfind(b"\n", at, found) + 1 or at, lower.find(b"\n", found)
        line += lower.count(b"\n", at, begin)
        at = end if end >= 0 else len(lower)
        if label := _LABEL.match(lower, begin, at):
            value = "none" if label[1] == b"stop " else text[begin:at].strip().decode("latin-1")
            yield line, "numbered label" if label[2] else "label", value


def _fan(code: bytes, rest: bytes) -> tuple[str, str]:
    """Return which fan a command sets, and to what; that of M126 and M127 is one for all tools."""
    words = _words(rest)
    fan = words.get(b"P", "").lstrip("0")
    speed = words.get(b"S", "255") if code in (b"106", b"126") else "0"
    with suppress(ValueError):  # a template's word is no number, and stays what it is
        speed = f"{float(speed):g}"
    return f"fan{fan and ' '}{fan}", speed


def _set_by(code: bytes, rest: bytes, tool: str) -> Iterator[tuple[str, str]]:
    """Yield the settings that a command changes, and to what."""
    words, name = _words(rest), code.decode("latin-1")
    of: tuple[str, ...] = ("",)
    if code in _OF_TOOL:
        named = next((words.pop(key) for key in _OF_TOOL[code] if key in words), tool)
        tools = [_tool_of(one) for one in named.split(":")]
        of = (*([""] if tool in tools else []), *(f"T{one} " for one in tools))
    elif code == b"M593":
        axes = _AXIS.findall(_QUOTED.sub(b"", rest)) or [b"X", b"Y"]
        of = tuple(f"{axis.decode().upper()} " for axis in axes)
    elif code == b"M204" and (both := words.pop(b"S", None)) is not None:
        words = {b"P": both, b"T": both} | words
    elif b"FAN" in words:
        of = (f"FAN{words.pop(b'FAN')} ",)
    for part in of:
        yield from (
            (f"{name} {part}{key.decode('latin-1')}", value) for key, value in words.items()
        )


def _words(rest: bytes) -> dict[bytes, str]:
    return {key.upper(): (a or b).decode("latin-1") for key, a, b in _WORDS.findall(rest)}


def _tool_of(name: str) -> str:
    """Return the number of a tool, or its name."""
    named = _EXTRUDER.fullmatch(name)
    return (named[1] if named else name).lstrip("0") or "0"
