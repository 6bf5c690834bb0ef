"""G-code that takes a head to its park where a print was broken off: moves, and nothing else.

In the coordinates of the head's file of that print, which its controller still counts in. No
start code, no homing, no heating, no filament.
"""

from __future__ import annotations

from collections.abc import Sequence

from decmcts.print.job import DEFAULT_TRAVEL, ProcessSettings

Z_FEED = 10.0  # mm/s, where the source names none

AxisWords = tuple[float | None, float | None, float | None]  # where a move ends; None: as it was


def park_gcode(
    comments: Sequence[str], moves: Sequence[AxisWords], settings: ProcessSettings, newline: bytes
) -> bytes:
    """Return the text of a file with these comments and moves; settings have the feeds."""
    z_feed, feed = settings.z_feed or Z_FEED, settings.travel_feed or DEFAULT_TRAVEL
    lines = [*(f"; {comment}" for comment in comments), "G21 ; mm", "G90 ; absolute"]
    for words in moves:
        named = [f"{axis}{at:.3f}" for axis, at in zip("XYZ", words, strict=True) if at is not None]
        lines.append(f"G1 {' '.join(named)} F{(z_feed if words[2] is not None else feed) * 60:.0f}")
    lines.append("M400")
    return b"".join(line.encode("utf-8", "surrogateescape") + newline for line in lines)
