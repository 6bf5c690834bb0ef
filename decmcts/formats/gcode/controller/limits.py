"""The motion limits a file states: in its slicer's settings and in its commands.

Settings (`; machine_max_feedrate_x = 200,100` of PrusaSlicer and its relatives)
hold for the whole file; M201, M203, M204, M205, M220, M566 and Klipper's
SET_VELOCITY_LIMIT hold from where they stand. Both win over the machine's own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats
from decmcts.formats.gcode.controller.state import Track
from decmcts.formats.gcode.document import StateTable
from decmcts.formats.slicers.known import every
from decmcts.print.machine import MotionLimits
from decmcts.print.motion import limit_row
from decmcts.print.motion_kernels import (
    ACCELERATION,
    DEVIATION,
    FACTOR,
    FEED,
    JERK,
    N_LIMITS,
    PRINTING,
    RETRACTING,
    TRAVELLING,
)

FASTEST = 2000.0  # mm/s; M203 beyond it counts in mm/min (RepRapFirmware)
_SETTING = re.compile(rb"; ((?:machine_|gcode_flavor)\w*)[ \t]*=[ \t]*([^\r\n]*)")
RETRACT_MM, RETRACT_FEED = 1.0, 40.0  # of firmware retraction nobody states
_ONE = rb"^; %s[ \t]*=[ \t]*([-+\d.,]+)"
_PARAMETER = re.compile(r"(?<![A-Z_])([A-Z_]++)\s*+(?:=\s*+)?([-+]?(?:\d++(?:\.\d++)?|\.\d++))")
_AXES = "XYZE"
_CORNER = math.sqrt(2.0) - 1.0  # square corner velocity to junction deviation (Klipper)


def stated_limits(text: bytes) -> MotionLimits:
    """Return the limits in a file's settings; NaN where it has none or does not mean them."""
    found = {
        m[1].decode(): m[2].decode("latin-1")
        for m in _SETTING.finditer(text)  # at the begin of a line: to ask for that first is slower
        if m.start() == 0 or text[m.start() - 1 : m.start()] == b"\n"
    }
    if found.get("machine_limits_usage", "").strip() == "ignore":
        return MotionLimits.unstated()
    printing = _first(found, "machine_max_acceleration_extruding")
    legacy = found.get("gcode_flavor", "").strip() == "marlin"  # has no travel acceleration
    return MotionLimits(
        travel_feed=math.nan,
        max_feed=_axes(found, *sorted(every("max_feed"))),
        max_acceleration=_axes(found, "machine_max_acceleration_"),
        jerk=_axes(found, "machine_max_jerk_", least=0.0),
        acceleration=printing,
        retract_acceleration=_first(found, "machine_max_acceleration_retracting"),
        travel_acceleration=(
            printing if legacy else _first(found, "machine_max_acceleration_travel")
        ),
        junction_deviation=_first(found, "machine_max_junction_deviation", least=0.0),
    )


def _axes(
    found: Mapping[str, str], *prefixes: str, least: float = 1e-6
) -> tuple[float, float, float, float]:
    prefix = next((p for p in prefixes if f"{p}x" in found), prefixes[0])
    x, y, z, e = (_first(found, f"{prefix}{axis}", least=least) for axis in "xyze")
    return x, y, z, e


def _first(found: Mapping[str, str], name: str, *, least: float = 1e-6) -> float:
    """Return the first of the values of a setting (PrusaSlicer's normal mode), or NaN."""
    try:
        value = float(found.get(name, "").split(",")[0])
    except ValueError:
        return math.nan
    return value if least <= value < math.inf else math.nan


def state_limits(
    states: StateTable,
    limits: MotionLimits,
    stated: MotionLimits | None = None,
    *,
    own: bool = True,
) -> Floats:
    """Return the row of limits in force in each machine state, (n_states, N_LIMITS).

    Parameters
    ----------
    limits : MotionLimits
        In force where no command says otherwise.
    stated : MotionLimits | None
        The source's settings: what commands set is not above their accelerations.
    own : bool
        Whether commands that describe the machine count; M204 and M220 always do.
    """
    first = limit_row(limits)
    ceiling = np.full(len(first), np.inf)
    if stated is not None:
        stated_row = limit_row(stated)
        rates = [PRINTING, RETRACTING, TRAVELLING]
        ceiling[rates] = np.where(np.isnan(stated_row[rates]), np.inf, stated_row[rates])
    slots = [k for k, slot in enumerate(states.slots) if slot in (_APPLY if own else _PROCESS)]
    kinds, back = np.unique(states.rows[:, slots], axis=0, return_inverse=True)
    rows = np.tile(first, (len(kinds), 1))
    for row, values in zip(rows, kinds.tolist(), strict=True):
        for slot, value in zip(slots, values, strict=True):
            if states.values[value]:
                for line in states.values[value].split("\n"):
                    _APPLY[states.slots[slot]](row, parameters(line))
    return np.asarray(np.minimum(rows, ceiling)[back.ravel()])


def travel_kinds(states: StateTable) -> tuple[list[int], dict[tuple[int, ...], int]]:
    """Return the slots that limit travels, and a number for each setting of them that occurs.

    Settings in which the head travels alike have the same number.
    """
    slots = [k for k, slot in enumerate(states.slots) if slot in _APPLY]
    columns = np.delete(np.arange(N_LIMITS), [PRINTING, RETRACTING])
    limits = np.nan_to_num(state_limits(states, MotionLimits.unstated())[:, columns], nan=-1.0)
    kinds = np.unique(limits, axis=0, return_inverse=True)[1].ravel().tolist()
    return slots, dict(zip(map(tuple, states.rows[:, slots].tolist()), kinds, strict=True))


def commanded(states: StateTable, column: int, stated: MotionLimits) -> Floats:
    """Return what commands set one column of the limits to in each state, NaN: nothing, (n,)."""
    return np.asarray(state_limits(states, MotionLimits.unstated(), stated)[:, column])


def parameters(text: str) -> dict[str, float]:
    """Return the parameters of a command, e.g. {'P': 800.0}."""
    words = text.split(maxsplit=1)
    found = _PARAMETER.findall(words[1].upper()) if len(words) > 1 else []
    return {key: float(value) for key, value in found}


@dataclass(frozen=True, slots=True)
class FirmwareRetraction:
    """What a G10 and a G11 move: M207 and M208 where they stand, else the file's settings."""

    track: Track
    length_mm: float  # the settings', 0: unsaid
    feed: float  # mm/s back
    unretract_feed: float  # mm/s forth

    @staticmethod
    def of(text: bytes, track: Track) -> FirmwareRetraction:
        """Read the settings, once a file: looking for one goes through the whole text."""
        names = (b"retract_length", b"retract_speed", b"deretract_speed")
        return FirmwareRetraction(track, *(setting(text, name) for name in names))

    def at(self, line: int, *, pull: bool) -> tuple[float, float]:
        """Return filament moved (mm) and feed (mm/s) of the G10 or G11 of a line."""
        state = int(self.track.at(line))
        back = parameters(self.track.table.text(state, "retraction"))
        forth = parameters(self.track.table.text(state, "unretraction"))
        length = back.get("S", back.get("RETRACT_LENGTH", self.length_mm))
        feed = back.get("F", 0.0) / 60.0 or back.get("RETRACT_SPEED", 0.0)
        feed = feed or self.feed or RETRACT_FEED
        if not pull:
            again = forth.get("F", 0.0) / 60.0 or back.get("UNRETRACT_SPEED", 0.0)
            feed = again or self.unretract_feed or feed
        return (-1.0 if pull else 1.0) * (length or RETRACT_MM), feed


def setting(text: bytes, name: bytes) -> float:
    """Return the first value of a slicer's setting, 0 for none."""
    match = re.search(_ONE % name, text, re.M)
    try:
        return float(match[1].split(b",")[0]) if match else 0.0
    except ValueError:
        return 0.0


def _set(row: Floats, column: int, value: float, least: float = 1e-6) -> None:
    """Write a limit in place unless it makes no sense."""
    if value >= least:
        row[column] = value


def _set_axes(
    row: Floats, first: int, given: Mapping[str, float], *, least: float = 1e-6,
    divisor: float = 1.0,
) -> None:  # fmt: skip
    """Write the limits of x, y, z and e in place, from column `first` on."""
    for axis, letter in enumerate(_AXES):
        _set(row, first + axis, given.get(letter, -1.0) / divisor, least)


def _axis_feed(row: Floats, given: Mapping[str, float]) -> None:
    minutes = max(given.get("X", 0.0), given.get("Y", 0.0)) > FASTEST
    _set_axes(row, FEED, given, divisor=60.0 if minutes else 1.0)


def _axis_acceleration(row: Floats, given: Mapping[str, float]) -> None:
    _set_axes(row, ACCELERATION, given)


def _acceleration(row: Floats, given: Mapping[str, float]) -> None:
    """M204: P printing, R retracting, T travel; S is P and T at once, and then T retracting."""
    legacy = "S" in given
    _set(row, PRINTING, given.get("P", given.get("S", -1.0)))
    _set(row, TRAVELLING, given["S"] if legacy else given.get("T", -1.0))
    _set(row, RETRACTING, given.get("T", -1.0) if legacy else given.get("R", -1.0))


def _jerk(row: Floats, given: Mapping[str, float]) -> None:
    _set_axes(row, JERK, {"Y": given.get("X", -1.0), **given}, least=0.0)
    _set(row, DEVIATION, given.get("J", -1.0), 0.0)


def _jerk_per_minute(row: Floats, given: Mapping[str, float]) -> None:
    _jerk(row, {axis: given[axis] / 60.0 for axis in _AXES if axis in given})


def _velocity_limit(row: Floats, given: Mapping[str, float]) -> None:
    for column in (PRINTING, TRAVELLING):
        _set(row, column, given.get("ACCEL", -1.0))
    for axis in (0, 1):
        _set(row, FEED + axis, given.get("VELOCITY", -1.0))
    corner = given.get("SQUARE_CORNER_VELOCITY", -1.0)
    if corner > 0.0 and row[PRINTING] > 0.0:
        row[DEVIATION] = corner**2 * _CORNER / row[PRINTING]


def _speed_factor(row: Floats, given: Mapping[str, float]) -> None:
    _set(row, FACTOR, given.get("S", -1.0) / 100.0)


_APPLY = {
    "axis feed": _axis_feed, "axis acceleration": _axis_acceleration,
    "acceleration": _acceleration, "jerk": _jerk, "jerk (RRF)": _jerk_per_minute,
    "velocity limit": _velocity_limit, "speed factor": _speed_factor,
}  # fmt: skip
_PROCESS = ("acceleration", "speed factor")  # of the print rather than the machine
