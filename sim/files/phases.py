"""Parts printed one by one that each go through the same temperatures.

Slicers print the first layer hotter, and say so anew for each part. An order that prints the first
layers of all parts, and then the rest, sets each temperature once. It may do so where the source
sets nothing but temperatures between its epochs, comes down again wherever an earlier temperature
is set again, and has them in one sequence. Whether each bead then has the temperatures it has in
the source is judged by `sim.files.temperatures`.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from decmcts.formats.gcode import GcodeDocument
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from sim.files.commands import codes_of

_SETS = re.compile(rb"M(104|140) S(\d++(?:\.\d*+)?)", re.I)
_IN_START = re.compile(rb"M1(?:0[49]|40|90) [SR](\d++(?:\.\d*+)?)\Z", re.I)
_BED = (b"M140", b"M190")

StatedDegrees = dict[str, float]


def in_phases(job: PrintJob, document: GcodeDocument) -> tuple[PrintJob, GcodeDocument] | None:
    """Return a print with one epoch for each of the temperatures its parts go through.

    None where its epochs are no such phases, or none is set again.
    """
    stated = _after_start(document.preamble)
    count = int(job.contours.epoch.max(initial=0)) + 1
    blocks = {block.epoch: block for block in document.blocks}
    if len(blocks) != len(document.blocks) or set(blocks) != set(range(1, count)) or job.refills:
        return None
    states: list[tuple[tuple[str, float], ...]] = [tuple(sorted(stated.items()))]
    for epoch in range(1, count):
        for code in codes_of(blocks[epoch].text):
            sets = _SETS.fullmatch(code)
            if sets is None:
                return None
            stated["bed" if sets[1] == b"140" else "hot end"] = float(sets[2])
        states.append(tuple(sorted(stated.items())))
    number = {state: k for k, state in enumerate(dict.fromkeys(states))}
    phase = np.array([number[state] for state in states], np.int32)
    first = [k for k in range(1, count) if phase[k] > phase[:k].max()]
    in_turn = all(phase[k - 1] == phase[k] - 1 for k in first)
    back = [k for k in range(1, count) if k not in first]
    if not back or not in_turn or phase[-1] != phase.max() or not _come_down(job.contours, phase):
        return None
    kept = tuple(replace(blocks[k], epoch=int(phase[k])) for k in first)
    contours = replace(job.contours, epoch=phase[job.contours.epoch])
    return replace(job, contours=contours), replace(document, blocks=kept)


def _after_start(preamble: bytes) -> StatedDegrees:
    """Return what start code tells the heaters in words that name no tool."""
    stated: StatedDegrees = {}
    for code in codes_of(preamble):
        if value := _IN_START.match(code):
            stated["bed" if code[:4].upper() in _BED else "hot end"] = float(value[1])
    return stated


def _come_down(contours: Contours, phase: np.ndarray[tuple[int], np.dtype[np.int32]]) -> bool:
    """Tell whether each epoch that goes back to an earlier phase begins another part below."""
    top, bottom = np.full(len(phase), -np.inf), np.full(len(phase), np.inf)
    np.maximum.at(top, contours.epoch, contours.top)
    np.minimum.at(bottom, contours.epoch, contours.bottom)
    highest = np.maximum.accumulate(top)
    back = np.flatnonzero(np.diff(phase) < 0) + 1
    return bool((bottom[back] < highest[back - 1]).all())
