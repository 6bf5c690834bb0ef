"""What one controller is given: moves, and what stands between them.

A *stop* stands before a move. Behind most kinds the head has come to rest; only a signal in motion
and a temperature that nothing waits for leave the moves around them joined.

Heaters are taken to warm evenly, and to cool evenly too: as 40 W hot ends and mains or 24 V beds of
common printers do on the way to printing temperatures. What start code waits for is stated apart
from the makespan, since no file states it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.brief import brief
from decmcts.print.machine import HEAT_C_S, MotionLimits, Point
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
        is_bed = number in (b"140", b"190")
        heater = b"bed" if is_bed else b"hot end" + (tool[1] if tool else b"")
        degrees = degrees_of(words)
        target = self.due.get(heater, AMBIENT_C) if degrees is None else degrees
        self.due[heater] = target
        if number in (b"104", b"140"):
            return 0.0
        rate = BED_C_S if is_bed else HOT_END_C_S
        seconds = max(0.0, target - self.warm.get(heater, AMBIENT_C)) / rate
        for other, due in self.due.items():
            warm = self.warm.get(other, AMBIENT_C)
            gain = seconds * (BED_C_S if other == b"bed" else HOT_END_C_S)
            self.warm[other] = min(due, warm + gain)
        return seconds


STILL_MM = 1e-6  # filament that is none


class StopKind(IntEnum):
    """What a controller does between two moves."""

    DWELL = 0  # `value` seconds
    WAIT = 1  # until `number` was given, and `value` seconds more
    SIGNAL = 2  # gives `number`, at rest
    PASS = 3  # gives `number`, in motion
    REST = 4  # lets its queue run empty
    TARGET = 5  # sets the hot end to `value` °C, and goes on
    HEAT = 6  # the same, and goes on when it is as hot


@dataclass(frozen=True, slots=True)
class Stops:
    """What stands between the moves of one head, in order."""

    before: Ints  # (j,) number of moves above
    kind: Ints  # (j,) StopKind
    number: Ints  # (j,) of WAIT, SIGNAL and PASS: index of a signal, the same for all heads
    value: Floats  # (j,) seconds of DWELL and WAIT, °C of TELL and HEAT

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def rests(self) -> Flags:
        """Whether the head is at rest there, (j,)."""
        return np.asarray((self.kind != StopKind.PASS) & (self.kind != StopKind.TARGET))


@dataclass(frozen=True, slots=True)
class HotEnd:
    """How a hot end warms and cools: evenly."""

    warm_c: float = AMBIENT_C  # when the first of its stops is reached
    heat_c_s: float = HEAT_C_S
    cool_c_s: float = COOL_C_S


@dataclass(frozen=True, slots=True)
class HeadProgram:
    """What one head's controller carries out; move i goes from points[i] to points[i + 1]."""

    name: str
    points: Floats  # (m + 1, 3) mm
    filament: Floats  # (m,) mm pushed
    feed: Floats  # (m,) mm/s; 0: takes no time
    row: Ints  # (m,) which of `limits` hold
    limits: tuple[MotionLimits, ...]
    rest: Flags  # (m,) the head is at rest before the move, whatever stands there
    action: Ints  # (m,) number of the plan's action; of files, of the stretch between two rests
    line: Ints  # (m,) line of the file, from 1; 0: none
    stops: Stops
    begins: int = 0  # stops above which the print has not begun: start code
    ends: int | None = None  # stops above which it has: below is end code; None: there is none
    first_layer: int = 0  # line of the file that names the first layer; 0: none does
    hot_end: HotEnd = field(default_factory=HotEnd)  # which TARGET and HEAT are for

    __repr__ = brief("name", "points", "stops.kind")

    @property
    def prints(self) -> Flags:
        """Which moves lay a bead, (m,)."""
        moves = np.linalg.norm(np.diff(self.points, axis=0), axis=1) > 0.0
        return np.asarray((self.filament > STILL_MM) & moves)

    @property
    def laid_mm(self) -> float:
        """Length of all beads."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1)[self.prints].sum())

    @property
    def rests(self) -> Flags:
        """Whether the head is at rest before each move, (m,)."""
        rests = self.rest.copy()
        before = self.stops.before[self.stops.rests]
        rests[before[before < len(rests)]] = True
        return rests

    def moves_of_actions(self) -> tuple[Ints, Ints]:
        """Return the first and the last move of each action that has any."""
        firsts = np.flatnonzero(np.diff(self.action, prepend=-1) != 0)
        return firsts, np.append(firsts, len(self.action))[1:] - 1


def place_of(point: Floats) -> Point:
    """Return a point, (3,) mm, as plain numbers."""
    x, y, z = point.tolist()
    return x, y, z


def stops_of(rows: list[tuple[int, int, int, float]]) -> Stops:
    """Return stops of rows (before, kind, number, value) in their order."""
    table = np.array(rows, np.float64).reshape(-1, 4)
    whole = table[:, :3].astype(np.int64)
    return Stops(whole[:, 0].copy(), whole[:, 1].copy(), whole[:, 2].copy(), table[:, 3].copy())
