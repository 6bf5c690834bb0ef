"""The programs of finished files, any slicer's or those of several heads.

Reading a file is `decmcts.formats.gcode`'s; what a controller makes of it in time is not.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from decmcts.arrays import Ints
from decmcts.errors import InputError
from decmcts.formats.gcode.controller.duration import dwell_seconds, file_program
from decmcts.formats.gcode.controller.limits import state_limits, stated_limits
from decmcts.formats.gcode.dialects.dialect import is_layer_comment
from decmcts.print.machine import Machine, MotionLimits
from decmcts.print.motion import limits_of
from decmcts.print.motion_kernels import FACTOR
from sim.controllers.program import (
    AMBIENT_C,
    HeadProgram,
    Heaters,
    HotEnd,
    StopKind,
    Stops,
    stops_of,
)
from sim.heads.file import HeadFile, read_head_file
from sim.heads.heat import heat_of

_DWELLS, _RESTS = re.compile(rb"G4(?![\d.])"), re.compile(rb"(M400|M0|M1|M226|M25|M600)(?![\d.])")
_COMMENT = re.compile(rb"^;[; ]*+([^\r\n]*)", re.MULTILINE)
FIRST_FEED = 25.0  # mm/s, as Marlin's, before a file names one


def programs_of_files(paths: Sequence[Path], machine: Machine) -> tuple[HeadProgram, ...]:
    """Return the program of each file, in the order in which their headers name heads.

    Raises
    ------
    InputError
        Where a file cannot be read, or several are not those of one `launch`.
    """
    files = [read_head_file(path, machine.words) for path in paths]
    if len(files) > 1:
        files = _together(files)
    given = {sync.number for file in files for sync in file.syncs if sync.signal}
    index = {number: k for k, number in enumerate(sorted(given))}
    for file in files:
        for sync in file.syncs:
            if sync.number not in index:
                raise InputError(
                    f"waits for number {sync.number}, which no file gives", path=file.path,
                    line=sync.line, advice="name the files of all heads",
                )  # fmt: skip
    return tuple(_program(file, machine, index) for file in files)


def _together(files: Sequence[HeadFile]) -> list[HeadFile]:
    """Return files of several heads in their order; InputError unless they are one `launch`'s."""
    for file in files:
        if not file.name:
            raise InputError(
                "is not the file of one head of several", path=file.path,
                advice="name all files of one `launch` and nothing else",
            )  # fmt: skip
    found = sorted(files, key=lambda file: file.place)
    due = [(k + 1, len(files)) for k in range(len(files))]
    if [file.place for file in found] != due:
        places = ", ".join(f"{file.name} {file.place[0]} of {file.place[1]}" for file in found)
        raise InputError(
            f"these are files {places}", path=found[0].path, advice="name all files of one `launch`"
        )
    return found


def _program(file: HeadFile, machine: Machine, index: dict[int, int]) -> HeadProgram:
    limits, own = _limits_for(file, machine)
    stated = MotionLimits.unstated() if own else stated_limits(file.lines.text)
    rows = state_limits(file.track.table, limits.under(stated), stated, own=not own)
    moves, line = file_program(file.lines, file.motion, file.track, rows)
    stops, begins, ends, warm_c = _stops(file, line, index)
    rates = [head.idle.heat_c_s for head in machine.heads if head.name == file.name]
    hot_end = HotEnd(warm_c, *rates[:1])
    # controllers pass over feeds that are not above 0: the last one is in force
    last = np.maximum.accumulate(np.where(moves.feed > 0.0, np.arange(len(moves.feed)), -1))
    feed = np.where(last >= 0, moves.feed[np.maximum(last, 0)], FIRST_FEED)
    feed *= rows[moves.row, FACTOR]
    program = HeadProgram(
        file.name or Path(file.path).name, moves.points, moves.filament, feed,
        moves.row.astype(np.int64), tuple(limits_of(row) for row in rows), moves.rest,
        np.zeros(len(feed), np.int64), line.astype(np.int64), stops, begins, ends,
        first_layer_of(file.lines.text), hot_end,
    )  # fmt: skip
    return replace(program, action=np.cumsum(program.rests))


def first_layer_of(text: bytes) -> int:
    """Return the line, from 1, at which a slicer's comments name the first layer; 0: none does."""
    for comment in _COMMENT.finditer(text):
        if is_layer_comment(comment[1].decode("latin-1").rstrip()):
            return text.count(b"\n", 0, comment.start()) + 1
    return 0


def _limits_for(file: HeadFile, machine: Machine) -> tuple[MotionLimits, bool]:
    """Return the limits a file's head moves under, and whether they are its own.

    Where several heads print, what the file states does not replace a head's own.
    """
    for head in machine.heads:
        if head.name == file.name:
            return machine.limits_of(head), head.limits is not None and file.place[1] > 1
    return machine.limits, False


def _stops(
    file: HeadFile, line: Ints, index: dict[int, int]
) -> tuple[Stops, int, int | None, float]:
    """Return what stands between moves, and how many stops are above the print and above its end.

    Last how hot the hot end is behind the start code, degrees. `line` has the line of each move,
    from 1. In a file of one head of several the hot end is followed through the print.
    """
    set_up = next((sync.line for sync in file.syncs if sync.signal), len(file.lines) + 1)
    found = list[tuple[int, int, int, float]]()  # line, kind, number, seconds
    for sync in file.syncs:
        gives = StopKind.PASS if sync.moving else StopKind.SIGNAL
        kind = gives if sync.signal else StopKind.WAIT
        found.append((sync.line, kind, index[sync.number], 0.0))
    heaters = Heaters()
    for row, code in file.others:
        if _DWELLS.match(code):
            found.append((row, StopKind.DWELL, -1, dwell_seconds(file.lines, row - 1)))
        elif row > set_up and (heat := heat_of(code)) is not None and heat.degrees < np.inf:
            kind = StopKind.HEAT if heat.waits else StopKind.TARGET
            found.append((row, kind, -1, heat.degrees))
        elif (seconds := heaters.take(code)) > 0.0:
            found.append((row, StopKind.DWELL, -1, seconds))
        elif _RESTS.match(code):
            found.append((row, StopKind.REST, -1, 0.0))
    found.sort(key=lambda stop: stop[0])
    before = np.searchsorted(line, [stop[0] for stop in found]).tolist()
    stops = stops_of([(n, *stop[1:]) for n, stop in zip(before, found, strict=True)])
    return stops, *_print_of(stops), heaters.warm.get(b"hot end", AMBIENT_C)


def _print_of(stops: Stops) -> tuple[int, int | None]:
    """Return how many stops a head's start code has, and how many are above its end code.

    A head first signals that it is set up. Once it has printed all it says so, and its last waits
    are for the others to be done too: their end code switches off what all may share.
    """
    signals = np.flatnonzero((stops.kind == StopKind.SIGNAL) | (stops.kind == StopKind.PASS))
    waits = np.flatnonzero(stops.kind == StopKind.WAIT)
    if not len(signals) or not len(waits):
        return 0, None
    done = signals[signals < waits[-1]]
    return int(signals[0]) + 1, int(done[-1]) if len(done) > 1 else None
