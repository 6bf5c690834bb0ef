"""Faults of a draft that is deleted again, said in lines of the source it was made from."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.gcode import read_motions

_LINE = re.compile(r"\bline (\d+)")


@dataclass(frozen=True, slots=True)
class SourceLines:
    """Of each line of a draft the source's line of the contour that stands there, or next."""

    line: NDArray[np.int64]  # (k,) of the draft's beads, ascending
    source: NDArray[np.int64]  # (k,) where the source begins the contour of each

    @staticmethod
    def of(draft: Path, contour_lines: NDArray[np.int32]) -> SourceLines:
        """Return the lines of a draft; of none where it cannot be read.

        Parameters
        ----------
        contour_lines : (n,) where the source begins each contour, in the draft's order
        """
        none = np.zeros(0, np.int64)
        try:
            motions = read_motions(draft)
        except InputError:
            return SourceLines(none, none)
        contour = np.asarray(motions.contour)
        known = np.flatnonzero((contour >= 0) & (contour < len(contour_lines)))
        source = contour_lines[contour[known]].astype(np.int64)
        return SourceLines(np.asarray(motions.line, np.int64)[known], source)

    def at(self, line: int) -> int | None:
        """Return the source's line for a line of the draft; None where nothing is printed on."""
        k = int(np.searchsorted(self.line, line))
        return (int(self.source[k]) or None) if k < len(self.line) else None

    def first(self, text: str) -> int | None:
        """Return the source's line for the first line that a text names."""
        named = _LINE.search(text)
        return None if named is None else self.at(int(named[1]))

    def stated(self, text: str) -> str:
        """Return a text with the lines it names as lines of the source."""
        return _LINE.sub(lambda named: f"line {self.at(int(named[1])) or named[1]}", text)
