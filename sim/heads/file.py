"""The file of one head of several as the judge reads it: commands, moves, sync points.

Only reading; what the files must do together is judged in `sim.heads.together`.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

from decmcts.formats.gcode.controller.motion import Motion, interpret
from decmcts.formats.gcode.controller.state import Track, track_state
from decmcts.formats.gcode.dialects.dialect import OF_TOOL
from decmcts.formats.gcode.document import StateTable
from decmcts.formats.gcode.text.lines import Lines, command_of, split_lines
from decmcts.formats.gcode.text.source_text import line_with_number, load_text
from decmcts.print.machine import USUAL_WORDS, SyncWords
from sim.files.commands import PLAIN_MOVE, codes_of, not_plain, states_in_force
from sim.files.settings import settings_of
from sim.heads.heat import SELECTS, heat_of
from sim.heads.sync import Reader, Sync

HEADER_LINES = 60  # the header of a file, whatever its slicer writes above it
_CUT = re.compile(rb"^; \d+ contours are cut at \d+ places", re.M)
_HEADER = re.compile(rb"^; head (\S.*), file (\d+) of (\d+): to be run together[ \t]*\r?$", re.M)
AXIS_MOVE = re.compile(rb"G0*[0123](?=[ XYZEFIJR]).*[XYZIJ]", re.I)  # homing is none
_OF_TOOL = re.compile(rb"M10[49]\b|G0*1[01](?!.*L)\b|G0*[01](?= ).*E", re.I)
_FILAMENT = re.compile(rb"G0*1[01](?!.*L)\b|G0*[01](?= ).*E", re.I)
_DWELL = re.compile(rb"G4 P(\d+)\Z")
_MOVES = (b"G1 ", b"G2 ", b"G3 ")
_E_WORD = re.compile(rb"[^(]*?E ?([-+]?[0-9.]+)", re.I)
_E_COUNTS = {b"M82": False, b"G90": False, b"M83": True, b"G91": True}  # from move to move?
_LIMITS = (b"M201", b"M202", b"M203", b"M204", b"M205", b"M593")  # their T is no tool, nor M620.1's

NumberedCommands = tuple[tuple[int, bytes], ...]  # line, from 1, and command


@dataclass(frozen=True, slots=True)
class FileWaits:
    """Where a file waits, signals and dwells, found once for all that is asked of it."""

    waits: list[int]  # (w,) lines of waits, ascending
    signals: list[int]  # (s,) lines of signals, ascending
    dwells: list[int]  # (d,) lines of dwells, ascending
    total_ms: list[int]  # (d + 1,) all dwells before each of them, and all of them

    @classmethod
    def of(cls, syncs: Sequence[Sync], others: NumberedCommands) -> FileWaits:
        """Find them; every command is read once."""
        found = ((line, _DWELL.match(code)) for line, code in others)
        dwells = [(line, int(match[1])) for line, match in found if match is not None]
        waits, signals = (
            [sync.line for sync in syncs if sync.signal == wanted] for wanted in (False, True)
        )
        total_ms = list(accumulate((ms for _, ms in dwells), initial=0))
        return cls(waits, signals, [line for line, _ in dwells], total_ms)

    def between_s(self, above: int, below: int) -> float:
        """Return the seconds dwelt below line `above` and above line `below`."""
        low, high = bisect_right(self.dwells, above), bisect_left(self.dwells, below)
        return (self.total_ms[max(low, high)] - self.total_ms[low]) / 1000.0


@dataclass(frozen=True, slots=True)
class HeadFile:
    """One file, read back."""

    path: str
    name: str  # of the head, as its header says; empty: it says none
    place: tuple[int, int]  # file k of n
    lines: Lines
    motion: Motion
    track: Track
    syncs: tuple[Sync, ...]
    rest: NumberedCommands  # all that is no sync point
    others: NumberedCommands  # those of them that are no plain moves
    rests: FileWaits
    numbered: int | None  # the first line that has a line number, from 1; numbers are not read


@dataclass(frozen=True, slots=True)
class FileParts:
    """The parts of one head's file, by line from 1."""

    first: int  # first command
    parked: int  # the head has reached its park position
    end_code: int  # the first line of the end code; below all lines where it has none
    begin: int  # first move of the body
    end: int  # past its last move
    blocks: tuple[tuple[int, ...], ...] = ()  # lines of each block, none where it has no command


def read_head_file(path: Path | str, words: SyncWords = USUAL_WORDS) -> HeadFile:
    """Read the file of one head; `words` are what its sync points look like.

    Raises
    ------
    InputError
        When it is damaged.
    """
    lines = split_lines(load_text(path), path)
    motion = interpret(lines)
    name, place = header_of(lines.text)
    syncs, rest, others = _parted(lines, Reader(words, place[0]))
    track, rests = track_state(lines, motion), FileWaits.of(syncs, others)
    return HeadFile(
        str(path), name, place, lines, motion, track, syncs, rest, others, rests,
        line_with_number(path),
    )  # fmt: skip


def header_of(text: bytes) -> tuple[str, tuple[int, int]]:
    """Return the head a file says it is for and its place among the files; '' for none."""
    match = _HEADER.search(_top(text))
    if match is None:
        return "", (0, 0)
    return match[1].decode("utf-8", "replace"), (int(match[2]), int(match[3]))


def is_cut(text: bytes) -> bool:
    """Tell whether a file says that contours of its source are cut."""
    return _CUT.search(_top(text)) is not None


def _top(text: bytes) -> bytes:
    return b"\n".join(text.split(b"\n", HEADER_LINES)[:HEADER_LINES])


def _parted(
    lines: Lines, reader: Reader
) -> tuple[tuple[Sync, ...], NumberedCommands, NumberedCommands]:
    """Return sync points, all other commands, and those of them that are no plain moves.

    An M400 right before a signal at rest belongs to it. A wait has none: nothing behind it is
    read before it is over, so the moves above it run out.
    """
    syncs, taken = list[Sync](), list[int]()
    codes = lines.text.replace(b"\r\n", b"\n").split(b"\n")
    may_be = any(move.startswith(begin[:3]) for begin in reader.begins for move in _MOVES)
    looked_at = list(range(len(codes))) if may_be else not_plain(lines.text, PLAIN_MOVE)
    for k in looked_at:
        codes[k] = command_of(codes[k])
    for k in looked_at:
        if not codes[k].startswith(reader.begins):
            continue
        above = next((j for j in range(k - 1, -1, -1) if codes[j]), k)
        sync = reader.read(k + 1, codes[k], codes[above] if above < k else b"")
        if sync is not None:
            syncs.append(sync)
            belongs = sync.signal and not sync.moving and codes[above] == b"M400"
            taken += [k, above] if belongs else [k]
    for k in taken:
        codes[k] = b""
    rest = tuple((k, code) for k, code in enumerate(codes, 1) if code)
    return tuple(syncs), rest, tuple((k + 1, codes[k]) for k in looked_at if codes[k])


def own_commands(
    text: bytes, tool: int | None, *, homes: bool, relative_e: bool, selected: int | None = None,
    all_heat: bool = False, all_off: bool = False, fed: bool = True,
) -> list[bytes]:  # fmt: skip
    """Return those commands of verbatim lines of the source that one head's file must have.

    Moves along an axis, tool changes and commands to another head's tool are left out, and
    homing too unless it `homes`, as start code does. Where E is absolute, a G92 takes the place of
    a command that is left out and moves E.

    Parameters
    ----------
    tool : int | None
        The tool the head prints with; None: it prints nothing.
    relative_e : bool
        How E counts above the lines.
    selected : int | None
        The tool in use above the lines, of a source that has several: filament and hot end
        of another tool are not this head's. None: the source has one tool.
    all_heat, all_off : bool
        Temperatures that name no tool heat this head, or switch it off, whichever tool is
        selected.
    fed : bool
        Whether filament of the tool in use is this head's: not where it is for another's bead.
    """
    kept = []
    for code in codes_of(text):
        name = code.split()[0].upper()
        relative_e = _E_COUNTS.get(name, relative_e)
        others = None not in (selected, tool) and selected != tool
        if SELECTS.match(name):
            selected = None if selected is None else int(name[1:])
        elif AXIS_MOVE.match(code) or (not homes and name in (b"G28", b"G29")):
            kept += _e_set(code, relative_e)
        elif (own := _for_tool(code, tool)) is None:
            continue
        elif (heat := heat_of(own)) and (all_heat or (all_off and not heat.heats)):
            kept.append(own)
        elif (others and own == code and _OF_TOOL.match(code)) or (
            not fed and _FILAMENT.match(code)
        ):
            kept += _e_set(code, relative_e)
        else:
            kept.append(own)
    return kept


def begin_of_verbatim(
    row: Callable[[int], bytes], line: int, text: bytes, own: Callable[[bytes], list[bytes]]
) -> int:
    """Return the row at which verbatim lines of the source begin, above row `line` of a file.

    Row `line` is the first command of them that the file has. What stands above that in the
    source are comments, which may have come or gone, and commands that `own` leaves out: they
    stand in the file as comments that end with them, or not at all. Each may be about what is
    in force, so what is in force where the lines begin is so above all of them.
    """
    rows = text.split(b"\n")
    commands = (k for k, due in enumerate(rows) if command_of(due))
    first = next((k for k in commands if own(b"\n".join(rows[: k + 1]))), len(rows))
    due = [stripped for above in rows[:first] if (stripped := above.strip())]
    begins = line
    while due and line > 0 and not command_of(row(line - 1)):
        line -= 1
        has = row(line).strip()
        match = next((k for k in reversed(range(len(due))) if has and has.endswith(due[k])), -1)
        if match >= 0:
            due, begins = due[:match], line
    return begins


def _for_tool(code: bytes, tool: int | None) -> bytes | None:
    """Return a command without the tool it names; None if that is another head's."""
    words = code.split()
    chosen = [word for word in words[1:] if SELECTS.match(word)]
    if not chosen or words[0].upper() in _LIMITS or b"." in words[0]:
        return code
    if tool is not None and int(chosen[0][1:]) != tool:
        return None
    words.remove(chosen[0])
    return b" ".join(words)


def _e_set(code: bytes, relative_e: bool) -> list[bytes]:
    """Return what sets E to where a command that is left out would have led."""
    word = None if relative_e else _E_WORD.match(code)
    return [b"G92 E" + word[1]] if word else []


SAME_MM = 1.1e-3  # files have three decimals
E_MM = 5e-5
FEED_MM_S = 1e-3


class ContourMoves(NamedTuple):
    """A contour that a file prints: moves begin..end - 1."""

    contour: int
    begin: int
    end: int


Settings = frozenset[tuple[str, str]]  # what is set, and to what


def kept_settings(table: StateTable, row: int) -> Settings:
    """Return the settings of tools in a state, one by one.

    Where the source chooses another tool, nothing is known of that tool's until it is set. A
    head's file chooses none: what its start code, the source's own, has set stays in force.
    """
    texts = (text for slot, text in states_in_force(table, row) if slot in OF_TOOL)
    return frozenset(setting for text in texts for setting in _each_setting(text))


def words_of(has: set[tuple[str, str]], wanted: set[tuple[str, str]], kept: Settings) -> list[str]:
    """Return in words how what is in force differs from what should be.

    `kept` are settings of tools that may be in force as well (`kept_settings`).
    """
    ours, due = dict(has - wanted), dict(wanted - has)
    for slot in OF_TOOL & ours.keys() & due.keys():
        mine, theirs = _each_setting(ours[slot]), _each_setting(due[slot])
        if theirs <= mine <= theirs | kept:
            del ours[slot], due[slot]
    words = [f"in force is '{text}'" for _, text in sorted(ours.items())]
    return words + [f"not in force is '{text}'" for _, text in sorted(due.items())]


def _each_setting(text: str) -> Settings:
    """Return what commands set, and to what, one by one."""
    found = settings_of(text.encode("utf-8", "surrogateescape"))
    return frozenset((name, lines[-1][1]) for name, lines in found.items())
