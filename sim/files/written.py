"""A G-code file of one head judged against the print it was made from.

The one judge of such files, before anyone may run them and whenever they are verified later. Every
extrusion occurs once, with the source's filament and feed, under the state and with the filament
retracted as there. The file waits where the plan waits, it hands over to the end G-code as the
source does, and no written move touches the print.

A source can be read without its wipe tower. The E word is taken out of each move in X or Y that
pushes filament where the last comment on what is printed names a tower, or between the marks of a
change of tools. What a plan printed besides is found missing or too much by everything that
compares contours.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from decmcts.arrays import Ints
from decmcts.errors import InputError
from decmcts.formats.gcode import (
    GcodeDocument,
    Motions,
    read_gcode,
    read_written,
)
from decmcts.formats.gcode.reading.reader import Ending
from decmcts.formats.gcode.text.source_text import line_with_number, load_text
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import ActionKind, HeadActions
from sim.content.inventory import alike_of
from sim.content.seams import Moved, seams_of_file
from sim.faults import Fault, FaultKind, Verdict, listed
from sim.files.changes import Taken, as_taken
from sim.files.commands import check_book, check_commands, states_in_force
from sim.files.ledger import check_filament
from sim.files.moves import Matched, check_moves, contours_laid
from sim.files.settings import TravelSettings, check_settings, settings_of, travelling
from sim.files.temperatures import check_temperatures, in_phases

DWELL_S = 2e-3  # files give dwells in whole milliseconds
SAME_PLACE_MM = 0.02
HOT_ENDS = ("temperature hotend",)  # how slots begin that say how hot tools are told to be
XYZ_MM = 1e-3
OVER_MM = 1.0  # above the print the head may stand when its end G-code begins
DWELL = re.compile(rb"^G4 P(\d+)", re.M)
Dwell = tuple[int, float]  # its line, from 1, and seconds


def verify_written(
    path: Path | str,
    job: PrintJob,
    document: GcodeDocument,
    machine: Machine,
    *,
    seams: Sequence[Moved] | None = None,
    actions: HeadActions | None = None,
    plate: int | None = None,
) -> Verdict:
    """Check a one-head file against the job and the document it was made from.

    All that is asked of such a file is asked here: of a draft before it is put in place, and of
    a file that `decmcts verify` is given. Contacts on moves that make the same contact in the
    source (in its end code, say) are the source's own and are warnings. Where the source goes
    through the same temperatures part by part, a file may do so once
    (`sim.files.temperatures`); where its changes of tools are alike a file may have fewer
    (`sim.files.changes`).

    Parameters
    ----------
    seams : Sequence[Moved] | None
        The loops that have to begin at another vertex; None: those that do.
    actions : HeadActions | None
        The plan the file was made from, whose waits it has to keep.
    plate : int | None
        Which of a .gcode.3mf is judged.
    """
    judge = partial(_verify, path, machine=machine, seams=seams, actions=actions, plate=plate)
    verdict = judge(job, document)
    if verdict.ok or (phases := in_phases(job, document)) is None:
        return verdict
    again = judge(*phases)
    return again if len(again.faults) < len(verdict.faults) else verdict


def _verify(
    path: Path | str, job: PrintJob, document: GcodeDocument, machine: Machine, *,
    seams: Sequence[Moved] | None, actions: HeadActions | None, plate: int | None,
) -> Verdict:  # fmt: skip
    """Return the verdict on a file with the epochs and the blocks that are given."""
    source = document.moves
    try:
        ours, _, motions, ending = read_written(path, document, plate)
        text = load_text(path, plate)
    except InputError as error:
        return Verdict((Fault(FaultKind.STATE, f"the file cannot be read back: {error}"),))
    moved = list(seams_of_file(ours.contours, job.contours)) if seams is None else seams
    taken = as_taken(contours_laid(motions, source, job, moved), job, document, source)
    # where tools change elsewhere, how hot they are told to be is compared by values alone
    ends = ending_faults(document, ending, hot_ends=taken is None)
    if taken is not None:
        job, document = taken.job, taken.document
    matched = check_moves(motions, source, machine, job=job, seams=moved)
    if matched.is_other:
        return matched.verdict()
    dwells = list(_dwells(text))
    faults = [
        *listed(FaultKind.STATE, ends),
        *_check_text(text, motions, job, document, matched, taken),
        *_check_stands(dwells, motions, matched),
    ]
    if actions is not None:
        faults += _check_waits(dwells, motions, matched.laid, actions)
    verdict = matched.verdict(faults)
    numbered = check_line_numbers(line_with_number(path, plate))
    return replace(verdict, faults=(*numbered, *verdict.faults))


def verify_same(job: PrintJob, document: GcodeDocument, machine: Machine) -> Verdict:
    """Check a file that is its source, byte for byte, as `plan` leaves what cannot be made faster.

    Its commands are the source's, and so are its states and its filament. Contacts on moves that
    print no contour are warnings, as in what is made of it.
    """
    moves = document.moves
    checked = ("the file is its source, byte for byte",)
    return check_moves(moves, moves, machine, job=job).verdict(checked=checked)


def check_line_numbers(line: int | None) -> list[Fault]:
    """Check that no line has a number, the first as given: none is read, so none may be written."""
    if line is None:
        return []
    text = f"line {line} has a line number, and a firmware stops where the next is another"
    return [Fault(FaultKind.COMMAND, text)]


def ending_faults(document: GcodeDocument, ending: Ending, *, hot_ends: bool = True) -> list[str]:
    """Return how a file made from `document` reaches its end G-code otherwise than the source.

    End G-code relies on where the head is, what is retracted, and what is set; without `hot_ends`
    these may be told anything.
    """
    cursor, end, but = ending.cursor, document.end, () if hot_ends else HOT_ENDS
    faults = _place(ending, end.position)
    if abs(cursor.owed - end.owed) > XYZ_MM or cursor.firmware_retracted != end.firmware_retracted:
        faults.append(f"{cursor.owed:.3f} mm are retracted, in the source {end.owed:.3f}")
    if cursor.relative_e != end.relative_e or cursor.tool != end.tool:
        faults.append("the mode of E or the tool is another")
    if not end.relative_e and abs(cursor.e - end.e) > XYZ_MM:
        faults.append(f"E stands at {cursor.e:.5f}, in the source at {end.e:.5f}")
    ours = states_in_force(ending.states, cursor.state, but)
    theirs = states_in_force(document.states, end.state, but)
    faults += [f"in force is '{a}'" for _, a in sorted(ours - theirs)]
    faults += [f"not in force is '{a}'" for _, a in sorted(theirs - ours)]
    return [f"before the end G-code {fault}" for fault in faults]


def _place(ending: Ending, place: tuple[float, float, float]) -> list[str]:
    """Return what is wrong with where the head is when it should be at, or above, `place`.

    On the print it may only stand where it has just laid the last bead.
    """
    at = ending.cursor.position
    if max(abs(a - b) for a, b in zip(at[:2], place[:2], strict=True)) > 2 * XYZ_MM:
        return [f"the head is at {at}, in the source at {place}"]
    just_laid = max(abs(a - b) for a, b in zip(at, ending.laid, strict=True)) <= 2 * XYZ_MM
    if just_laid and abs(at[2] - place[2]) <= 2 * XYZ_MM:
        return []
    if at[2] <= ending.top + XYZ_MM:
        return [f"the head comes down on the print at {at}, {ending.top:g} mm high"]
    highest = max(ending.top, place[2]) + OVER_MM
    return [f"the head is at {at}, above {highest:g} mm"] if at[2] > highest else []


def _check_text(
    text: bytes, motions: Motions, job: PrintJob, document: GcodeDocument, matched: Matched,
    taken: Taken | None,
) -> list[Fault]:  # fmt: skip
    """Check a file's commands, filament, settings and temperatures against the source's."""
    known, lines = matched.contour >= 0, np.asarray(motions.line)
    laid, contour = matched.laid[known], matched.contour[known]
    epoch = np.asarray(job.contours.epoch, np.int64)[contour]
    faults, places = check_commands(text, document, lines[laid], epoch)
    faults += check_filament(motions, document.moves, document, places, (laid, contour), taken)
    try:
        source = source_text(document)
    except InputError as error:
        unread = f"the source cannot be read once more: {error}"
        return [*faults, Fault(FaultKind.STATE, unread)]
    ours, theirs = settings_of(text), settings_of(source)
    travels = TravelSettings.of(theirs, travels_of(document.moves))
    known = matched.source_line >= 0
    line, there = lines[matched.laid[known]], matched.source_line[known]
    return [
        *faults,
        *check_book(text, source, None if taken is None else taken.commands()),
        *check_settings(ours, theirs, line, there, alike_of(matched.segments)[known]),
        *listed(FaultKind.STATE, list(travels.differing(ours, travels_of(motions)))),
        *check_temperatures(text, source, line, there, own_tool=taken is not None),
    ]


def travels_of(motions: Motions) -> Ints:
    """Return the lines, from 1, in which a file travels from its first bead to its last."""
    moves = travelling(motions.points, np.asarray(motions.extrusion), motions.placed)
    return np.asarray(motions.line, np.int64)[moves]


def source_text(document: GcodeDocument) -> bytes:
    """Return the text of a source; raises InputError when it cannot be read once more."""
    return document.text or load_text(document.path, document.plate)


def _check_stands(dwells: Sequence[Dwell], motions: Motions, matched: Matched) -> list[Fault]:
    """Check that the file never stands still within a contour: a hot nozzle leaves a blob there."""
    line = np.asarray(motions.line)[matched.laid]
    lines = np.array([n for n, _ in dwells], np.int64)
    next_bead = np.searchsorted(line, lines)
    within = (next_bead > 0) & (next_bead < len(line))
    lines, next_bead = lines[within], next_bead[within]
    before, contour = matched.contour[next_bead - 1], matched.contour[next_bead]
    same = (before == contour) & (contour >= 0)
    words = [
        f"line {n} stands still within contour {of}"
        for n, of in zip(lines[same].tolist(), contour[same].tolist(), strict=True)
    ]
    return listed(FaultKind.COMMAND, words)


def _dwells(text: bytes) -> Iterator[Dwell]:
    at, n = 0, 1
    for dwell in DWELL.finditer(text):
        n += text.count(b"\n", at, dwell.start())
        at = dwell.start()
        yield n, int(dwell[1]) / 1000.0


def _check_waits(
    dwells: Sequence[Dwell], motions: Motions, laid: Ints, actions: HeadActions
) -> list[Fault]:
    """Check that the file stands still wherever the plan waits, as long, before the same bead.

    `laid` are the moves that lay beads, in the file's order.
    """
    if not (actions.kind == ActionKind.WAIT).any():
        return []
    line = np.asarray(motions.line)[laid]
    stood: dict[int, float] = {}  # seconds before each laying move
    for n, seconds in dwells:
        k = int(np.searchsorted(line, n))
        stood[k] = stood.get(k, 0.0) + seconds
    stops = [(motions.points[laid[k]], seconds) for k, seconds in stood.items() if k < len(laid)]
    lines, due, used = [], 0.0, 0
    waits, prints = (actions.kind == kind for kind in (ActionKind.WAIT, ActionKind.PRINT))
    for a in np.flatnonzero(waits | prints).tolist():
        if waits[a]:
            due += float(actions.end_s[a] - actions.begin_s[a])
        elif due > 0.0:
            begin = actions.action_path(a)[0]
            left = range(used, len(stops))
            near = (k for k in left if np.abs(stops[k][0] - begin).max() < SAME_PLACE_MM)
            found = next(near, None)
            seconds = 0.0 if found is None else stops[found][1]
            if seconds < due - DWELL_S:
                lines.append(
                    f"waits {seconds:.1f} s before contour {actions.contour[a]}, "
                    f"planned {due:.1f} s"
                )
            if found is not None:
                used = found + 1
            due = 0.0
    return listed(FaultKind.COOLING, lines)


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
    return read_gcode(document.path, plate, text=_left_out(source_text(document)))


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
