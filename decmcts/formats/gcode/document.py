"""What the source looked like: the text planners never see, writers need.

Only frozen data lives here; it is read in `reader` and written in `writer`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.print.brief import brief

NO_ARC = -1
UNSET = 0  # value id of a slot that was never set
# a travel belongs to what it leads to
BEFORE_TRAVEL = ("layer", "mesh", "object", "label", "numbered label")
BEAD = ("type", "width", "height")
DESCRIBES = ("layer", "mesh", *BEAD, "message", "print stats")  # words that command nothing
SILENT = ("tool", "temperature")  # slots that only blocks set: compared, never re-emitted


@dataclass(frozen=True, slots=True)
class StateTable:
    """The sticky machine states that occur, interned.

    Row r says for each slot which text set it; UNSET where nothing did.
    """

    slots: tuple[str, ...]
    values: tuple[str, ...]  # values[UNSET] == ""
    leave: tuple[str, ...]  # aligned with values: the text that ends an object or label
    rows: Int32s  # (n_states, n_slots) value ids
    travel: Int32s | None = None  # (n_states,) state in which the source travels to
    # beads of each state, -1: unknown; None: all are

    __repr__ = brief("slots", "rows")

    def column(self, slot: str) -> Int32s:
        """Return which value each state has in a slot, (n_states,); UNSET where there is none."""
        if slot not in self.slots:
            return np.full(len(self.rows), UNSET, np.int32)
        return self.rows[:, self.slots.index(slot)]

    def text(self, state: int, slot: str) -> str:
        """Return what set `slot` in a state; empty when nothing did."""
        if slot not in self.slots:
            return ""
        return self.values[int(self.rows[state, self.slots.index(slot)])]


class MoreStates:
    """The states of a table, and more that are made of them."""

    def __init__(self, table: StateTable) -> None:
        self._table = table
        self.rows = list(map(tuple, table.rows.tolist()))
        self._known = {row: k for k, row in enumerate(self.rows)}
        self._travel = None if table.travel is None else table.travel.tolist()

    def like(self, state: int, values: Mapping[int, int]) -> int:
        """Return the state that is like one but for the values of these slots."""
        row = tuple(values.get(k, value) for k, value in enumerate(self.rows[state]))
        if row not in self._known:
            self._known[row] = len(self.rows)
            self.rows.append(row)
            if self._travel is not None:
                self._travel.append(self._travel[state])
        return self._known[row]

    def table(self) -> StateTable:
        """Return all states."""
        rows = np.array(self.rows, np.int32).reshape(-1, len(self._table.slots))
        travel = None if self._travel is None else np.array(self._travel, np.int32)
        return replace(self._table, rows=rows, travel=travel)


@dataclass(frozen=True, slots=True)
class Cursor:
    """Where the source's controller stood between two lines.

    `owed` is filament in mm that the source pulls on the spot and does not push back: since the
    last contour, where verbatim lines are to follow; where they end, what it pushes from there to
    the next contour. Below 0 where it pushes, or pulls, more.
    """

    position: tuple[float, float, float]
    e: float  # as the source counts it (mm³ if volumetric)
    feed: float  # mm/s
    owed: float
    pulled: float  # retracted by the tool in use as far as moves show it, mm
    firmware_retracted: bool
    relative_e: bool
    state: int
    tool: int


@dataclass(frozen=True, slots=True)
class Block:
    """Lines that stay together, verbatim, at the beginning of an epoch."""

    epoch: int
    text: bytes
    begin: Cursor
    end: Cursor
    moves: bool  # it moves the head, so both ends must be met exactly
    line: int  # source line, from 1
    reason: str
    reasons: tuple[str, ...] = ()  # of all barriers in it
    edge: bool = False  # what is in force begins an epoch here too
    tower: bool = False  # beads of a wipe tower stand beside it

    @property
    def last_line(self) -> int:
        """Its last line in the source, from 1."""
        return self.line + len(self.text.splitlines()) - 1


@dataclass(frozen=True, slots=True)
class OwnStart:
    """What a head with one tool of several is told behind the start code.

    The lines of the change with which the source takes that tool first.
    """

    tool: int
    text: bytes
    selected: int  # the tool in use above them
    end: Cursor  # behind them, in the source
    line: int  # of the source, from 1, the last of them


@dataclass(frozen=True, slots=True)
class Habits:
    """How the source does what is regenerated, beyond `ProcessSettings`."""

    resets_e: bool = False  # G92 E0 occurs in the print
    progress: str = ""  # parameters of M73 in the print, of P, R (normal mode), Q, S (silent)
    silent_share: float = 0.0  # time in silent mode over that in normal mode, as M73 says


@dataclass(frozen=True, slots=True)
class Arcs:
    """The arcs of a file, by number: circles their chords do not tell."""

    centre: Floats  # (k, 2) mm
    clockwise: Flags  # (k,) a G2
    partible: Flags  # (k,) a part cut at a chord's end reads back as these chords
    words: Floats  # (k, 3) I, J and R as they stand in the file; NaN: left out
    decimals: int  # of I and J

    @staticmethod
    def none() -> Arcs:
        """Return the table of a file without arcs."""
        flags = np.zeros(0, np.bool_)
        return Arcs(np.zeros((0, 2)), flags, flags, np.zeros((0, 3)), 0)


@dataclass(frozen=True, slots=True)
class Motions:
    """Every move of a file in order, for whoever judges it.

    A move k goes from points[k] to points[k + 1]; homing and G92 appear as
    moves without feed.
    """

    points: Floats  # (m + 1, 3) mm
    extrusion: Floats  # (m,) filament pushed, mm
    feed: Floats  # (m,) mm/s
    line: Ints  # (m,) source line, from 1
    contour: Ints  # (m,) contour in the order of this file, -1: none
    width: Floats  # (m,) bead width, mm; 0 where contour is -1
    height: Floats  # (m,) bead height, mm; 0 where contour is -1
    placed: Flags | None = None  # (m,) homing or G92, no move of known path
    arc: Int32s | None = None  # (m,) number in `arcs` a move is a chord of, or NO_ARC
    arcs: Arcs | None = None
    tool: Ints | None = None  # (m,) in use; None: one tool
    withdrawn: Flags | None = None  # (m,) the firmware has retracted before; None: no

    __repr__ = brief("points", "extrusion")


@dataclass(frozen=True, slots=True)
class GcodeDocument:
    """The text around and between the contours of one file."""

    path: str
    preamble: bytes
    postamble: bytes
    newline: bytes
    start: Cursor  # after the preamble
    end: Cursor  # before the postamble
    blocks: tuple[Block, ...]  # ascending epoch
    states: StateTable
    point_state: Int32s  # (n_points,) state of the segment ending there
    owed: Floats  # (n,) mm left retracted where the source begins a contour; below 0:
    # pushed beyond what was retracted
    relative_e: bool
    e_area: float  # mm² when E is volumetric (M200), 0 when it is mm
    decimals: tuple[int, int, int]  # xy, e, feed
    habits: Habits
    point_arc: Int32s  # (n_points,) arc of the segment ending there, or NO_ARC
    arcs: Arcs
    plate: int | None  # of a .gcode.3mf, as asked for
    moves: Motions  # of the whole file, for the judge
    text: bytes | None = None  # that was read in place of the file's own; None: none was
    own_starts: tuple[OwnStart, ...] = ()  # where changes of tools are no walls, of each tool but
    # the first

    __repr__ = brief("path", "blocks", "states")

    def own_start(self, tool: int | None) -> OwnStart | None:
        """Return what the head of a tool is told behind the start code; None: no more."""
        return next((own for own in self.own_starts if own.tool == tool), None)

    @property
    def starts(self) -> tuple[Cursor, ...]:
        """Where the source's controller stands behind the start code of each head."""
        return (self.start, *(own.end for own in self.own_starts))
