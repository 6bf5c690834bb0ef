"""The lines of a G-code file as arrays, and the faults a line can have.

The scanning itself is `decmcts.formats.gcode.text.scan_kernels`; this is its typed front.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.errors import InputError
from decmcts.formats.files.bounds import LARGEST_MM, LARGEST_SPEED_MM_S
from decmcts.formats.gcode.text import scan_kernels as scan

LARGEST_E_MM = 1e9  # of absolute E, which may count for years
LARGEST_RADIUS_MM = 1e6  # nearly straight arcs have their centre far away
_AXES = {  # what a word of a move is taken for, and what to do about it
    "AB": ("an extruder of MakerBot's dialect or a rotary axis", "if it is an extruder, export for "
           "Marlin or RepRap, where it is E; a print that turns cannot be planned"),
    "C": ("a rotary axis", "a print that turns cannot be planned: keep the slicer's file"),
    "UVWD": ("a further carriage or axis", "a print that moves it cannot be planned: keep the "
             "slicer's file, or slice for one head (`decmcts launch` makes files of several)"),
}  # fmt: skip
_AXIS = re.compile(r"[A-DU-W](?=\s*[-+.\d])", re.I)
EXPONENT = "a number with an exponent, which firmwares read in different ways"
_FAULTS = {
    scan.NO_NUMBER: "a parameter without a number (truncated line?)",
    scan.BAD_NUMBER: "a number that cannot be read",
    scan.BAD_CHARACTER: "a character that is no parameter",
    scan.EXPONENT: EXPONENT,
    scan.TWICE: "a word that stands twice, of which firmwares take the first or the last",
}


_PROGRESS = re.compile(rb"M0*73(?: ?[PRQSCDLB] ?[0-9.]*)*(?: ?\([^)]*\)?)?\Z", re.I)
_JOINED = re.compile(rb"(?<=[0-9.])(?=[A-Za-z])")  # two words that no blank parts
_LED_BY_COMMENT = re.compile(rb"(?:\s*+\([^)]*+\))++")  # what stands behind it commands
_PLAIN = re.compile(rb"G[0-3](?: [XYZEFIJ]-?[0-9.]+)+\Z")  # most lines: they command what they are


def command_of(line: bytes) -> bytes:
    """Return what a line commands, a blank between words, without comment.

    Nothing where it only tells progress (M73), which another order counts anew.
    """
    if _PLAIN.match(line):
        return line
    code = line.split(b";", 1)[0]
    if led := _LED_BY_COMMENT.match(code):
        code = code[led.end() :]
    code = b" ".join(code.split())
    if code[:1] in b"GMgm" and code[1:2].isdigit():
        code = _JOINED.sub(b" ", code)
    return b"" if code[:1] in (b"(", b"") or _PROGRESS.match(code) else code


def commands_of(text: bytes) -> list[bytes]:
    """Return what the lines of a text command, those left out that command nothing."""
    return list(filter(None, map(command_of, text.split(b"\n"))))


def above_comments(row: Callable[[int], bytes], line: int, text: bytes) -> int:
    """Return the row at which the comments that `text` begins with begin, above row `line`.

    As many of them as are there, in their order: comments may have come or gone. One of
    them may end what is in force, so what is in force where `text` begins is so above them.
    """
    above = takewhile(lambda row: not command_of(row), text.split(b"\n"))
    due = [comment.strip() for comment in above if comment.strip()]
    first = line
    while due and line > 0 and not command_of(row(line - 1)):
        line -= 1
        if (comment := row(line).strip()) in due:
            due, first = due[: due.index(comment)], line
    return first


@dataclass(frozen=True, slots=True)
class Lines:
    """Every line of one file; line k of the text (from 1) is index k - 1."""

    path: str
    text: bytes
    starts: Ints  # (n,) first byte
    ends: Ints  # (n,) past the last byte, line end left out
    letter: NDArray[np.uint8]  # (n,) command letter, 0: none, gcode_scan.OTHER: a macro
    code: Int32s  # (n,) command number times ten
    values: Floats  # (n, N_PARAMETERS) NaN where absent
    comment: Ints  # (n,) byte where a ; comment starts, ends[k] without one
    decimals: Ints  # (N_PARAMETERS,) most decimals seen

    def __len__(self) -> int:
        return len(self.starts)

    def raw(self, line: int) -> bytes:
        """Return the bytes of one line without its line end."""
        return self.text[self.starts[line] : self.ends[line]]

    def span(self, first: int, last: int) -> bytes:
        """Return lines first..last - 1 byte for byte, line ends included."""
        if last <= first:
            return b""
        stop = int(self.starts[last]) if last < len(self) else len(self.text)
        return self.text[int(self.starts[first]) : stop]

    def are(self, letter: str, codes: Collection[int]) -> Flags:
        """Tell which lines are one of these commands (numbers times ten), (n,)."""
        return np.asarray((self.letter == ord(letter)) & np.isin(self.code, list(codes)))

    @property
    def moves(self) -> Flags:
        """Which lines are G0 to G3, (n,)."""
        return np.asarray((self.letter == ord("G")) & (self.code <= 30))

    def refuse_first(self, wrong: Flags, what: str, advice: str = "") -> None:
        """Raise InputError at the first line that is `wrong`, (n,), if any is."""
        if len(rows := np.flatnonzero(wrong)):
            raise self.refuse(int(rows[0]), what, advice)

    def refuse(self, line: int, what: str, advice: str = "") -> InputError:
        """Return the error that names a line of this file (index from 0)."""
        shown = self.raw(line)[:60].decode("utf-8", "replace").strip()
        return InputError(f"{what}: '{shown}'", path=self.path, line=line + 1, advice=advice)


def split_lines(text: bytes, path: Path | str) -> Lines:
    """Scan a text into lines.

    Raises InputError at the first line that is damaged: a parameter without a number, a number out
    of range, an axis that is none of ours.
    """
    raw = np.frombuffer(text, np.uint8)
    breaks = np.flatnonzero(raw == 10).astype(np.int64)
    starts = np.concatenate([[0], breaks + 1]).astype(np.int64)
    ends = np.concatenate([breaks, [len(raw)]]).astype(np.int64)
    if starts[-1] == len(raw):
        starts, ends = starts[:-1], ends[:-1]
    returns = (ends > starts) & (raw[np.maximum(ends - 1, 0)] == 13)
    ends = ends - returns
    n = len(starts)
    letter, code = np.zeros(n, np.uint8), np.zeros(n, np.int32)
    values = np.full((n, scan.N_PARAMETERS), np.nan)
    fault, decimals = np.zeros(n, np.uint8), np.zeros(scan.N_PARAMETERS, np.int64)
    comment = np.zeros(n, np.int64)
    scan.scan_lines(raw, starts, ends, letter, code, values, fault, decimals, comment)
    lines = Lines(str(path), text, starts, ends, letter, code, values, comment, decimals)
    _check(lines, fault)
    return lines


def further_axis(row: bytes) -> tuple[str, str]:
    """Return what is wrong with a move of a further axis, and what to do about it."""
    found = _AXIS.search(row.split(b";", 1)[0].decode("latin-1"))
    axis = found[0].upper() if found else "A"
    taken_for, advice = next(texts for letters, texts in _AXES.items() if axis in letters)
    message = f"a move has a word {axis}, taken for {taken_for}; only X, Y, Z and E are planned"
    return message, advice


def _check(lines: Lines, fault: NDArray[np.uint8]) -> None:
    _check_brackets(lines)
    bad = np.flatnonzero(fault)
    if len(bad):
        first = int(bad[0])
        if fault[first] == scan.EXTRA_AXIS:
            raise lines.refuse(first, *further_axis(lines.raw(first)))
        raise lines.refuse(first, _FAULTS[int(fault[first])], "export the G-code again")
    for column, most, what in (
        (slice(scan.X, scan.E), LARGEST_MM, "a coordinate"),
        (slice(scan.OFFSET_I, scan.D), LARGEST_RADIUS_MM, "the centre of an arc"),
        (slice(scan.E, scan.F), LARGEST_E_MM, "an amount of filament"),
        (slice(scan.F, scan.OFFSET_I), 60.0 * LARGEST_SPEED_MM_S, "a feed"),
    ):
        wild = np.abs(lines.values[:, column]) > most  # NaN, a parameter left out, is not
        if wild.any():
            lines.refuse_first(wild.any(axis=1) & (lines.letter == 71), f"{what} beyond ±{most:g}")
    last = len(lines) - 1
    cut = len(lines) and lines.raw(last).endswith((b".", b"-", b"+"))
    if cut and lines.moves[last] and not lines.text.endswith(b"\n"):
        raise lines.refuse(last, "the file ends in the middle of a line", "export it again")


def _check_brackets(lines: Lines) -> None:
    """Refuse a G command with a bracket that stays open: firmwares differ in what it hides.

    RepRapFirmware takes the rest of the line for a comment, Marlin reads on (but for
    PAREN_COMMENTS), Klipper knows no brackets and stops.
    """
    opened = np.flatnonzero(np.frombuffer(lines.text, np.uint8) == ord("("))
    rows = np.unique(np.searchsorted(lines.starts, opened, side="right") - 1)
    for line in rows[lines.letter[rows] == ord("G")].tolist():
        code = lines.raw(line).split(b";", 1)[0]
        within = code[: max(code.rfind(b")"), 0)].split(b")")
        if any(b"(" in part.partition(b"(")[2] for part in within):
            raise lines.refuse(
                line, "a bracket within a bracket: firmwares differ in where such a comment ends",
                "begin it with a semicolon",
            )  # fmt: skip
        if code.rfind(b"(") > code.rfind(b")"):
            raise lines.refuse(
                line, "a bracket that is not closed hides the rest of the line from some firmwares",
                "close the comment, or begin it with a semicolon",
            )  # fmt: skip
