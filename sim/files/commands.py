"""Everything in a file that is no contour, against its source.

Start code, end code and blocks that stand at barriers must be the source's, command by
command and in their place. Between contours only these commands are accepted: moves, which
are simulated; retraction, which is counted; and commands that set a state, in the source's
own words, whose effect is compared bead by bead elsewhere. Comments and progress (M73) command
nothing. Every other command is a fault, known or not.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.formats.gcode import GcodeDocument
from decmcts.formats.gcode.dialects.dialect import DWELL_MARKS
from decmcts.formats.gcode.document import Block
from decmcts.formats.gcode.text.lines import command_of
from sim.arrays import Ints
from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.files.lines import not_plain

LONGEST_DWELL_S = 600.0  # no layer time asks for more
_NUMBER = rb"(?:\d++(?:\.\d++)?|\.\d++)"  # one way to read it, however long
_FEED = rb" F(?=[0.]*+[1-9])" + _NUMBER  # above 0: some firmwares never end a move without feed
_AT = rb" %c-?" + _NUMBER
_LINE = rb"G1(?=[ ])(?: [XYZE]-?" + _NUMBER + rb")*+"
_ARC = rb"G[23]" + _AT % b"X" + _AT % b"Y" + rb"(?:" + _AT % b"Z" + rb")?"
_ARC += _AT % b"I" + _AT % b"J" + _AT % b"E"  # none but beads are turned
_MOVE = re.compile(rb"(?:" + _LINE + rb"|" + _ARC + rb")(?:" + _FEED + rb")?\r?\Z")
_PLAIN = re.compile(rb";|" + _MOVE.pattern)
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
_BLOCKS_ALONE = ("tool", "temperature")  # states that only verbatim blocks may set


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

    Parameters
    ----------
    document : GcodeDocument
        Start code, end code, blocks and states of the source.
    line, epoch : (n,)
        Where the file lays each known bead, from 1, and the epoch the source has it in.
    """
    text = text.rstrip()
    rows = text.split(b"\n")
    begin, faults = match_start(rows, document.preamble)
    end, more = match_end(rows, document.postamble)
    lines = faults + more
    taken: set[int] = set()
    spans, more = _find_blocks(rows, document.blocks, line, epoch, taken)
    lines += more
    known = known_settings(document)
    for k in not_plain(text, _PLAIN):
        if _WITH_EXPONENT.match(rows[k].lstrip()):
            lines.append(f"line {k + 1}: {shown(rows[k])} has an exponent: firmwares differ in it")
        if begin <= k < end and k not in taken and not accepted(rows[k], known):
            lines.append(f"line {k + 1}: {shown(rows[k])} is not in the source at this place")
    found = listed(FaultKind.COMMAND, lines[:LIMIT], total=len(lines))
    return found, Verbatim(begin + 1, end + 1, tuple(spans))


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
    rows: Sequence[bytes], blocks: Sequence[Block], line: Ints, epoch: Ints, taken: set[int]
) -> tuple[list[tuple[int, int] | None], list[str]]:
    """Return where each block is, from 1, and what is wrong; writes their lines into `taken`.

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
        found = [low + number for number, _ in has[at : at + len(due)]]
        taken.update(found)
        since = found[-1] + 1
        spans[-1] = (found[0] + 1, found[-1] + 1)
    return spans, lines


def known_settings(document: GcodeDocument) -> frozenset[bytes]:
    """Return the commands with which the source sets its states, comments left out."""
    states = document.states
    kept = [k for k, slot in enumerate(states.slots) if not slot.startswith(_BLOCKS_ALONE)]
    used = np.unique(states.rows[:, kept]).tolist() if kept else []
    texts = [text for k in used for text in (states.values[k], states.leave[k])]
    return frozenset(codes_of("\n".join(texts).encode("utf-8", "surrogateescape")))


def sets_state(code: bytes) -> bool:
    """Tell whether a command sets what holds from bead to bead, and is compared there."""
    name = _NAME.match(code.upper())
    return name is not None and name[0] in _SETS_STATE


def no_moves(text: bytes) -> list[int]:
    """Return the lines of a text, from 0, that are not plain moves (`is_move`) as they stand."""
    return not_plain(text, _MOVE)


def is_move(code: bytes) -> bool:
    """Tell whether a command is a move, which may stand between contours: moves are simulated."""
    return _MOVE.match(code) is not None


def accepted(row: bytes, known: frozenset[bytes]) -> bool:
    """Tell whether a line may stand between contours."""
    code = command_of(row)
    if not code or _MOVE.match(code) or _RETRACTION.match(code):
        return True
    if (dwell := _DWELL.match(code)) and row.rstrip().endswith(_OWN_DWELLS):
        return int(dwell[1]) <= 1000.0 * LONGEST_DWELL_S
    return sets_state(code) and code in known


def shown(code: bytes) -> str:
    """Return a command for a message."""
    text = code.strip()[:60].decode("utf-8", "replace")
    return f"'{text}'" if text else "nothing"
