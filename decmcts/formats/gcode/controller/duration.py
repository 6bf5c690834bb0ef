"""How long a G-code file takes: every move of it through the time model.

Firmware retraction becomes a move of filament; dwells are added; what waits for
temperatures, homing and probing takes no time, as in the slicers' own estimates.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.formats.gcode.controller.limits import (
    FirmwareRetraction,
    parameters,
    setting,
    state_limits,
    stated_limits,
)
from decmcts.formats.gcode.controller.motion import Motion, interpret
from decmcts.formats.gcode.controller.moves_kernels import FIRMWARE_RETRACTED
from decmcts.formats.gcode.controller.state import Track, track_state
from decmcts.formats.gcode.document import NO_ARC
from decmcts.formats.gcode.text.lines import Lines, split_lines
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.print.brief import brief
from decmcts.print.machine import MotionLimits
from decmcts.print.motion import Program
from decmcts.print.walls import has_walls
from decmcts.print.walls_kernels import Walls, over_walls

DOT_MM = 0.2  # of filament beyond what was pulled; less restarts the flow
FEW_DOTS = 2  # places with dots before the first bead; at fewer the nozzle is primed
STILL_MM = 1e-5  # filament that moves less does not
_STOPS_G = (40, 280, 290, 920)  # G4, G28, G29, G92: moves end before them
_STOPS_M = (0, 10, 250, 1090, 1160, 1900, 2260, 4000, 6000, 6010)


@dataclass(frozen=True, slots=True)
class FileTime:
    """The time of a file."""

    motion_s: float
    dwell_s: float  # G4
    change_s: float  # tool changes, as the file's settings state them
    seconds: Floats  # (m,) of each move, firmware retractions counted in
    line: Ints  # (m,) source line of each move, from 1
    print_s: float = 0.0  # of it, from where the first bead begins until the last one ends
    retractions: int = 0  # however many moves each takes
    over_walls_mm: float | None = None  # travel over outer walls; None: no walls are known
    arcs: int = 0  # G2 and G3 that print

    __repr__ = brief("motion_s", "dwell_s", "change_s", "retractions")

    @property
    def total_s(self) -> float:
        """All of it."""
        return self.motion_s + self.dwell_s + self.change_s


def print_time(
    path: Path | str,
    limits: MotionLimits,
    *,
    own_limits: bool = True,
    walls: Walls | None = None,
    plate: int | None = None,
) -> FileTime:
    """Estimate the time of a G-code file.

    Parameters
    ----------
    limits : MotionLimits
        The machine's, where the file states none.
    own_limits : bool
        Whether the file's own limits win; M204 always does.
    walls : Walls | None
        Outer walls of the print, to tell how much travel leads over them.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    text = load_text(path, plate)
    return text_time(text, limits, path=path, own_limits=own_limits, walls=walls)


def text_time(
    text: bytes, limits: MotionLimits, *, path: Path | str = "", own_limits: bool = True,
    walls: Walls | None = None,
) -> FileTime:  # fmt: skip
    """Estimate the time of G-code, as `print_time`."""
    lines = split_lines(text, path)
    motion = interpret(lines)
    track = track_state(lines, motion)
    stated = stated_limits(text) if own_limits else MotionLimits.unstated()
    rows = state_limits(track.table, limits.under(stated), stated, own=own_limits)
    program, line = file_program(lines, motion, track, rows)
    seconds = program.seconds()
    dwell = sum(dwell_seconds(lines, n) for n in np.flatnonzero(lines.are("G", (40,))).tolist())
    changes = _change_seconds(lines, motion)
    pulls = np.sign(program.filament[np.abs(program.filament) > STILL_MM])
    over = travel_over(program, walls) if walls is not None and has_walls(walls) else None
    printing = _print_seconds(lines, program, seconds, line) + changes
    return FileTime(
        float(seconds.sum()), dwell, changes, seconds, line, printing,
        int((np.diff(pulls, prepend=1.0) < 0.0).sum()), over,
        len(np.unique(motion.arc[(motion.arc != NO_ARC) & (motion.extrusion > 0.0)])),
    )  # fmt: skip


def _print_seconds(lines: Lines, program: Program, seconds: Floats, line: Ints) -> float:
    """Return the seconds from the first bead to the last, dwells between them included.

    A part of the same sum as the whole file's time, so it is never longer.
    """
    beads = _beads(program)
    if not len(beads):
        return 0.0
    first, last = int(beads[0]), int(beads[-1])
    dwells = np.flatnonzero(lines.are("G", (40,))) + 1
    inside = dwells[(dwells > line[first]) & (dwells < line[last])] - 1
    moving = float(seconds[first : last + 1].sum())
    return moving + sum(dwell_seconds(lines, n) for n in inside.tolist())


def _beads(program: Program) -> Ints:
    """Return the moves that lay beads, dots and vertical beads too.

    A push on the spot or straight up lays what goes beyond the filament that was pulled. Before
    all beads across the bed it does so only where it is not the one place of a purge.
    """
    across = np.hypot(*np.diff(program.points, axis=0)[:, :2].T) > 0.0
    pulled = np.concatenate([[0.0], np.cumsum(-program.filament)])
    owed = pulled - np.minimum.accumulate(pulled)
    given = ~across & (program.filament - owed[:-1] > DOT_MM)
    beads = across & (program.filament > STILL_MM)
    early = given & ~np.logical_or.accumulate(beads)
    if len(np.unique(program.points[1:][early][:, :2], axis=0)) < FEW_DOTS:
        given &= ~early
    return np.flatnonzero(beads | given)


def travel_over(program: Program, walls: Walls) -> float:
    """Return the length of travel moves over outer walls, in mm.

    Of moves between the first bead and the last that cross, seen from above, an outer
    wall of the layer printed last or of the one printed next. Wipes, which pull filament back
    along a bead, are none.
    """
    start, goal = program.points[:-1].copy(), program.points[1:].copy()
    across = np.hypot(*(goal - start)[:, :2].T)
    beads = np.flatnonzero((program.filament > STILL_MM) & (across > 0.0))
    travels = np.flatnonzero((np.abs(program.filament) <= STILL_MM) & (across > 0.0))
    if not len(beads):
        return 0.0
    travels = travels[(travels > beads[0]) & (travels < beads[-1])]
    upcoming = np.searchsorted(beads, travels)
    z = program.points[1:, 2]
    start[travels, 2], goal[travels, 2] = z[beads[upcoming - 1]], z[beads[upcoming]]
    return float(across[travels][over_walls(walls, start[travels], goal[travels])].sum())


def file_program(
    lines: Lines, motion: Motion, track: Track, limits: Floats
) -> tuple[Program, Ints]:
    """Return all moves of a file, and the source line (from 1) of each.

    `limits` are in force in each machine state, (n_states, N_LIMITS).
    """
    turned = np.diff(motion.modes[:, FIRMWARE_RETRACTED], prepend=np.int16(0))
    at = np.flatnonzero(turned)
    place = motion.before[at]
    length, feed = np.zeros(len(at)), np.zeros(len(at))
    if len(at):
        firmware = FirmwareRetraction.of(lines.text, track)
        moved = [firmware.at(n, pull=bool(turned[n] > 0)) for n in at.tolist()]
        length[:], feed[:] = np.array(moved).T
    line = np.insert(motion.line, place, at)
    walls = np.flatnonzero(lines.are("G", _STOPS_G) | lines.are("M", _STOPS_M))
    passed = np.searchsorted(walls, line)
    program = Program(
        np.insert(motion.points, place + 1, motion.points[place], axis=0),
        np.insert(motion.extrusion, place, length), np.insert(motion.feed, place, feed),
        track.at(line), limits, np.diff(passed, prepend=0) > 0,
    )  # fmt: skip
    return program, line + 1


def dwell_seconds(lines: Lines, line: int) -> float:
    """Return the seconds of a G4: P in milliseconds or S in seconds."""
    given = parameters(lines.raw(line).decode("latin-1").split(";", 1)[0])
    return max(0.0, given.get("S", given.get("P", 0.0) / 1000.0))


def _change_seconds(lines: Lines, motion: Motion) -> float:
    """Return the seconds of loading and unloading filament, as the settings say.

    The first change finds nothing to unload, as PrusaSlicer counts.
    """
    if not setting(lines.text, b"single_extruder_multi_material"):
        return 0.0  # a tool that keeps its filament loads nothing
    load = setting(lines.text, b"filament_load_time")
    unload = setting(lines.text, b"filament_unload_time")
    used = motion.tool(motion.extrusion > 0)
    changes = int(np.count_nonzero(np.diff(used)))
    return changes * load + max(0, changes - 1) * unload
