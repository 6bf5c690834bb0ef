"""The modal interpreter of G-code motion, on plain arrays.

Walks the scanned lines once and keeps what a controller keeps: position, feed,
absolute or relative axes, extruder value, retraction.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import kernel
from decmcts.formats.gcode.text.scan_kernels import D, E, F, P, R, S, X, Z

# Columns of `modes`, the state after each line.
RELATIVE_XYZ, RELATIVE_E, TOOL, FIRMWARE_RETRACTED, MODE_SET = range(5)
N_MODES = 5
MAX_TOOLS = 16
LAST_TOOL = 254  # T255, T1000 and T1100 choose no tool of Bambu's printers, nor of any other


@kernel
def _is_retraction(values: NDArray[np.float64]) -> bool:
    """Tell whether a G10 or G11 retracts: with words it heats a tool, or sets an offset."""
    for column in (S, R, P):
        if not math.isnan(values[column]):
            return False
    for axis in range(X, Z + 1):
        if not math.isnan(values[axis]):
            return False
    return True


@kernel
def _modal(letter: int, code: int, values: NDArray[np.float64], modes: NDArray[np.int16]) -> float:
    """Apply a command that is no move to `modes` in place; return a new E area or -1."""
    if letter == 71:
        if code == 900 or code == 910:
            modes[RELATIVE_XYZ] = 1 if code == 910 else 0
        elif (code == 100 or code == 110) and _is_retraction(values):
            modes[FIRMWARE_RETRACTED] = 1 if code == 100 else 0
    elif letter == 77:
        if code == 820 or code == 830:
            modes[RELATIVE_E] = 1 if code == 830 else 0
            modes[MODE_SET] = 1
        elif code == 2000 and not math.isnan(values[D]):
            return float(math.pi * values[D] * values[D] / 4.0)
    elif letter == 84 and code // 10 <= LAST_TOOL:
        modes[TOOL] = code // 10
    return -1.0


@kernel
def _place(code: int, values: NDArray[np.float64], position: NDArray[np.float64]) -> bool:
    """Apply G92 or G28 to `position` (x, y, z, e) in place; tell whether an axis moved."""
    any_axis, moved = False, False
    for axis in range(4):
        if not math.isnan(values[axis]):
            any_axis = True
            position[axis] = values[axis] if code == 920 else 0.0
            moved = moved or axis < 3
    if not any_axis:
        position[0:3] = 0.0
        if code == 920:
            position[3] = 0.0
        moved = True
    return moved


@kernel
def _step(
    values: NDArray[np.float64],
    modes: NDArray[np.int16],
    position: NDArray[np.float64],
    area: float,
) -> float:
    """Move `position` in place; return the filament pushed, mm."""
    for axis in range(3):
        if not math.isnan(values[axis]):
            if modes[RELATIVE_XYZ]:
                position[axis] += values[axis]
            else:
                position[axis] = values[axis]
    if math.isnan(values[E]):
        return 0.0
    if modes[RELATIVE_E] or modes[RELATIVE_XYZ]:
        pushed = values[E]
        position[3] += pushed
    else:
        pushed = values[E] - position[3]
        position[3] = values[E]
    return float(pushed / area if area > 0.0 else pushed)


@kernel
def interpret(
    letter: NDArray[np.uint8],
    code: NDArray[np.int32],
    values: NDArray[np.float64],
    modes: NDArray[np.int16],
    extruder: NDArray[np.float64],
    moves: NDArray[np.float64],
    line: NDArray[np.int64],
    placed: NDArray[np.bool_],
    relative_e: bool,
) -> None:
    """Fill the moves and the state after each line, all in place.

    `modes` is (lines, N_MODES), `extruder` (lines, 3): E value, retraction owed
    by the tool in use, cross-section of volumetric E (0: E is in mm). Row m of
    `moves` is end x, y, z, filament, feed; `line[m]` its line.
    """
    position, debt = np.zeros(4), np.zeros(MAX_TOOLS)
    state = np.zeros(N_MODES, np.int16)
    state[RELATIVE_E] = relative_e
    rate, area, m = 0.0, 0.0, 0
    for n in range(len(letter)):
        owner = state[TOOL] % MAX_TOOLS
        if letter[n] == 71 and code[n] <= 30:
            rate = rate if math.isnan(values[n, F]) else values[n, F] / 60.0
            pushed = _step(values[n], state, position, area)
            debt[owner] = max(0.0, debt[owner] - pushed)
            moves[m, 3], moves[m, 4] = pushed, rate
        elif letter[n] == 71 and (code[n] == 920 or code[n] == 280):
            placed[n] = _place(code[n], values[n], position)  # if an axis: a move without feed
        elif letter[n] != 0:
            new_area = _modal(letter[n], code[n], values[n], state)
            area = new_area if new_area >= 0.0 else area
        if placed[n] or (letter[n] == 71 and code[n] <= 30):
            moves[m, :3], line[m] = position[:3], n
            m += 1
        modes[n] = state
        extruder[n, 0], extruder[n, 1] = position[3], debt[state[TOOL] % MAX_TOOLS]
        extruder[n, 2] = area
