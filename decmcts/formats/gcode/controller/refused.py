"""Commands that make a file mean something a plan for X, Y, Z and E cannot: each is refused.

A command that changes the frame of positions and is taken back before anything moves does no
harm and stays as text, as in many start codes.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from decmcts.formats.gcode.text import scan_kernels as scan
from decmcts.formats.gcode.text.lines import Lines, further_axis

_FRAMES = {  # G command times ten: what it means, and the one that takes it back
    200: ("inches (G20)", 210), 680: ("a rotated frame (G68)", 690),
    160: ("polar coordinates (G16)", 150), 510: ("a scaled frame (G51)", 500),
    180: ("arcs in the XZ plane (G18)", 170), 190: ("arcs in the YZ plane (G19)", 170),
    901: ("arcs with centres counted from the origin (G90.1)", 911),
}  # fmt: skip
_PLANES = (180, 190)
_ALL_PLANES = (170, 180, 190)
_OF_ARCS = (*_PLANES, 901)
_TURNS = re.compile(rb"P\s*0*[1-9]", re.I)
_CURVES = (50, 51, 52)
_SYSTEM = re.compile(rb"P\s*0*(\d+|[^\s\d])", re.I)


def refuse_meanings(lines: Lines) -> None:
    """Refuse files for other frames, further axes, or several motion systems.

    Raises
    ------
    InputError
        With the line and what to do.
    """
    _refuse_systems(lines)
    _refuse_frames(lines)
    _refuse_curves(lines)
    _refuse_turns(lines)
    _refuse_fourth_axis(lines)


def _is_g(lines: Lines, codes: tuple[int, ...]) -> NDArray[np.bool_]:
    return np.asarray((lines.letter == 71) & np.isin(lines.code, codes))


def _refuse_systems(lines: Lines) -> None:
    """Refuse RepRapFirmware's files for several motion systems: one head is planned by one file."""
    several = (lines.letter == 77) & np.isin(lines.code, (5980, 6060))
    for line in np.flatnonzero((lines.letter == 77) & (lines.code == 5960)).tolist():
        system = _SYSTEM.search(lines.raw(line).split(b";")[0])
        several[line] = system is not None and system[1] != b"0"
    if several.any():
        raise lines.refuse(
            int(np.flatnonzero(several)[0]),
            "a file for several motion systems (M596, M598, M606), each with positions of its own",
            "slice for one head; `decmcts launch` makes the files of several heads of it",
        )


def _refuse_frames(lines: Lines) -> None:
    moves = np.flatnonzero(_is_g(lines, (0, 10, 20, 30, 920)))
    arcs = np.flatnonzero(_is_g(lines, (20, 30)))
    for code, (what, back) in _FRAMES.items():
        ends = np.flatnonzero(_is_g(lines, _ALL_PLANES if code in _PLANES else (back,)))
        bent = arcs if code in _OF_ARCS else moves
        for line in np.flatnonzero(_is_g(lines, (code,))).tolist():
            until = _first_behind(ends, line, len(lines))
            if _first_behind(bent, line, len(lines)) < until:
                raise lines.refuse(line, f"{what} cannot be planned", "export in mm, absolute")


def _first_behind(rows: NDArray[np.int64], line: int, end: int) -> int:
    at = int(np.searchsorted(rows, line, side="right"))
    return int(rows[at]) if at < len(rows) else end


def _refuse_curves(lines: Lines) -> None:
    """Refuse Bézier moves; a bare G5 has no end to go to and moves nothing."""
    for line in np.flatnonzero(_is_g(lines, _CURVES)).tolist():
        words = lines.raw(line).split(b";")[0].split(b"(")[0].upper().partition(b"G")[2]
        if re.search(rb"[A-Z]", words):
            raise lines.refuse(line, "Bézier moves (G5) cannot be planned", "export without them")


def _refuse_turns(lines: Lines) -> None:
    """Refuse arcs that print more than one turn; Klipper makes one of them, Marlin all."""
    prints = _is_g(lines, (20, 30)) & ~np.isnan(lines.values[:, scan.E])
    for line in np.flatnonzero(prints).tolist():
        if _TURNS.search(lines.raw(line).split(b";")[0].split(b"(")[0]):
            raise lines.refuse(
                line, "an arc of several turns (P), which firmwares read differently",
                "export each turn as an arc of its own",
            )  # fmt: skip


def _refuse_fourth_axis(lines: Lines) -> None:
    moved = (lines.letter == 71) & (lines.code <= 30) & ~np.isnan(lines.values[:, scan.D])
    if moved.any():
        line = int(np.flatnonzero(moved)[0])
        raise lines.refuse(line, *further_axis(lines.raw(line)))
