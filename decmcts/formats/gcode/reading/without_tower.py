"""A source without its wipe tower: what a slicer prints for changes of tools that do not happen.

The beads of a tower, and of the parts of a file that a slicer marks as a change of tools, become
travels: their E words are taken out. All else stays, line by line, so lines keep their numbers.
"""

from __future__ import annotations

import re
from pathlib import Path

from decmcts.errors import InputError
from decmcts.formats.gcode.dialects.dialect import Kind, classify, role_of
from decmcts.formats.gcode.text.lines import command_of
from decmcts.print.contours import Role
from decmcts.print.machine import UNLOAD_MM

_LAYS = re.compile(rb"G0*[1-3](?![0-9.])(?=[^;(]*[XY])", re.I)
_PUSHED = re.compile(rb"(?<![ \t])[ \t]*+E[ \t]*+\+?(?:\d++\.?\d*+|\.\d++)", re.I)
_FILAMENT = re.compile(
    rb"G0*[1-3](?![0-9.])[^;(]*?[ \t]E[ \t]*+([-+]?(?:\d++\.?\d*+|\.\d++))", re.I
)
_TOOL = re.compile(rb"T\d++", re.I)
_COUNTS = re.compile(rb"M8([23])(?![0-9.])", re.I)


def without_tower(text: bytes, path: Path | str) -> tuple[bytes, int]:
    """Return a source's text without the beads of its wipe tower, and how many moves laid them.

    Raises InputError where E is counted from the start, so that each bead moves what all later
    words mean, and where a tool that was unloaded is loaded along the tower.
    """
    rows, moves, unloaded = text.split(b"\n"), 0, _Unloaded(path)
    tower = section = relative = False
    for k, row in enumerate(rows):
        lead = row.lstrip()[:1]
        if lead in b";(" and lead:
            event = classify(row)
            if event.kind == Kind.STATE and event.slot == "type":
                tower = role_of(event.text) == Role.WIPE_TOWER
            section = event.kind == Kind.SECTION or (section and event.kind != Kind.SECTION_END)
            if event.kind == Kind.SECTION_END:
                unloaded.refuse(k + 1)
            continue
        code = command_of(row)
        if counts := _COUNTS.match(code):
            relative = counts[1] == b"3"
        elif (tower or section) and _LAYS.match(code) and _PUSHED.search(code):
            if not relative:
                raise InputError(
                    "the wipe tower cannot be left out: E is counted from the start (M82)",
                    path=path, line=k + 1, advice="export with relative E (M83)",
                )  # fmt: skip
            rows[k] = _PUSHED.sub(b"", row, count=1)
            moves += 1
        elif section or _TOOL.match(code):
            unloaded.take(code)
    return b"\n".join(rows), moves


class _Unloaded:
    """How much filament of each tool changes of tools have pulled, without beads of the tower."""

    def __init__(self, path: Path | str) -> None:
        self._path = path
        self._tool, self._taken = b"", False
        self._pulled = dict[bytes, float]()  # mm, by the command that chooses the tool

    def take(self, code: bytes) -> None:
        """Take a command of a change of tools, or one that chooses a tool."""
        if chosen := _TOOL.match(code):
            self._tool, self._taken = chosen[0].upper(), True
        elif filament := _FILAMENT.match(code):
            pulled = self._pulled.get(self._tool, 0.0) - float(filament[1])
            self._pulled[self._tool] = pulled

    def refuse(self, line: int) -> None:
        """Raise InputError where the tool that was taken in a change is not loaded at its end."""
        if not self._taken:
            return
        if (pulled := self._pulled.pop(self._tool, 0.0)) > UNLOAD_MM:
            raise InputError(
                "the wipe tower cannot be left out: the change of tools that ends here loads "
                f"{pulled:.0f} mm of filament along it",
                path=self._path, line=line,
                advice="slice for a printer with a hot end for each tool, or leave the tower in",
            )  # fmt: skip
        self._taken = False
