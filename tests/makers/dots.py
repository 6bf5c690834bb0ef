"""A small print made by code with dots and vertical beads, beside lines that some stand on.

A dot is filament pushed on the spot; one of them is pushed in one line with what pays back the
retraction. A vertical bead is pushed while the nozzle climbs.
"""

from __future__ import annotations

from collections.abc import Sequence

LINES, FEET = (60, 85, 110), (160, 185)  # y, mm
DOTS, PILLARS = 3, 2  # at each x
_START = "G28\nG90\nM83\nG1 E-0.8 F2100\n"
_PAID, _PULLED = "G1 E0.8 F2100\n", "G1 E-0.8 F2100\n"


def made_dots_gcode(xs: Sequence[int]) -> str:
    """Return the G-code of lines, dots above their level, and pillars on lines, at each x, mm."""
    lines = [
        f"{_at(x, y, 0.3)}{_PAID}G1 X{x + 15} E0.6 F1200\n{_PULLED}"
        for x in xs
        for y in LINES + FEET
    ]
    dots = [f"{_at(x + 5, y + 10, 0.6)}{_PAID}G1 E1.5 F100\n{_PULLED}" for y in LINES for x in xs]
    dots[1] = dots[1].replace(f"{_PAID}G1 E1.5", "G1 E2.3")  # as one push
    pillars = [f"{_at(x + 7, y, 0.3)}{_PAID}G1 Z2.3 E0.4 F200\n{_PULLED}" for x in xs for y in FEET]
    return _START + "".join([*lines, *dots, *pillars]) + "M84\n"


def _at(x: int, y: int, z: float) -> str:
    return f"G0 Z3 F600\nG0 X{x} Y{y} F8000\nG0 Z{z} F600\n"
