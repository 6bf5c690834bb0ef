"""How long commands wait for a temperature.

Heaters are taken to warm evenly, and to cool evenly too: as 40 W hot ends and mains or 24 V beds of
common printers do on the way to printing temperatures. What start code waits for is stated apart
from the makespan, since no file states it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from sim.heads.heat import degrees_of

AMBIENT_C = 25.0
HOT_END_C_S, BED_C_S = 3.0, 0.5  # degrees a second
COOL_C_S = 1.0  # of a hot end near 200 °C in still air
_HEAT = re.compile(rb"M(104|109|140|190)(?![\d.])(.*)", re.I)
_TOOL = re.compile(rb"T ?(\d+)", re.I)


@dataclass(slots=True)
class Heaters:
    """What one file's heaters were told, and how warm they are when nobody waits longer."""

    warm: dict[bytes, float] = field(default_factory=dict)  # degrees each has reached
    due: dict[bytes, float] = field(default_factory=dict)  # and was told to reach

    def take(self, code: bytes) -> float:
        """Take a command; return the seconds it waits, 0 where it does not."""
        match = _HEAT.match(code)
        if match is None:
            return 0.0
        number, words = match[1], match[2]
        tool = _TOOL.search(words)
        bed = number in (b"140", b"190")
        heater = b"bed" if bed else b"hot end" + (tool[1] if tool else b"")
        degrees = degrees_of(words)
        target = self.due.get(heater, AMBIENT_C) if degrees is None else degrees
        self.due[heater] = target
        if number in (b"104", b"140"):
            return 0.0
        seconds = max(0.0, target - self.warm.get(heater, AMBIENT_C)) / (
            BED_C_S if bed else HOT_END_C_S
        )
        self._pass(seconds)
        return seconds

    def _pass(self, seconds: float) -> None:
        """Let all heaters warm for so long."""
        for heater, target in self.due.items():
            gain = seconds * (BED_C_S if heater == b"bed" else HOT_END_C_S)
            warm = self.warm.get(heater, AMBIENT_C)
            self.warm[heater] = min(target, warm + gain) if target > warm else target
