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

_LAYS = re.compile(rb"G0*[1-3](?![0-9.])(?=[^;(]*[XY])", re.I)
_PUSHED = re.compile(rb"(?<![ \t])[ \t]*+E[ \t]*+\+?(?:\d++\.?\d*+|\.\d++)", re.I)
_COUNTS = re.compile(rb"M8([23])(?![0-9.])", re.I)


def without_tower(text: bytes, path: Path | str) -> tuple[bytes, int]:
    """Return a source's text without the beads of its wipe tower, and how many moves laid them.

    Raises
    ------
    InputError
        Where E is counted from the start, so that each bead moves what all later words mean.
    """
    rows, moves = text.split(b"\n"), 0
    tower = section = relative = False
    for k, row in enumerate(rows):
        lead = row.lstrip()[:1]
        if lead in b";(" and lead:
            event = classify(row)
            if event.kind == Kind.STATE and event.slot == "type":
                tower = role_of(event.text) == Role.WIPE_TOWER
            section = event.kind == Kind.SECTION or (section and event.kind != Kind.SECTION_END)
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
    return b"\n".join(rows), moves
