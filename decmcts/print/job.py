"""A print job: contours plus what the source says about the process.

How the source text looked is kept in `decmcts.formats`; planners never see it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np

from decmcts.arrays import Floats
from decmcts.print.brief import brief
from decmcts.print.contours import Contours
from decmcts.print.machine import Fenced, MotionLimits, Practice

DEFAULT_TRAVEL = 100.0  # mm/s, where the source names none


@dataclass(frozen=True, slots=True)
class Retraction:
    """What one tool of a source does with its filament and its height around a travel."""

    retract_mm: float = 0.0  # filament, 0: the source never retracts
    retract_feed: float = 40.0  # mm/s
    unretract_feed: float = 40.0  # mm/s
    hop_mm: float = 0.0  # lift of the source's retracted travels
    firmware_retraction: bool = False  # G10/G11 instead of E moves
    wipe_mm: float = 0.0  # length of the wipe while retracting, 0: none
    wipe_filament_mm: float = 0.0  # retracted during it
    wipe_feed: float = 0.0  # mm/s


@dataclass(frozen=True, slots=True)
class ProcessSettings(Retraction):
    """Retraction, lift and travel as the source does them.

    Where the tools of a source retract differently, the fields of `Retraction` here are those of
    the tool that prints most, and `of_tools` has those of the others; `for_tool` puts them in
    place.
    """

    travel_feed: float = 0.0  # mm/s; 0: take the machine's
    retract_min_travel_mm: float = 2.0  # shorter travels are not retracted
    bare_inside_mm: float = 0.0  # nor are longer ones up to this inside the part; 0: they are
    bare_climb_mm: float = 0.0  # which may climb so far to the next layer; 0: level ones only
    z_feed: float = 0.0  # mm/s of moves in Z alone; 0: as travel
    travel_acceleration: float = 0.0  # mm/s²; 0: take the machine's
    min_layer_time_s: float = 0.0  # the slicer slows layers down to this; 0: it does not
    of_tools: tuple[tuple[int, Retraction], ...] = ()  # tools that retract otherwise

    def for_tool(self, tool: int) -> ProcessSettings:
        """Return the settings with the retraction of one tool.

        Examples
        --------
        >>> both = ProcessSettings(retract_mm=0.8, of_tools=((1, Retraction(retract_mm=3.0)),))
        >>> both.for_tool(0).retract_mm, both.for_tool(1).retract_mm
        (0.8, 3.0)
        """
        for other, retraction in self.of_tools:
            if other == tool:
                own = {f.name: getattr(retraction, f.name) for f in fields(Retraction)}
                return replace(self, **own)
        return self

    def each(self) -> tuple[ProcessSettings, ...]:
        """Return the settings of every kind of tool, the most used first."""
        return (self, *(self.for_tool(tool) for tool, _ in self.of_tools))


@dataclass(frozen=True, slots=True)
class Barrier:
    """A command that no contour may be moved across."""

    text: str
    line: int
    reason: str  # e.g. "unknown command", "temperature change", "tool change"


@dataclass(frozen=True, slots=True)
class PrintJob:
    """What planners get: the contours and the process around them."""

    name: str
    contours: Contours
    settings: ProcessSettings = field(default_factory=ProcessSettings)
    barriers: tuple[Barrier, ...] = ()
    slicer: str = ""  # e.g. "PrusaSlicer 2.5.0"
    notes: tuple[str, ...] = ()  # one line each, shown in the summary
    limits: MotionLimits = field(default_factory=MotionLimits.unstated)  # as the source states them
    acceleration: Floats | None = None  # (n_points,) mm/s² set for the segment
    # ending at each point of the contours, NaN where nothing sets it; None: nowhere
    refills: tuple[int, ...] = ()  # epochs that begin with a tool change, filament change or pause
    printed: Contours | None = None  # what stands on the bed before anything here is printed
    fenced: Fenced | None = None  # heads that stand in the way and print no more
    practices: tuple[tuple[int, Practice], ...] = ()  # of tools, what the source does with them
    # between two uses, where each head has one tool
    print_with: tuple[tuple[int, int], ...] = ()  # of a rest: tools, and those that print for them

    __repr__ = brief("name", "slicer", "contours", "barriers", "notes")

    @property
    def accelerations(self) -> Floats:
        """Acceleration set for the segment ending at each point, (n_points,) mm/s²; 0: none is."""
        if self.acceleration is None:
            return np.zeros(len(self.contours.points))
        known = np.nan_to_num(self.acceleration)
        known[self.contours.offsets[:-1]] = 0.0  # no segment ends at a contour's first point
        return known

    def practice(self, tool: int | None) -> Practice:
        """Return what the source does with a tool between two uses; None: a head prints nothing."""
        return dict(self.practices).get(-1 if tool is None else tool, Practice())
