"""Machines: head shapes as slice stacks, bodies, rails and motion limits.

Files are read in `decmcts.formats.machines.machine_file`; this is the frozen result.
Units mm, mm/s, mm/s².

**Idle heads.** A head of several waits for others. Its hot end is hot meanwhile, and filament under
pressure seeps out. Slicers know this from changes of tools: the tool that is put down is pulled
back further, and may be cooled to a *standby* temperature; the one that comes is heated, pushed
forth again and primed. What a source does so is its `Practice`, what a machine file says goes
before it. Where neither says anything nothing is done. Where heads stand idle is found in
`decmcts.print.stands`.

**Sync words** are the lines with which the files of several heads signal and wait. What is in
braces is filled in: {number} of the sync point, the same in all files; {head}, the place (from 1)
of the file whose head gives it; {count}, how many signals that head has given by then, this one
included; {level}, 1 and 0 in turn with the count, for an output that changes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from string import Formatter
from typing import Any, Literal

import numpy as np

from decmcts.arrays import Floats
from decmcts.print.brief import brief

FIELDS = ("number", "head", "count", "level")


@dataclass(frozen=True, slots=True)
class SyncWords:
    """Lines of heads' files; what is in braces is filled in."""

    signal: str = "SYNC_SIGNAL N={number}"  # at rest, behind an M400
    passed: str = "SYNC_PASSED N={number}"  # in motion, behind a move
    wait: str = "SYNC_WAIT N={number}"

    def faults(self) -> Iterator[tuple[str, str]]:
        """Yield which of them no file can have, and why."""
        for name in ("signal", "passed", "wait"):
            line = getattr(self, name)
            try:
                named = fields_of(line)
            except ValueError as error:
                yield name, str(error)
                continue
            if others := sorted(named - set(FIELDS)):
                yield name, f"has {{{others[0]}}}, which is none of {', '.join(FIELDS)}"
            if not line.strip() or not line.isprintable() or set(";(") & set(line):
                yield name, "must be one line with a command, without a comment"
            if name == "wait" and not ({"number"} == named or {"head", "count"} == named):
                yield name, "must have {number}, or {head} and {count}, to say what it waits for"
            if name != "wait" and "{number}" in self.wait and "number" not in named:
                yield name, "must have {number}, for which a wait asks"
        if self.wait in (self.signal, self.passed):
            yield "wait", "is what a signal is too"


USUAL_WORDS = SyncWords()


def fields_of(line: str) -> set[str]:
    """Return the names in braces; ValueError where a brace is alone."""
    parts = list(Formatter().parse(line))
    if any(spec or conversion for _, _, spec, conversion in parts):
        raise ValueError("has more than a name in braces")
    if any(name is not None and not text for text, name, _, _ in parts[1:]):
        raise ValueError("has two names in braces with nothing between: no reader can part them")
    return {name for _, name, _, _ in parts if name is not None}


def pattern_of(line: str) -> str:
    """Return a regular expression of a line with any numbers in it, its blanks single."""
    parts = Formatter().parse(" ".join(line.split()))
    return "".join(re.escape(text) + (r"\d+" if name else "") for text, name, _, _ in parts)


def with_number(line: str, number: int, head: int, count: int) -> str:
    """Return a line of a file: sync point `number`, the `count`-th signal of file `head`."""
    return line.format(number=number, head=head, count=count, level=count % 2)


UNLOAD_MM = 20.0  # of filament; who pulls more takes it out of the hot end
IDLE_S = 10.0
HEAT_C_S = 2.0  # 40 W hot ends near 200 °C: they heat faster below


@dataclass(frozen=True, slots=True)
class Practice:
    """What is done with a tool that is not in use."""

    retract_mm: float = 0.0  # filament pulled back in all; no more than for a travel: none further
    prime_mm: float = 0.0  # pushed beyond what was pulled back
    standby_c: float | None = None  # None: it stays as hot as it prints


@dataclass(frozen=True, slots=True)
class Idle:
    """What a machine's file says of a head that stands idle; None: as the source does."""

    after_s: float = IDLE_S  # that it lays nothing, or stands
    standby_c: float | None = None
    heat_c_s: float = HEAT_C_S  # °C/s that its hot end heats by at least
    retract_mm: float | None = None
    prime_mm: float | None = None

    def over(self, source: Practice) -> Practice:
        """Return what the head does, where its source does this.

        Examples
        --------
        >>> Idle(prime_mm=0.0, standby_c=150.0).over(Practice(10.0, 0.3))
        Practice(retract_mm=10.0, prime_mm=0.0, standby_c=150.0)
        """
        return Practice(
            source.retract_mm if self.retract_mm is None else self.retract_mm,
            source.prime_mm if self.prime_mm is None else self.prime_mm,
            source.standby_c if self.standby_c is None else self.standby_c,
        )


Axes = tuple[float, float, float, float]  # x, y, z and the filament e
Point = tuple[float, float, float]  # x, y, z
Stands = Point | tuple[Point, ...]  # there, or anywhere on a line through these points
Release = Literal["point", "action"]


@dataclass(frozen=True, slots=True)
class Slice:
    """From `height_mm` above the tip upwards the head fills `polygons`.

    Polygons are convex, counter-clockwise, in the head's own XY frame with the
    nozzle at the origin (the form PrusaSlicer uses for its real printers).
    """

    height_mm: float
    polygons: tuple[Floats, ...]  # each (k, 2)

    __repr__ = brief("height_mm", "polygons")


@dataclass(frozen=True, slots=True)
class Body:
    """An axis-aligned box that moves with the nozzle: carriage, beam, duct."""

    name: str
    minimum: tuple[float, float, float]  # relative to the nozzle tip
    maximum: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of the time model, as firmware knows them; NaN: a source does not say."""

    travel_feed: float = 150.0  # mm/s, when the source names none
    max_feed: Axes = (300.0, 300.0, 20.0, 60.0)  # mm/s
    max_acceleration: Axes = (1500.0, 1500.0, 300.0, 5000.0)  # mm/s²
    jerk: Axes = (8.0, 8.0, 2.0, 5.0)  # mm/s, change of an axis' speed allowed at once
    acceleration: float = 1500.0  # mm/s² of printing, unless the source sets it
    retract_acceleration: float = 1500.0  # mm/s² of filament alone
    travel_acceleration: float = 1500.0  # mm/s², unless the source sets it
    junction_deviation: float = 0.0  # mm; above 0 it limits corners in the place of jerk

    @staticmethod
    def unstated() -> MotionLimits:
        """Return limits that say nothing."""
        four = (math.nan,) * 4
        return MotionLimits(math.nan, four, four, four, *(math.nan,) * 4)

    def under(self, stated: MotionLimits) -> MotionLimits:
        """Return these limits with what `stated` says (where it is not NaN) in their place."""
        both = {f.name: (getattr(self, f.name), getattr(stated, f.name)) for f in fields(self)}
        return MotionLimits(**{name: _stated_or(*pair) for name, pair in both.items()})


def _stated_or(usual: Any, stated: Any) -> Any:
    if isinstance(stated, tuple):
        return tuple(_stated_or(u, s) for u, s in zip(usual, stated, strict=True))
    return usual if math.isnan(stated) else stated


@dataclass(frozen=True, slots=True)
class Head:
    """One extruder: its shape near the print, its bodies, where it parks and reaches."""

    name: str
    slices: tuple[Slice, ...]  # ascending height
    bodies: tuple[Body, ...] = ()
    park: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach_min: tuple[float, float, float] = (-1e6, -1e6, -1e6)
    reach_max: tuple[float, float, float] = (1e6, 1e6, 1e6)
    tools: tuple[int, ...] = ()  # tool numbers (materials) it can print; empty: all
    limits: MotionLimits | None = None  # its own, whatever the source states; None: the machine's
    pace: float = 1.0  # all that it does takes so many times as long as its limits say; at least 1
    idle: Idle = field(default_factory=Idle)  # what it does where it waits for long

    __repr__ = brief("name", "park", "reach_min", "reach_max", "tools")


@dataclass(frozen=True, slots=True)
class Rail:
    """Heads that share a rail keep their order along `axis`, `separation_mm` apart.

    The reference points are the nozzles: nozzle of order[i + 1] minus nozzle of
    order[i] along the axis is at least `separation_mm` at all times.
    """

    axis: int  # 0: X, 1: Y
    order: tuple[str, ...]  # head names, ascending along the axis
    separation_mm: float


@dataclass(frozen=True, slots=True)
class Machine:
    """A printer: bed, heads and the relations between them."""

    name: str
    bed_min: tuple[float, float]
    bed_max: tuple[float, float]
    heads: tuple[Head, ...]
    clearance_mm: float = 0.0  # kept between head slices and printed beads
    bead_width: bool = True  # printed material has its beads' width; False: centrelines only
    head_clearance_mm: float = 1.0  # kept between the bodies of different heads
    lift_mm: float = 0.2  # a travel that must lift clears material by this much
    rails: tuple[Rail, ...] = ()  # a head may be on any number of them
    limits: MotionLimits = field(default_factory=MotionLimits)
    release: Release = "action"  # what a head can signal: points of a print, or only its end
    signal_interval_s: float = 0.1  # least time between signals of a head, where it signals points
    rest_s: float = 0.45  # what a head that stops for another loses until it moves again
    words: SyncWords = USUAL_WORDS  # with which its heads' files signal and wait
    source: str = ""  # where the shape comes from

    __repr__ = brief("name", "bed_min", "bed_max", "heads")

    def limits_of(self, head: Head) -> MotionLimits:
        """Return the limits a head moves under: its own, else the machine's."""
        return self.limits if head.limits is None else head.limits

    def head(self, name: str) -> Head:
        """Return the head of a name, one that is there."""
        return next(head for head in self.heads if head.name == name)

    def of_heads(self, heads: Sequence[Head]) -> Machine:
        """Return the machine with these of its heads, changed or not, and the rails between them.

        One that is left by itself moves under the limits it has.
        """
        if len(heads) == 1:
            return self.alone(heads[0])
        names = {head.name for head in heads}
        rails = [
            replace(rail, order=tuple(name for name in rail.order if name in names))
            for rail in self.rails
        ]
        kept = tuple(rail for rail in rails if len(rail.order) > 1)
        return replace(self, heads=tuple(heads), rails=kept)

    def alone(self, head: Head) -> Machine:
        """Return the machine with this head and no other, under the limits the head has."""
        lone = replace(head, limits=None)
        return replace(self, heads=(lone,), rails=(), limits=self.limits_of(head))


def line_of(stands: Stands) -> Floats:
    """Return the line on which something stands, (k, 3); one point: exactly there."""
    return np.atleast_2d(np.asarray(stands, np.float64))


@dataclass(frozen=True, slots=True)
class Fenced:
    """Heads that print no more and stand where they stopped: nothing may come near them.

    One may stand anywhere on a line.
    """

    machine: Machine  # with them and their rails, as it was before
    at: Mapping[str, Stands]  # where the nozzle of each stands, mm
