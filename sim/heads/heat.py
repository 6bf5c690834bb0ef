"""Temperatures of several heads: each is hot before it prints, and off at the end as in the source.

A source of several tools may heat one hot end for all of them, where each head has its own. So
it is found out here which heads a temperature that names no tool is for.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Sequence
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from decmcts.formats.gcode import GcodeDocument
from decmcts.print.job import PrintJob
from sim.files.commands import codes_of

_MOVES = re.compile(rb"G0*1(?=[ ]).*E|G1[01](?![0-9.])(?!.*[PL])", re.I)
_HOT_END = re.compile(rb"M10([49])(?![0-9.])(.*)", re.I)
_OF_BED = re.compile(rb"M1(40|90)(?![0-9.])(.*)", re.I)
_VALUE = re.compile(rb"[SR] ?(\d+\.?\d*|\.\d+)", re.I)
_NAMED = re.compile(rb"(?:(?<=\d)| )T ?0*(25[0-4]|2[0-4]\d|1?\d?\d)(?!\d)", re.I)
SELECTS = re.compile(rb"T0*(25[0-4]|2[0-4]\d|1?\d?\d)\Z", re.I)  # a tool: none is above 254


class Heat(NamedTuple):
    """A command that heats or cools a hot end."""

    waits: bool
    degrees: float  # inf: none are stated, as in templates of some hosts, which heat
    tool: int | None

    @property
    def heats(self) -> bool:
        """Whether it heats; else it switches off."""
        return self.degrees > 0.0


class Due(NamedTuple):
    """What the file of each head that prints must have."""

    one_hot_end: bool  # temperatures that name no tool are for all heads
    heats: bool  # it heats before its first print
    waits: bool  # and waits until it is hot
    ends_off: bool  # its last temperature is 0


def heat_of(code: bytes) -> Heat | None:
    """Return a command, comments left out, as what it does to a hot end; None: nothing."""
    match = _HOT_END.match(code)
    if match is None:
        return None
    degrees, named = degrees_of(match[2]), _NAMED.search(b" " + match[2])
    return Heat(
        match[1] == b"9", np.inf if degrees is None else degrees, int(named[1]) if named else None
    )


def degrees_of(words: bytes) -> float | None:
    """Return the degrees that a command to a heater states; None: none."""
    value = _VALUE.search(words)
    return None if value is None else float(value[1])


def heat_due(document: GcodeDocument, job: PrintJob) -> Due:
    """Return what the file of each head must have, by what the source does."""
    first = int(job.contours.epoch.min(initial=0))
    stated = list(_temperatures(document))
    early = [heat for epoch, _, heat in stated if epoch <= first and heat.heats]
    waits = any(heat.waits for heat in early)
    hot_since: dict[int, int] = {}  # tool -> epoch from which on it is hot
    for epoch, tool, heat in stated:
        if heat.heats and heat.waits == waits:
            hot_since[tool] = min(epoch, hot_since.get(tool, epoch))
    begins = {
        t: int(job.contours.epoch[job.contours.tool == t].min())
        for t in np.unique(job.contours.tool).tolist()
    }
    cold = [t for t, epoch in begins.items() if hot_since.get(t, epoch + 1) > epoch]
    ends = [heat for heat in map(heat_of, codes_of(document.postamble)) if heat is not None]
    off = any(not heat.heats and heat.tool is None for heat in ends)
    return Due(len(begins) > 1 and bool(early) and bool(cold), bool(early), waits, off)


def heats_early(rows: Sequence[tuple[int, bytes]], wait: int, start: Sequence[bytes]) -> int:
    """Return how many of a file's first rows heat bed and hot end while its head waits its turn.

    They are all that stands above the file's first wait, in line `wait`, once each at the most,
    wait for nothing, and are as hot as the commands `start` of its start code make them first.
    """
    due = set[bytes]()
    for pattern, code in ((_OF_BED, b"M140 S"), (_HOT_END, b"M104 S")):
        found = (match for command in start if (match := pattern.match(command)))
        values = [value[1] for match in found if (value := _VALUE.search(match[2]))]
        hot = [code + value for value in values if float(value) > 0.0]
        due.update(hot[:1])
    count = 0
    while count < len(rows) and rows[count][0] < wait and rows[count][1] in due:
        due.remove(rows[count][1])
        count += 1
    more = count < len(rows) and rows[count][0] < wait  # then they are the start code's own
    return 0 if more else count


def unheated(
    rows: Sequence[tuple[int, bytes]], others: Sequence[tuple[int, bytes]], first: int, due: Due,
    verbatim: Container[int] = (),
) -> list[str]:  # fmt: skip
    """Return what is wrong with the heat of a file that prints from line `first` on.

    `rows` are its lines and commands, `others` those that are no plain moves, `verbatim` the lines
    that are the source's as they stand.
    """
    temperatures = ((line, code) for line, code in others if code[:1] in b"Mm")
    stated = [(line, heat) for line, code in temperatures if (heat := heat_of(code)) is not None]
    hot = min((line for line, heat in stated if heat.heats), default=first)
    above = [heat for line, heat in stated if line < first]
    cold = min(hot, first) if due.heats else 0
    words = [
        f"line {line}: filament moves, and it was not heated"
        for line, code in takewhile(lambda row: row[0] < cold, rows)
        if line not in verbatim and _MOVES.match(code)
    ][:1]
    if due.heats and not (above and above[-1].heats):
        words.append(f"line {first}: it prints, and was not heated")
    elif due.waits and not any(heat.waits and heat.heats for heat in above):
        words.append(f"line {first}: it prints, and has not waited until it is hot")
    if due.ends_off and stated and stated[-1][1].heats:
        words.append(f"line {stated[-1][0]}: it stays hot, the source switches off at its end")
    return words


def _temperatures(document: GcodeDocument) -> Iterable[tuple[int, int, Heat]]:
    """Yield epoch, tool and command of each temperature set above and between prints.

    What the head of one tool alone is told behind the start code counts for that tool only.
    """
    texts: list[tuple[int, int, bytes, int | None]] = [(0, 0, document.preamble, None)]
    texts += [(0, own.selected, own.text, own.tool) for own in document.own_starts]
    texts += [(block.epoch, block.begin.tool, block.text, None) for block in document.blocks]
    for epoch, selected, text, alone in texts:
        for code in codes_of(text):
            if match := SELECTS.match(code.split()[0]):
                selected = int(match[1])
            elif (heat := heat_of(code)) is not None:
                tool = selected if heat.tool is None else heat.tool
                if alone is None or tool == alone:
                    yield epoch, tool, heat if alone is None else heat._replace(tool=tool)
