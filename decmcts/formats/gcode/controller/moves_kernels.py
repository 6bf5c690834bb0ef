"""The modal interpreter of G-code motion, on plain arrays.

Walks the scanned lines once and keeps what a controller keeps: position, feed,
absolute or relative axes, extruder value, retraction.

Arcs are opened into chords whose ends do not depend on how an arc is run or parted. The vertices of
a circle stand at whole multiples of one angle, counted from the x axis, so an arc has the same
vertices in both directions, and each part of an arc that is cut at a vertex has those of the whole.
To make that true to the last bit, an arc is always calculated counter-clockwise from a centre on
`CENTRE_GRID`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.formats.gcode.text.scan_kernels import OFFSET_I, OFFSET_J, D, E, F, P, R, S, X, Z

CENTRE_GRID = 1e6  # per mm
NEAR = 0.05  # of a step: a vertex nearer than this to an end of the arc is left out
NEAR_MM = 2e-3  # so is one that a file of three decimals hardly tells from the end
ON_VERTEX_MM = 1.5e-3  # an end this near to a vertex stands at its angle
LEAST_CHORDS = 8  # of a whole circle
PARTED_MM = 3e-3  # by so much may the radius of a part differ from that of the whole
CX, CY, BEGIN, END, R_BEGIN, R_END, STEPS = range(7)  # columns of `circles`
N_CIRCLE = 7


@kernel
def arc_center(x0: float, y0: float, x1: float, y1: float, values: Floats, clockwise: bool) -> Any:
    """Return the centre of an arc in I/J or R form; NaN when there is none."""
    if math.isnan(values[R]):
        i = 0.0 if math.isnan(values[OFFSET_I]) else values[OFFSET_I]
        j = 0.0 if math.isnan(values[OFFSET_J]) else values[OFFSET_J]
        return x0 + i, y0 + j
    dx, dy = x1 - x0, y1 - y0
    chord = math.hypot(dx, dy)
    radius = abs(values[R])
    if chord == 0.0 or chord > 2.0 * radius * (1.0 + 1e-3):
        return math.nan, math.nan
    height = math.sqrt(max(0.0, radius * radius - chord * chord / 4.0))
    side = -1.0 if clockwise else 1.0
    if values[R] < 0.0:
        side = -side
    return (x0 + x1) / 2.0 - side * dy / chord * height, (
        y0 + y1
    ) / 2.0 + side * dx / chord * height


@kernel
def circle_chords(radius: float, tolerance: float) -> int:
    """Return how many chords of a whole circle keep within `tolerance` of it.

    The longest chord of an arc is a step and twice `NEAR` long.
    """
    if radius <= tolerance:
        return LEAST_CHORDS
    widest = 2.0 * math.acos(1.0 - tolerance / radius)
    quarter = math.ceil(math.pi / 2.0 * (1.0 + 2.0 * NEAR) / widest)
    return max(LEAST_CHORDS, 4 * min(quarter, 1000000))


@kernel
def inner_vertices(circle: Floats) -> tuple[int, int]:
    """Return the numbers of the first and the last vertex within an arc; first > last for none."""
    step = 2.0 * math.pi / circle[STEPS]
    if circle[END] - circle[BEGIN] <= step:
        return 1, 0
    radius = (circle[R_BEGIN] + circle[R_END]) / 2.0
    near = max(NEAR * step, NEAR_MM / max(radius, NEAR_MM))
    return math.ceil((circle[BEGIN] + near) / step), math.floor((circle[END] - near) / step)


@kernel
def plan_arcs(
    before: Floats,
    end: Floats,
    line: Ints,
    code: Int32s,
    values: Floats,
    tolerance: float,
    circles: Floats,
) -> Ints:
    """Return the chords of each move, 0 where no circle fits; write its circle in place.

    A row of `circles` is of the arc run counter-clockwise: centre, angles and radii where it
    begins and ends, and the chords of the whole circle (0: a straight move).
    """
    count = np.ones(len(line), np.int64)
    for m in range(len(line)):
        if code[line[m]] != 20 and code[line[m]] != 30:
            continue
        clockwise = code[line[m]] == 20
        x0, y0, x1, y1 = before[m, 0], before[m, 1], end[m, 0], end[m, 1]
        cx, cy = arc_center(x0, y0, x1, y1, values[line[m]], clockwise)
        if math.isnan(cx):
            count[m] = 0
            continue
        if clockwise:
            x0, y0, x1, y1 = x1, y1, x0, y0
        cx, cy = round(cx * CENTRE_GRID) / CENTRE_GRID, round(cy * CENTRE_GRID) / CENTRE_GRID
        row = circles[m]
        row[CX], row[CY] = cx, cy
        row[BEGIN], row[END] = math.atan2(y0 - cy, x0 - cx), math.atan2(y1 - cy, x1 - cx)
        if x0 == x1 and y0 == y1:
            row[END] = row[BEGIN] + 2.0 * math.pi
        elif row[END] <= row[BEGIN]:
            row[END] += 2.0 * math.pi
        row[R_BEGIN], row[R_END] = math.hypot(x0 - cx, y0 - cy), math.hypot(x1 - cx, y1 - cy)
        row[STEPS] = circle_chords((row[R_BEGIN] + row[R_END]) / 2.0, tolerance)
        first, last = inner_vertices(row)
        count[m] = max(0, last - first + 1) + 1
    return count


@kernel
def can_be_parted(circles: Floats, tolerance: float) -> Flags:
    """Tell which arcs have the same vertices in each part that is cut at one, (n,).

    The ends of a part are rounded, so its radius is a little more or less: it must not be one at
    which the number of chords changes.
    """
    able = np.zeros(len(circles), np.bool_)
    for m in range(len(circles)):
        r0, r1 = circles[m, R_BEGIN], circles[m, R_END]
        radius, slack = (r0 + r1) / 2.0, PARTED_MM + abs(r1 - r0) / 2.0
        low = circle_chords(max(radius - slack, 0.0), tolerance)
        able[m] = low == circle_chords(radius + slack, tolerance)
    return able


@kernel
def _on_vertex(angle: float, radius: float, step: float) -> float:
    """Return the angle of the vertex that an end of an arc stands on, else the end's own."""
    vertex = round(angle / step) * step
    return vertex if abs(angle - vertex) * radius <= ON_VERTEX_MM else angle


@kernel
def open_arcs(
    before: Floats,
    end: Floats,
    pushed: Floats,
    clockwise: Flags,
    circles: Floats,
    count: Ints,
    grid: float,
    points: Floats,
    extrusion: Floats,
) -> None:
    """Fill the end and the filament of every chord, in place.

    Chord ends lie on the file's own decimals (`grid` per mm), so that an arc that is parted at
    one can be written; filament is shared by length.
    """
    k = 0
    for m in range(len(count)):
        if circles[m, STEPS] == 0.0:
            points[k], extrusion[k] = end[m], pushed[m]
        else:
            _open_arc(
                before[m], end[m], pushed[m], clockwise[m], circles[m], grid,
                points[k : k + count[m]], extrusion[k : k + count[m]],
            )  # fmt: skip
        k += count[m]


@kernel
def _open_arc(
    before: Floats,
    end: Floats,
    pushed: float,
    clockwise: bool,
    circle: Floats,
    grid: float,
    points: Floats,
    extrusion: Floats,
) -> None:
    """Fill the end and the filament of the chords of one arc, in place."""
    n, step = len(points), 2.0 * math.pi / circle[STEPS]
    first, _ = inner_vertices(circle)
    whole = circle[END] - circle[BEGIN]
    z0, z1 = (end[2], before[2]) if clockwise else (before[2], end[2])
    begin = _on_vertex(circle[BEGIN], circle[R_BEGIN], step)
    last = _on_vertex(circle[END], circle[R_END], step)
    extrusion[0] = pushed
    for s in range(n if n > 1 else 0):
        low = begin if s == 0 else (first + s - 1) * step
        high = last if s == n - 1 else (first + s) * step
        extrusion[n - 1 - s if clockwise else s] = pushed * (high - low) / (last - begin)
    for s in range(n - 1):
        t = ((first + s) * step - circle[BEGIN]) / whole
        radius = circle[R_BEGIN] + t * (circle[R_END] - circle[R_BEGIN])
        vertex = (first + s) % int(circle[STEPS])
        at = n - 2 - s if clockwise else s
        points[at, 0] = round((circle[CX] + radius * math.cos(vertex * step)) * grid) / grid
        points[at, 1] = round((circle[CY] + radius * math.sin(vertex * step)) * grid) / grid
        points[at, 2] = round((z0 + t * (z1 - z0)) * grid) / grid
    points[n - 1] = end


# Columns of `modes`, the state after each line.
RELATIVE_XYZ, RELATIVE_E, TOOL, FIRMWARE_RETRACTED, MODE_SET = range(5)
N_MODES = 5
MAX_TOOLS = 16
LAST_TOOL = 254  # T255, T1000 and T1100 choose no tool of Bambu's printers, nor of any other


@kernel
def _is_retraction(values: Floats) -> bool:
    """Tell whether a G10 or G11 retracts: with words it heats a tool, or sets an offset."""
    for column in (S, R, P):
        if not math.isnan(values[column]):
            return False
    for axis in range(X, Z + 1):
        if not math.isnan(values[axis]):
            return False
    return True


@kernel
def _modal(letter: int, code: int, values: Floats, modes: NDArray[np.int16]) -> float:
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
def _place(code: int, values: Floats, position: Floats) -> bool:
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
def _step(values: Floats, modes: NDArray[np.int16], position: Floats, area: float) -> float:
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
    code: Int32s,
    values: Floats,
    modes: NDArray[np.int16],
    extruder: Floats,
    moves: Floats,
    line: Ints,
    placed: Flags,
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
