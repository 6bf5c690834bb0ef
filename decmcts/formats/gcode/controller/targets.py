"""Temperatures as far as a file's own commands tell them, and which are said once more.

Slicers that print parts one by one say bed and hot end anew before each part. The target that is
in force already changes nothing, and needs no barrier. What is not known is not taken for known.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

SETS = re.compile(r"M(104|140)\s++S\s*+(\d++(?:\.\d*+)?|\.\d++)(?:\s++T\s*+(\d++))?", re.I)
WAITS = re.compile(r"M1(09|90)\s++[SR]\s*+(\d++(?:\.\d*+)?|\.\d++)(?:\s++T\s*+(\d++))?", re.I)
_HEATERS = {"104": "hot end", "09": "hot end", "140": "bed", "90": "bed"}
# Printers that probe with the nozzle cool it for that.
COOL_NOZZLE = ("homing", "bed probing")
# Barriers behind which each heater is as warm as before.
KEEP_HEAT = ("dwell", "coordinates set anew", "wait for moves to end", "coordinate mode")


def target_of(code: str) -> str:
    """Return the target that a command sets, whether it waits or not; of others the command."""
    told = SETS.fullmatch(code) or WAITS.fullmatch(code)
    return code if told is None else f"{float(told[2]):g} degrees"


@dataclass(slots=True)
class Targets:
    """The targets in force while the lines of a file go by; mutates only itself."""

    known: dict[tuple[str, str], float] = field(default_factory=dict)  # heater and tool -> °C

    def again(self, code: str, reason: str) -> bool:
        """Take a barrier, and tell whether it only sets a target that is in force.

        One that waits is never said in vain: the heater may not be there yet.
        """
        told = SETS.fullmatch(code) or WAITS.fullmatch(code)
        if told is None:
            if reason in COOL_NOZZLE:
                self.known = {k: v for k, v in self.known.items() if k[0] != "hot end"}
            elif reason not in KEEP_HEAT:
                self.known.clear()
            return False
        heater, target, tool = _HEATERS[told[1]], float(told[2]), told[3] or ""
        if self.known.get((heater, tool)) == target and told.re is SETS:
            return True
        for other in [key for key in self.known if key[0] == heater and "" in (key[1], tool)]:
            del self.known[other]  # one of them names no tool: it may be the same heater
        self.known[heater, tool] = target
        return False
