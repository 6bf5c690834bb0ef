"""The judge's book of temperatures: what each heater is told when a bead is laid.

Each bead of a file is laid with bed, chamber and hot ends told what they are told in the source
when it is laid there. Both files are read command by command. Behind a command that may heat or
cool in a way of its own (a macro, a tool change, homing with a hot nozzle) a heater's target is not
known: it is what that command left, the n-th of its kind in the file.

**Phases**: parts printed one by one each go through the same temperatures. Slicers print the first
layer hotter, and say so anew for each part. An order that prints the first layers of all parts, and
then the rest, sets each temperature once. It may do so where the source sets nothing but
temperatures between its epochs, comes down again wherever an earlier temperature is set again, and
has them in one sequence. Whether each bead then has the temperatures it has in the source is judged
as ever.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from decmcts.arrays import Ints
from decmcts.formats.gcode import GcodeDocument
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from sim.faults import Fault, FaultKind, listed_rows
from sim.files.commands import codes_of, commands_of, in_force

_HEAT = re.compile(rb"M1(04|09|40|90|41|91) ?(.*)", re.I | re.S)
_VALUE = re.compile(rb"[SR] ?(\d+\.?\d*|\.\d+)", re.I)
_TOOL = re.compile(rb"T ?(\d+)", re.I)
_SELECTS = re.compile(rb"T ?0*(25[0-4]|2[0-4]\d|1?\d?\d)", re.I)  # none is above 254
_HEATERS = {b"04": "hot end", b"09": "hot end", b"40": "bed", b"90": "bed"}
_OF_ALL = ("bed", "chamber")
# What a result may have more or less often, or elsewhere, than its source. None of it heats.
_QUIET = re.compile(
    rb"(?:G0*(?:[0-4]|1[01](?!.*P)|17|20|21|90|91|92)|M0*(?:73|74|82|83|106|107|117|126|127|201|203"
    rb"|204|205|207|208|220|221|400|486|566|572|593|624|625|900))(?![0-9.])|"
    rb"SET_(?:PRINT_STATS_INFO|VELOCITY_LIMIT|PRESSURE_ADVANCE|RETRACTION|FAN_SPEED)\b|"
    rb"EXCLUDE_OBJECT\w*",
    re.I,
)
_HOMES = re.compile(rb"G0*2[89](?![0-9])", re.I)  # some cool the nozzle, with which they probe

StatedHeats = tuple[tuple[str, str], ...]  # of each heater what it is told, in words


def check_temperatures(
    text: bytes, source: bytes, line: Ints, source_line: Ints, *, own_tool: bool = False
) -> list[Fault]:
    """Check that each bead is laid with all heaters told what the source tells them there.

    With `own_tool`, for files that change tools elsewhere: all heaters but hot ends of other tools.
    A tool that is chosen then keeps what it was told, and what any other command that may heat has
    left is known by what it says. Each bead is laid in `line` of the file and in `source_line` of
    the source, from 1, (n,).
    """
    ours, theirs = (list(_book(each, own_tool)) for each in (text, source))
    number = {
        stated: k for k, stated in enumerate(dict.fromkeys(stated for _, stated in ours + theirs))
    }
    a, b = in_force(ours, number, line), in_force(theirs, number, source_line)
    words = list(number)
    return listed_rows(
        FaultKind.STATE, np.flatnonzero(a != b),
        lambda k: f"line {line[k]} is printed with {_differing(words[a[k]], words[b[k]])} "
        f"(line {source_line[k]} there)",
    )  # fmt: skip


def _book(text: bytes, own_tool: bool) -> Iterator[tuple[int, StatedHeats]]:
    """Yield lines, from 1, and what all heaters that count are told behind each."""
    stated: dict[str, str] = {}
    tool, others = 0, 0
    yield 0, ()
    for number, code in commands_of(text):
        if _QUIET.match(code):
            continue
        heat = _HEAT.match(code)
        words = heat[2] if heat else b""
        value, named = _VALUE.search(words), _TOOL.search(words)
        left = _TOOL.sub(b"", _VALUE.sub(b"", words)).strip()
        if heat is not None and value is not None and not left:
            heater = _HEATERS.get(heat[1], "chamber")
            if heater == "hot end":
                heater += f" {int(named[1]) if named else tool}"
            stated[heater] = f"at {float(value[1]):g} degrees"
        else:
            others += 1
            selected = _SELECTS.fullmatch(code)
            tool = int(selected[1]) if selected else tool
            if selected and own_tool:
                known = set[str]()
            else:
                known = {*stated, f"hot end {tool}", "bed", "chamber"}
            if _HOMES.match(code):
                known = {heater for heater in known if heater.startswith("hot")}
            by = (
                f"'{code.decode('utf-8', 'replace')}'"
                if own_tool
                else f"command {others} that may heat"
            )
            stated |= dict.fromkeys(known, f"as {by} left it")
        hot = {f"hot end {tool}"} if own_tool else set(stated)
        counts = ((key, value) for key, value in stated.items() if key in hot or key in _OF_ALL)
        yield number, tuple(sorted(counts))


def _differing(ours: StatedHeats, theirs: StatedHeats) -> str:
    mine, own = dict(ours), dict(theirs)
    heater = next(h for h in sorted({*mine, *own}) if mine.get(h) != own.get(h))
    here, there = mine.get(heater, "told nothing"), own.get(heater, "told nothing")
    return f"the {heater} {here}, in the source {there}"


_SETS = re.compile(rb"M(104|140) S(\d++(?:\.\d*+)?)", re.I)
_IN_START = re.compile(rb"M1(?:0[49]|40|90) [SR](\d++(?:\.\d*+)?)\Z", re.I)
_BED = (b"M140", b"M190")

StatedDegrees = dict[str, float]


def in_phases(job: PrintJob, document: GcodeDocument) -> tuple[PrintJob, GcodeDocument] | None:
    """Return a print with one epoch for each of the temperatures its parts go through.

    None where its epochs are no such phases, or none is set again.
    """
    stated: StatedDegrees = {}  # by start code, in words that name no tool
    for code in codes_of(document.preamble):
        if value := _IN_START.match(code):
            stated["bed" if code[:4].upper() in _BED else "hot end"] = float(value[1])
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


def _come_down(contours: Contours, phase: np.ndarray[tuple[int], np.dtype[np.int32]]) -> bool:
    """Tell whether each epoch that goes back to an earlier phase begins another part below."""
    top, bottom = np.full(len(phase), -np.inf), np.full(len(phase), np.inf)
    np.maximum.at(top, contours.epoch, contours.top)
    np.minimum.at(bottom, contours.epoch, contours.bottom)
    highest = np.maximum.accumulate(top)
    back = np.flatnonzero(np.diff(phase) < 0) + 1
    return bool((bottom[back] < highest[back - 1]).all())
