"""The lines of a G-code file as arrays, and the faults a line can have.

The scanning itself is `decmcts._kernels.gcode_scan`; this is its typed front.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels import gcode_scan as scan
from decmcts.errors import InputError

LIMIT_MM = 1e5  # no printer reaches 100 m; larger coordinates are damage
_NUMBERED = re.compile(
    rb"^[ \t]*N\d+[ \t]*([^;\r\n]*?)[ \t]*(?:\*\d+)?[ \t]*(?=[;\r\n]|\Z)", re.I | re.M
)
_FAULTS = {
    scan.NO_NUMBER: "a parameter without a number (truncated line?)",
    scan.BAD_NUMBER: "a number that cannot be read",
    scan.EXTRA_AXIS: "a move of an axis other than X, Y, Z, E",
    scan.BAD_CHARACTER: "a character that is no parameter",
}


@dataclass(frozen=True, slots=True)
class Lines:
    """Every line of one file; line k of the text (from 1) is index k - 1."""

    path: str
    text: bytes
    starts: NDArray[np.int64]  # (n,) first byte
    ends: NDArray[np.int64]  # (n,) past the last byte, line end left out
    letter: NDArray[np.uint8]  # (n,) command letter, 0: none, gcode_scan.OTHER: a macro
    code: NDArray[np.int32]  # (n,) command number times ten
    values: NDArray[np.float64]  # (n, N_PARAMETERS) NaN where absent
    comment: NDArray[np.int64]  # (n,) byte where a ; comment starts, ends[k] without one
    decimals: NDArray[np.int64]  # (N_PARAMETERS,) most decimals seen

    def __len__(self) -> int:
        return len(self.starts)

    def raw(self, line: int) -> bytes:
        """Return the bytes of one line without its line end."""
        return self.text[self.starts[line] : self.ends[line]]

    def span(self, first: int, last: int) -> bytes:
        """Return lines first..last - 1 byte for byte, line ends included.

        Only line numbers and checksums are taken off: they count the source's lines.
        """
        if last <= first:
            return b""
        stop = int(self.starts[last]) if last < len(self) else len(self.text)
        text = self.text[int(self.starts[first]) : stop]
        return _NUMBERED.sub(rb"\1", text) if _NUMBERED.search(text) else text

    def refuse(self, line: int, what: str, advice: str = "") -> InputError:
        """Return the error that names a line of this file (index from 0)."""
        shown = self.raw(line)[:60].decode("utf-8", "replace").strip()
        return InputError(f"{what}: '{shown}'", path=self.path, line=line + 1, advice=advice)


def split_lines(text: bytes, path: Path | str) -> Lines:
    """Scan a text into lines.

    Raises
    ------
    InputError
        At the first line that is damaged: a parameter without a number, a
        number out of range, an axis that is none of ours.
    """
    if text.startswith(b"\xef\xbb\xbf"):
        text = b"   " + text[3:]
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


def _check(lines: Lines, fault: NDArray[np.uint8]) -> None:
    bad = np.flatnonzero(fault)
    if len(bad):
        first = int(bad[0])
        raise lines.refuse(first, _FAULTS[int(fault[first])], "export the G-code again")
    finite = np.nan_to_num(lines.values[:, : scan.F], nan=0.0)
    large = np.flatnonzero((np.abs(finite) > LIMIT_MM).any(axis=1) & (lines.letter == 71))
    huge_e = np.abs(finite[large, scan.E]) > 1e9  # absolute E may be long
    large = large[(np.abs(finite[large, : scan.E]) > LIMIT_MM).any(axis=1) | huge_e]
    if len(large):
        raise lines.refuse(int(large[0]), f"a coordinate beyond ±{LIMIT_MM:g} mm")
    _check_tail(lines)


def _check_tail(lines: Lines) -> None:
    """Refuse a file that stops in the middle of a move."""
    if not len(lines):
        return
    last = len(lines) - 1
    cut = not lines.text.endswith(b"\n") and lines.letter[last] == 71 and lines.code[last] <= 30
    if cut and lines.raw(last)[-1:] in b".-+":
        raise lines.refuse(last, "the file ends in the middle of a line", "export it again")
