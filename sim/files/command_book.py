"""The judge's book of commands: what the source commands, the result commands.

Both texts are read line by line, by a reading of the judge's own. A line commands what is left of
it without its number, its checksum and its comments, in brackets or behind a semicolon. Words
behind a comment in brackets command, as they do for firmwares that know such comments. A carriage
return ends a line.

Every command stands as often as in the source, but for those that other books keep: moves and
filament (`sim.files.moves`, `sim.files.ledger`), how coordinates and filament are counted,
progress, which is told anew, and what sets a state (`sim.files.settings` and, of heaters,
`sim.files.temperatures`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.files.commands import shown
from sim.files.lines import no_comment_no_move

_ROW = re.compile(rb"[^\n]++")
_OWN_WAIT = re.compile(
    rb"\s*+G4 P\d++ ; decmcts (?:waits for cooling|stands idle)\s*+\Z"
)  # plans make them anew
_BRACKETS = re.compile(rb"\([^()\n]*+\)")
_NUMBER = re.compile(rb"[Nn] ?\d++(?:\.\d*+)?")
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
    return listed(FaultKind.COMMAND, missing[:LIMIT], total=len(missing))


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
    return listed(FaultKind.COMMAND, missing[:LIMIT], total=len(missing))


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
    if numbered := _NUMBER.match(code):
        code = _CHECKSUM.sub(b"", code[numbered.end() :])
    code = b" ".join(code.split())
    word = _WORD.match(code)
    return code if word is None else word[1].upper() + code[word.end() :]
