"""Everything in a file that is no contour, against its source.

docs/gcode.md (*What the judge accepts*) says which commands may stand where; every other command is
a fault, known or not.

**The book of commands**: what the source commands, the result commands. Both texts are read line by
line, by a reading of the judge's own. A line commands what is left of it without its number, its
checksum and its comments, in brackets or behind a semicolon. Words behind a comment in brackets
command, as they do for firmwares that know such comments. A carriage return ends a line. Every
command stands as often as in the source, but for those that other books keep: `_IN_OTHER_BOOKS`.

**Lines.** Nearly all lines of a file are plain moves or comments. `not_plain` and
`no_comment_no_move` only name the lines that whoever asks would not pass over, so that these alone
are read with regular expressions.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Ints
from decmcts.formats.gcode import GcodeDocument
from decmcts.formats.gcode.dialects.dialect import DWELL_MARKS
from decmcts.formats.gcode.document import DESCRIBES, SILENT, Block, StateTable
from decmcts.formats.gcode.text.lines import command_of
from sim.faults import Fault, FaultKind, listed

LONGEST_DWELL_S = 600.0  # no layer time asks for more
_NUMBER = rb"(?:\d++(?:\.\d++)?|\.\d++)"  # one way to read it, however long
_FEED = rb" F(?=[0.]*+[1-9])" + _NUMBER  # above 0: some firmwares never end a move without feed
_AT = rb" %c-?" + _NUMBER
_LINE = rb"G1(?=[ ])(?: [XYZE]-?" + _NUMBER + rb")*+"
_ARC = rb"G[23]" + _AT % b"X" + _AT % b"Y" + rb"(?:" + _AT % b"Z" + rb")?"
_ARC += _AT % b"I" + _AT % b"J" + _AT % b"E"  # none but beads are turned
PLAIN_MOVE = re.compile(rb"(?:" + _LINE + rb"|" + _ARC + rb")(?:" + _FEED + rb")?\r?\Z")
_PLAIN = re.compile(rb";|" + PLAIN_MOVE.pattern)
_RETRACTION = re.compile(rb"G1[01]\Z|G92 E-?" + _NUMBER + rb"\Z")
_OWN_DWELLS = tuple(mark.encode() for mark in DWELL_MARKS)
_DWELL = re.compile(rb"G4 P(\d+)\Z")
_NAME = re.compile(rb"[GM]\d+(?:\.\d+)?(?![\w.])|[A-Z_]++(?=\s|\Z)")
_SETS_STATE = frozenset(
    b"M106 M107 M126 M127 M220 M221 M117 M900 M572 M74 M593 G17 M204 M205 M201 M203 M566 M207"
    b" M208 M486 M624 M625 SET_PRINT_STATS_INFO SET_VELOCITY_LIMIT SET_PRESSURE_ADVANCE"
    b" SET_RETRACTION SET_FAN_SPEED EXCLUDE_OBJECT_START EXCLUDE_OBJECT_END".split()
)
_WITH_EXPONENT = re.compile(  # in a command that is acted on; a message or a name may hold anything
    rb"(?:G\d|M(?:10[4679]|1[49]0|14[12]|191|20[1345789]|22[01]|566|572|593|900)(?!\d)"
    rb"|SET_(?!PRINT))[^;(]*?[0-9.]e[-+]?[0-9]"
)


@dataclass(frozen=True, slots=True)
class Verbatim:
    """Where a file has the source's own lines, from 1."""

    begin: int  # first line below the start code
    end: int  # first line of the end code
    blocks: tuple[tuple[int, int] | None, ...]  # first and last line of each; None: not found


def check_commands(
    text: bytes, document: GcodeDocument, line: Ints, epoch: Ints
) -> tuple[list[Fault], Verbatim]:
    """Check all that a one-head file commands besides its beads; tell where the source's lines are.

    `line` is where the file lays each known bead, from 1, `epoch` the one the source has it in.
    """
    text = text.rstrip()
    rows = text.split(b"\n")
    begin, faults = match_start(rows, document.preamble)
    end, more = match_end(rows, document.postamble)
    lines = faults + more
    spans, more = _find_blocks(rows, document.blocks, line, epoch)
    lines += more
    taken = {k for span in spans if span is not None for k in range(span[0] - 1, span[1])}
    known = known_settings(document)
    for k in not_plain(text, _PLAIN):
        if _WITH_EXPONENT.match(rows[k].lstrip()):
            lines.append(f"line {k + 1}: {shown(rows[k])} has an exponent: firmwares differ in it")
        if begin <= k < end and k not in taken and not accepted(rows[k], known):
            lines.append(f"line {k + 1}: {shown(rows[k])} is not in the source at this place")
    return listed(FaultKind.COMMAND, lines), Verbatim(begin + 1, end + 1, tuple(spans))


def codes_of(text: bytes) -> list[bytes]:
    """Return the commands of a text."""
    return [code for row in text.split(b"\n") if (code := command_of(row))]


def commands(rows: Iterable[bytes]) -> list[tuple[int, bytes]]:
    """Return the number (from 0) and the command of each line that has one."""
    return [(k, code) for k, row in enumerate(rows) if (code := command_of(row))]


def match_start(rows: Sequence[bytes], preamble: bytes) -> tuple[int, list[str]]:
    """Return the first line below the start code, and what differs from the source's."""
    k = 0
    for number, due in commands(preamble.split(b"\n")):
        while k < len(rows) and not command_of(rows[k]):
            k += 1
        has = command_of(rows[k]) if k < len(rows) else b""
        if has != due:
            wanted = f"the source's start code has {shown(due)} there (its line {number + 1})"
            return k, [f"line {k + 1}: {shown(has)}, {wanted}"]
        k += 1
    return k, []


def match_end(rows: Sequence[bytes], postamble: bytes) -> tuple[int, list[str]]:
    """Return the line the end code begins at, and whether it differs from the source's."""
    due = codes_of(postamble)
    k, has = len(rows), list[bytes]()
    while k > 0 and len(has) < len(due):
        k -= 1
        if code := command_of(rows[k]):
            has.append(code)
    if has[::-1] != due:
        return k, ["the end code is not the source's, command by command"]
    return k, []


def _find_blocks(
    rows: Sequence[bytes], blocks: Sequence[Block], line: Ints, epoch: Ints
) -> tuple[list[tuple[int, int] | None], list[str]]:
    """Return where each block is, from 1, and what is wrong.

    A block belongs below all beads of earlier epochs and above all later ones.
    """
    order = np.argsort(epoch, kind="stable")
    sorted_epoch = epoch[order]
    highest = np.maximum.accumulate(line[order]) if len(line) else line
    lowest = np.minimum.accumulate(line[order][::-1])[::-1] if len(line) else line
    lines, since = list[str](), 0
    spans: list[tuple[int, int] | None] = []
    for block in blocks:
        spans.append(None)
        due = codes_of(block.text)
        if not due:
            continue
        k = int(np.searchsorted(sorted_epoch, block.epoch))
        low = max(int(highest[k - 1]) if k else 0, since)
        high = int(lowest[k]) - 1 if k < len(lowest) else len(rows)
        has = commands(rows[low:high])
        codes = [code for _, code in has]
        at = next((i for i in range(len(has)) if codes[i : i + len(due)] == due), -1)
        if at < 0:
            lines.append(
                f"between lines {low} and {high + 1} there is no {shown(due[0])} with all that "
                f"follows it in the source (line {block.line}, {block.reason})"
            )
            continue
        since = low + has[at + len(due) - 1][0] + 1
        spans[-1] = (low + has[at][0] + 1, since)
    return spans, lines


def known_settings(document: GcodeDocument) -> frozenset[bytes]:
    """Return the commands with which the source sets its states, comments left out."""
    states = document.states
    kept = [k for k, slot in enumerate(states.slots) if not slot.startswith(SILENT)]
    used = np.unique(states.rows[:, kept]).tolist() if kept else []
    texts = [text for k in used for text in (states.values[k], states.leave[k])]
    return frozenset(codes_of("\n".join(texts).encode("utf-8", "surrogateescape")))


def states_in_force(
    table: StateTable, row: int, but: tuple[str, ...] = SILENT
) -> set[tuple[str, str]]:
    """Return slot and text of all that commands something in a state, `but` what begins so."""
    return {
        (slot, table.values[v])
        for slot, v in zip(table.slots, table.rows[row].tolist(), strict=True)
        if v and slot not in DESCRIBES and not slot.startswith(but)
    }


def sets_state(code: bytes) -> bool:
    """Tell whether a command sets what holds from bead to bead, and is compared there."""
    name = _NAME.match(code.upper())
    return name is not None and name[0] in _SETS_STATE


def is_move(code: bytes) -> bool:
    """Tell whether a command is a move, which may stand between contours: moves are simulated."""
    return PLAIN_MOVE.match(code) is not None


def accepted(row: bytes, known: frozenset[bytes]) -> bool:
    """Tell whether a line may stand between contours."""
    code = command_of(row)
    if not code or PLAIN_MOVE.match(code) or _RETRACTION.match(code):
        return True
    if (dwell := _DWELL.match(code)) and row.rstrip().endswith(_OWN_DWELLS):
        return int(dwell[1]) <= 1000.0 * LONGEST_DWELL_S
    return sets_state(code) and code in known


def shown(code: bytes) -> str:
    """Return a command for a message."""
    text = code.strip()[:60].decode("utf-8", "replace")
    return f"'{text}'" if text else "nothing"


_ROW = re.compile(rb"[^\n]++")
_OWN_WAIT = re.compile(
    rb"\s*+G4 P\d++ ; decmcts (?:waits for cooling|stands idle)\s*+\Z"
)  # plans make them anew
_BRACKETS = re.compile(rb"\([^()\n]*+\)")
_LINE_NUMBER = re.compile(rb"[Nn] ?\d++(?:\.\d*+)?")
_CHECKSUM = re.compile(rb"\*\s*+\d++\s*+\Z")
_WORD = re.compile(rb"([GMT]) ?0*(?=\d)", re.I)
_IN_OTHER_BOOKS = re.compile(
    rb"(?:G(?:[0-3]|1[017]|2[01]|9[0-2])|M(?:73|8[23]|10[4-9]|12[67]|14[01]|19[01]|20[13-8]|22[01]"
    rb"|117|400|486|566|572|593|62[45]|74|900))(?![\d.])|EXCLUDE_OBJECT\w*"
    rb"|SET_(?:PRINT_STATS_INFO|VELOCITY_LIMIT|PRESSURE_ADVANCE|RETRACTION|FAN_SPEED)\b",
    re.I,
)
_LEFT_OUT = re.compile(rb"T-?\d+|G2[89](?![\d.])", re.I)  # of files of several heads
_TOOL = re.compile(rb"(?:(?<=\d)| )T ?\d++(?= |\Z)", re.I)


def check_book(text: bytes, source: bytes, more: Mapping[bytes, int] | None = None) -> list[Fault]:
    """Check that a file commands whatever its source commands, as often.

    `more` has by how much oftener a command is due than in the source; below 0: less often.
    """
    has, missing = Counter(command for _, command in commands_of(text)), list[str]()
    due, first = Counter[bytes](), dict[bytes, int]()
    for line, command in commands_of(source):
        due[command] += 1
        first.setdefault(command, line)
    for command, times in due.items():
        times += (more or {}).get(command, 0)
        if has[command] < times and not _IN_OTHER_BOOKS.match(command):
            often = "" if times == 1 else f", {times} times; here {has[command]}"
            missing.append(
                f"{shown(command)} is missing (line {first[command]} of the source{often})"
            )
    return listed(FaultKind.COMMAND, missing)


def check_heads_book(texts: Sequence[bytes], source: bytes) -> list[Fault]:
    """Check that each command of a source is in some head's file, with its tool or without.

    Which head has it, where and how often is compared elsewhere. No tool is selected, as each file
    is of one, and what homes amid the print is left out.
    """
    has = {command for text in texts for _, command in commands_of(text)}
    missing = [
        f"{shown(command)} is in no head's file (line {line} of the source)"
        for line, command in commands_of(source)
        if not (_IN_OTHER_BOOKS.match(command) or _LEFT_OUT.match(command))
        and command not in has
        and _TOOL.sub(b"", command) not in has
    ]
    return listed(FaultKind.COMMAND, missing)


def commands_of(text: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield line, from 1, and command of what a text commands, but for most moves; linear."""
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    for line, begin in no_comment_no_move(text):
        row = _ROW.match(text, begin)
        if row and not _OWN_WAIT.match(row[0]) and (command := command_in(row[0])):
            yield line, command


def command_in(line: bytes) -> bytes:
    """Return what a line commands, a blank between words; nothing of a comment."""
    code = line.split(b";", 1)[0]
    if b"(" in code:
        code = _BRACKETS.sub(b" ", code)
    code = code.strip()
    if numbered := _LINE_NUMBER.match(code):
        code = _CHECKSUM.sub(b"", code[numbered.end() :])
    code = b" ".join(code.split())
    word = _WORD.match(code)
    return code if word is None else word[1].upper() + code[word.end() :]


_ONE_DIGIT = bytes.maketrans(b"23456789", b"11111111")
_ZERO, _NINE, _DOT, _END = 48, 57, 46, 10

T = TypeVar("T", bound=Hashable)
Bytes = NDArray[np.uint8]


def not_plain(text: bytes, plain: re.Pattern[bytes]) -> list[int]:
    """Return the lines, from 0, whose shape `plain` does not match.

    The shape of a line has each number's run of digits cut to its first, 1 for all but 0. Only
    the second byte of a line, the number of its command, stays what it is. A pattern that asks
    of numbers only whether there are digits, or one above 0, so matches no shape of a line that
    it does not match.
    """
    shapes = _shapes(text).split(b"\n")
    passed = {shape for shape in set(shapes) if plain.match(shape)}
    return [k for k, shape in enumerate(shapes) if shape not in passed]


def _shapes(text: bytes) -> bytes:
    raw = np.frombuffer(text, np.uint8)
    if not len(raw):
        return b""
    shape = np.frombuffer(text.translate(_ONE_DIGIT), np.uint8).copy()
    digit = _digits(raw)
    kept = np.ones(len(raw), np.bool_)
    np.logical_and(digit[1:], digit[:-1], out=kept[1:])
    np.logical_not(kept[1:], out=kept[1:])
    second = np.concatenate([[0], np.flatnonzero(raw == _END) + 1]) + 1
    shape[second[second < len(raw)]] = raw[second[second < len(raw)]]
    kept[second[second + 1 < len(raw)] + 1] = True  # so that 12 is not 1
    return shape[kept].tobytes()


def _digits(raw: Bytes) -> Flags:
    return np.asarray((raw >= _ZERO) & (raw <= _NINE))


def no_comment_no_move(text: bytes) -> Iterator[tuple[int, int]]:
    """Yield number, from 1, and first byte of each line that may be neither comment nor G0 to G3.

    Empty lines and those that begin with a semicolon are left out, and moves written with one
    digit; others may be among what is yielded. What begins with a comment in brackets is, as a
    command may stand behind it.
    """
    raw = np.frombuffer(text + b"\n\n\n", np.uint8)
    starts = np.concatenate([[0], np.flatnonzero(raw[: len(text)] == _END) + 1])
    first, second, third = (raw[starts + k] for k in range(3))
    move = ((first == ord("G")) | (first == ord("g"))) & (second >= _ZERO) & (second <= _ZERO + 3)
    move &= ~(_digits(third) | (third == _DOT))
    left = np.flatnonzero(~move & ~np.isin(first, (ord(";"), ord("\r"), _END)))
    return zip((left + 1).tolist(), starts[left].tolist(), strict=True)


def in_force(changes: Sequence[tuple[int, T]], number: Mapping[T, int], line: Ints) -> Ints:
    """Return the number of what holds at each line, (n,).

    `changes` are lines, from 1, and what holds behind each; first of all in line 0.
    """
    rows = np.array([row for row, _ in changes], np.int64)
    held = np.array([number[value] for _, value in changes], np.int64)
    return np.asarray(held[np.searchsorted(rows, line, side="left") - 1])
