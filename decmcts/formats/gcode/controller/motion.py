"""All moves of a file as arrays: what the controller would do, in order.

Arcs are opened into chords whose distance from the arc is at most
`CHORD_ERROR_MM`; E is shared by length. Which chords are of which arc is kept.

Commands that make a file mean something a plan for X, Y, Z and E cannot are refused. One that
changes the frame of positions and is taken back before anything moves does no harm and stays as
text, as in many start codes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.formats.files.bounds import LARGEST_FILAMENT_MM, LARGEST_MM
from decmcts.formats.gcode.controller import moves_kernels as kernels
from decmcts.formats.gcode.dialects.dialect import UNKNOWN, classify, without_brackets
from decmcts.formats.gcode.document import NO_ARC, Arcs
from decmcts.formats.gcode.text import scan_kernels as scan
from decmcts.formats.gcode.text.lines import Lines, further_axis

CHORD_ERROR_MM = 0.005
MOST_DECIMALS = 6
_FRAMES = {  # G command times ten: what it means, and the one that takes it back
    200: ("inches (G20)", 210), 680: ("a rotated frame (G68)", 690),
    160: ("polar coordinates (G16)", 150), 510: ("a scaled frame (G51)", 500),
    180: ("arcs in the XZ plane (G18)", 170), 190: ("arcs in the YZ plane (G19)", 170),
    901: ("arcs with centres counted from the origin (G90.1)", 911),
}  # fmt: skip
_PLANES = (180, 190)
_ALL_PLANES = (170, 180, 190)
_OF_ARCS = (*_PLANES, 901)
_ARCS = (20, 30)
_CURVES = (50, 51, 52)
_COMMANDS = tuple(b"GMT")  # letters of commands that are no macros
# behind a line's number and a first command, and in no text
_SECOND = re.compile(r"\s*+(?:N ?\d++)?+\s*+[^\"]+(?<![A-Z_])G ?\d", re.I)
_SYSTEM = re.compile(rb"P\s*0*(\d+|[^\s\d])", re.I)


@dataclass(frozen=True, slots=True)
class Motion:
    """Moves and the controller's state after each line."""

    points: Floats  # (m + 1, 3)
    extrusion: Floats  # (m,) filament, mm
    feed: Floats  # (m,) mm/s
    line: Ints  # (m,) index of the source line, from 0
    before: Ints  # (n_lines + 1,) moves above each line
    modes: NDArray[np.int16]  # (n_lines, N_MODES) after each line
    extruder: Floats  # (n_lines, 3) E value, retraction owed, E cross-section
    placed: Flags  # (n_lines,) G92 or G28 set an axis here
    decimals: tuple[int, int, int]  # xy, e and feed as the source writes them
    arc: Int32s  # (m,) number in `arcs` of the arc a move is a chord of, or NO_ARC
    arcs: Arcs

    def tool(self, moves: Any = slice(None)) -> Ints:
        """Return the tool in use at each move, or at some of them."""
        return np.asarray(self.modes[self.line[moves], kernels.TOOL], np.int64)

    @property
    def withdrawn(self) -> Flags:
        """Whether the firmware has retracted before each move, (m,)."""
        above = np.maximum(self.line - 1, 0)
        return np.asarray(self.modes[above, kernels.FIRMWARE_RETRACTED] > 0)


def interpret(lines: Lines) -> Motion:
    """Return what the lines do.

    Raises InputError on inches, an arc without a centre, a polar or rotated frame, a fourth axis,
    or several motion systems.
    """
    _refuse_second_commands(lines)
    _refuse_systems(lines)
    _refuse_frames(lines)
    _refuse_curves(lines)
    _refuse_further_moves(lines)
    n = len(lines)
    moves, line = np.zeros((n, 5)), np.full(n, n, np.int64)
    modes, extruder = np.zeros((n, kernels.N_MODES), np.int16), np.zeros((n, 3))
    placed = np.zeros(n, np.bool_)
    kernels.interpret(
        lines.letter, lines.code, lines.values, modes, extruder, moves, line, placed,
        _counts_relative(lines),
    )  # fmt: skip
    m = int(np.searchsorted(line, n))
    moves, line = moves[:m], line[:m]
    before = np.searchsorted(line, np.arange(n + 1)).astype(np.int64)
    points = np.concatenate([np.zeros((1, 3)), moves[:, :3]])
    pushed, feed = np.ascontiguousarray(moves[:, 3]), np.ascontiguousarray(moves[:, 4])
    motion = Motion(
        points, pushed, feed, line, before, modes, extruder, placed, _decimals(lines),
        np.full(m, NO_ARC, np.int32), Arcs.none(),
    )  # fmt: skip
    _refuse_far(lines, motion)
    curved = np.isin(lines.code[line], _ARCS)
    return _open_arcs(lines, motion, np.flatnonzero(curved)) if curved.any() else motion


def _counts_relative(lines: Lines) -> bool:
    """Guess how E counts where no M82 or M83 says: absolute E does not fall while moving."""
    if lines.are("M", (820, 830)).any():
        return False
    drawn = lines.moves & ~np.isnan(lines.values[:, scan.E])
    drawn &= ~np.isnan(lines.values[:, : scan.E]).all(axis=1)
    e = lines.values[drawn, scan.E]
    return bool(len(e) > 1 and (np.diff(e) < 0).mean() > 0.1)


def _decimals(lines: Lines) -> tuple[int, int, int]:
    xy = max(int(lines.decimals[: scan.E].max()), 3)
    e = int(np.clip(lines.decimals[scan.E], 5, 8))
    return min(xy, MOST_DECIMALS), e, min(int(lines.decimals[scan.F]), MOST_DECIMALS)


def _refuse_far(lines: Lines, motion: Motion) -> None:
    far = (np.abs(motion.points[1:]) > LARGEST_MM).any(axis=1)
    much = np.abs(motion.extrusion) > LARGEST_FILAMENT_MM
    for wrong, what in (
        (far, f"relative moves that leave ±{LARGEST_MM:g} mm"),
        (much, f"more than {LARGEST_FILAMENT_MM:g} mm of filament in one move"),
    ):
        if wrong.any():
            raise lines.refuse(int(motion.line[np.argmax(wrong)]), what)


def _open_arcs(lines: Lines, motion: Motion, curved: Ints) -> Motion:
    """Return the motion with chords in the place of the moves `curved`."""
    starts, ends = motion.points[:-1], motion.points[1:]
    circles = np.zeros((len(ends), kernels.N_CIRCLE))
    count = kernels.plan_arcs(
        starts, ends, motion.line, lines.code, lines.values, CHORD_ERROR_MM, circles
    )
    if len(wrong := np.flatnonzero(count == 0)):
        raise lines.refuse(int(motion.line[wrong[0]]), "an arc that no circle fits")
    points, extrusion = np.zeros((int(count.sum()), 3)), np.zeros(int(count.sum()))
    clockwise = lines.code[motion.line] == 20
    kernels.open_arcs(
        starts, ends, motion.extrusion, clockwise, circles, count, 10.0 ** motion.decimals[0],
        points, extrusion,
    )  # fmt: skip
    number = np.full(len(ends), NO_ARC, np.int32)
    number[curved] = np.arange(len(curved))
    source = np.repeat(np.arange(len(count)), count)
    return replace(
        motion,
        points=np.concatenate([np.zeros((1, 3)), points]),
        extrusion=extrusion,
        feed=motion.feed[source],
        line=motion.line[source],
        before=np.concatenate([[0], np.cumsum(count)])[motion.before],
        arc=number[source],
        arcs=_arcs(lines, motion.line[curved], circles[curved]),
    )


def _arcs(lines: Lines, line: Ints, circles: Floats) -> Arcs:
    """Return the table of the arcs on these lines."""
    words = lines.values[line][:, [scan.OFFSET_I, scan.OFFSET_J, scan.R]]
    most = MOST_DECIMALS
    if np.isnan(words[:, 2]).all():  # else centres have as many as there can be
        most = int(lines.decimals[: scan.E].max(initial=3))
        most = max(most, int(lines.decimals[[scan.OFFSET_I, scan.OFFSET_J]].max()))
    return Arcs(
        circles[:, : kernels.BEGIN], lines.code[line] == 20,
        kernels.can_be_parted(circles, CHORD_ERROR_MM), words, min(most, MOST_DECIMALS),
    )  # fmt: skip


def _refuse_second_commands(lines: Lines) -> None:
    """Refuse a G command behind another command: RepRapFirmware carries out both, others one.

    But for lines that may hold any text, and for commands nobody knows.
    """
    raw = np.frombuffer(lines.text, np.uint8) & 0xDF  # capital letters
    at = np.flatnonzero(raw == ord("G"))
    row = np.searchsorted(lines.starts, at, side="right") - 1
    count = np.bincount(row[at < lines.comment[row]], minlength=len(lines.letter))
    behind = (count > (lines.letter == ord("G"))) & np.isin(lines.letter, _COMMANDS)
    for line in np.flatnonzero(behind).tolist():
        code = without_brackets(lines.raw(line).split(b";")[0].decode("latin-1"))
        meaning = classify(lines.raw(line))
        moves = lines.letter[line] == 71 and lines.code[line] <= 30
        known = moves or not (meaning.slot == "message" or meaning.text in UNKNOWN)
        if known and _SECOND.match(code):
            raise lines.refuse(
                line, "two commands in a line, of which some firmwares carry out one only",
                "give each a line of its own",
            )  # fmt: skip


def _refuse_systems(lines: Lines) -> None:
    """Refuse RepRapFirmware's files for several motion systems: one head is planned by one file."""
    several = lines.are("M", (5980, 6060))
    for line in np.flatnonzero(lines.are("M", (5960,))).tolist():
        system = _SYSTEM.search(lines.raw(line).split(b";")[0])
        several[line] = system is not None and system[1] != b"0"
    lines.refuse_first(
        several,
        "a file for several motion systems (M596, M598, M606), each with positions of its own",
        "slice for one head; `decmcts launch` makes the files of several heads of it",
    )


def _refuse_frames(lines: Lines) -> None:
    moves = np.flatnonzero(lines.are("G", (0, 10, *_ARCS, 920)))
    arcs = np.flatnonzero(lines.are("G", _ARCS))
    for code, (what, back) in _FRAMES.items():
        ends = np.flatnonzero(lines.are("G", _ALL_PLANES if code in _PLANES else (back,)))
        bent = arcs if code in _OF_ARCS else moves
        for line in np.flatnonzero(lines.are("G", (code,))).tolist():
            until = _first_behind(ends, line, len(lines))
            if _first_behind(bent, line, len(lines)) < until:
                raise lines.refuse(line, f"{what} cannot be planned", "export in mm, absolute")


def _first_behind(rows: Ints, line: int, end: int) -> int:
    at = int(np.searchsorted(rows, line, side="right"))
    return int(rows[at]) if at < len(rows) else end


def _refuse_curves(lines: Lines) -> None:
    """Refuse Bézier moves; a bare G5 has no end to go to and moves nothing."""
    for line in np.flatnonzero(lines.are("G", _CURVES)).tolist():
        words = lines.raw(line).split(b";")[0].split(b"(")[0].upper().partition(b"G")[2]
        if re.search(rb"[A-Z]", words):
            raise lines.refuse(line, "Bézier moves (G5) cannot be planned", "export without them")


def _refuse_further_moves(lines: Lines) -> None:
    """Refuse arcs that print several turns (Klipper makes one, Marlin all), and further axes."""
    prints = lines.are("G", _ARCS) & ~np.isnan(lines.values[:, scan.E])
    lines.refuse_first(
        prints & (lines.values[:, scan.P] >= 1.0),
        "an arc of several turns (P), which firmwares read differently",
        "export each turn as an arc of its own",
    )
    moved = lines.moves & ~np.isnan(lines.values[:, scan.D])
    if moved.any():
        line = int(np.argmax(moved))
        raise lines.refuse(line, *further_axis(lines.raw(line)))
