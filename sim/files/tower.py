"""A source without its wipe tower, as the judge reads it where it was asked to be left out.

The E word is taken out of each move in X or Y that pushes filament where the last comment on what
is printed names a tower, or between the marks of a change of tools. What a plan printed besides is
found missing or too much by everything that compares contours.
"""

from __future__ import annotations

import re

from decmcts.formats.gcode import GcodeDocument, read_gcode
from decmcts.print.job import PrintJob
from sim.files.written import source_text

_MARK = re.compile(
    rb"^[ \t]*;[ \t]*(?:(?P<of>(?:TYPE|FEATURE)[ \t]*:[^\r\n]*)"
    rb"|(?P<begin>CP TOOLCHANGE START|WIPE_TOWER_START)"
    rb"|(?P<end>CP TOOLCHANGE END|WIPE_TOWER_END))"
    rb"|^(?P<move>[ \t]*G0*[123](?![\d.])[^;(\n]*)",
    re.M | re.I,
)
_TOWER = re.compile(rb":[ \t]*(?:wipe tower|prime[- ]tower|prime pillar)[ \t]*\Z", re.I)
_ACROSS = re.compile(rb"[XY] *[-+.\d]", re.I)
_WORD_OF_E = re.compile(rb"(?<![ \t])[ \t]*+E[ \t]*+\+?[.\d][\d.]*+", re.I)


def read_without_tower(
    document: GcodeDocument, plate: int | None = None
) -> tuple[PrintJob, GcodeDocument]:
    """Return a source read anew without its wipe tower; linear in its text."""
    text = source_text(document)
    assert text is not None
    return read_gcode(document.path, plate, text=_left_out(text))


def _left_out(text: bytes) -> bytes:
    kept, at, tower, inside = list[bytes](), 0, False, False
    for mark in _MARK.finditer(text):
        if named := mark["of"]:
            tower = _TOWER.search(named.rstrip()) is not None
        elif mark["begin"] or mark["end"]:
            inside = mark["begin"] is not None
        elif (tower or inside) and _ACROSS.search(mark["move"]):
            word = _WORD_OF_E.search(mark["move"])
            if word is not None:
                begin = mark.start("move")
                kept += [text[at : begin + word.start()]]
                at = begin + word.end()
    return b"".join([*kept, text[at:]])
