"""A controller kept in step while lines are written: position, E, feed, retraction, state.

Only the lines that change something are written. Orders are decided in
`writer` and `head_files`; nothing here knows of actions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import reduce
from itertools import accumulate
from operator import add

import numpy as np

from decmcts.arrays import Floats
from decmcts.formats.gcode.dialects.dialect import WAIT_MARK
from decmcts.formats.gcode.document import Cursor, GcodeDocument
from decmcts.formats.gcode.writing.beads import first_part, level_part
from decmcts.formats.gcode.writing.state_lines import StateLines
from decmcts.print.job import DEFAULT_TRAVEL, ProcessSettings
from decmcts.print.walls import no_walls, retracts
from decmcts.print.walls_kernels import Walls

NEAR_MM = 1e-3  # two positions this near are one
ROUNDING_MM = 1e-3  # of filament; less is not worth a line
LEFT_MM = 5e-5  # of filament; less may never be given, where nothing is retracted that takes it
APPROACH_MM = 5.0  # above the first bead, over purge lines and clips
BRIDGE_LIFT_MM = 0.4  # above everything printed, where no plan says how to travel

Point = tuple[float, float, float]


class Emitter:
    """Writes lines and keeps what the controller will then hold."""

    def __init__(
        self, document: GcodeDocument, settings: ProcessSettings, walls: Walls | None = None
    ) -> None:
        self.document = document
        self.settings = settings  # of the tool in use
        self._of_tool = {tool: settings.for_tool(tool) for tool, _ in settings.of_tools}
        self._usual = settings
        self.walls = no_walls() if walls is None else walls
        self.lines: list[bytes] = []
        xy, e, _ = document.decimals
        self._decimals = e
        self._xy, self._e = f".{xy}f", f".{e}f"
        self._ij = f".{max(xy, document.arcs.decimals)}f"
        self._bead_line = f"G1 X%.{xy}f Y%.{xy}f E%.{e}f".encode() + document.newline
        self._scale = document.e_area or 1.0
        self._feed_words: dict[float, str] = {}
        self.states = StateLines(document, self.emit)
        self.travel_feed = settings.travel_feed or DEFAULT_TRAVEL
        self.spare = 0.0  # of E as the file counts it: what words have rounded off, if relative
        self.e = 0.0
        self.relative_e = document.start.relative_e
        self.tail: Floats | None = None  # the bead just printed, newest first
        self.parted = False  # a verbatim block stands between the last bead and the next
        self.top = -math.inf  # highest bead so far; none yet
        self.cold = False  # the hot end is not heated yet: no filament may move
        self.take(document.start)

    def take(self, cursor: Cursor) -> None:
        """Take over from verbatim lines that leave the controller at `cursor`."""
        self.at = cursor.position
        self.e = cursor.e + self._rounded_off()
        self.feed = cursor.feed
        self.owed, self._pulled = cursor.owed, False
        self.firmware_retracted = cursor.firmware_retracted
        self.relative_e = cursor.relative_e  # M82 and M83 in the print are blocks
        self.states.take(cursor.state)

    def use(self, tool: int) -> None:
        """Retract from now on as a tool does."""
        self.settings = self._of_tool.get(tool, self._usual)

    def emit(self, text: str) -> None:
        """Write a line."""
        self.lines.append(text.encode("utf-8", "surrogateescape") + self.document.newline)

    def verbatim(self, text: bytes) -> None:
        """Write lines of the source as they are."""
        if text:
            whole = text.endswith(b"\n")
            self.lines.append(text if whole else text + self.document.newline)

    # -- motion -----------------------------------------------------------------

    def push(self, filament: float, feed: float) -> None:
        """Move the filament alone."""
        if abs(filament) < 1e-9:
            return
        self.emit(f"G1 E{self._count(filament)} F{self.feed_word(feed)}")
        self.feed = feed

    def _count(self, filament: float, *, bead: bool = False) -> str:
        """Return the E word of a push and count it.

        What words round off goes to the next that lays no bead.
        """
        amount = filament * self._scale
        self.e += amount
        if not self.relative_e:
            return format(self.e, self._e)
        text = format(amount if bead else amount + self.spare, self._e)
        self.spare += amount - float(text)
        return text

    def _rounded_off(self) -> float:
        """Return by how much E differs from its last word, where E is absolute."""
        if self.relative_e or not math.isfinite(self.e):
            return 0.0
        return self.e - float(format(self.e, self._e))

    def feed_word(self, feed: float) -> str:
        """Return the number of an F word, mm/min, of a feed in mm/s."""
        if (known := self._feed_words.get(feed)) is not None:
            return known
        text = f"{feed * 60.0:.{max(3, self.document.decimals[2])}f}"
        word = text.rstrip("0").rstrip(".") if "." in text else text
        self._feed_words[feed] = word
        return word

    def move(self, to: Point, feed: float, filament: float = 0.0) -> None:
        """Move in a straight line, with or without filament."""
        x, y, z = self.at
        across = to[0] != x or to[1] != y
        words = ["G1"]
        if across:
            words += [f"X{to[0]:{self._xy}}", f"Y{to[1]:{self._xy}}"]
        if to[2] != z:
            words.append(f"Z{to[2]:{self._xy}}")
        if filament:
            wiped = feed == self.feed and across and to[2] == z  # on, behind a first segment
            words.append(f"E{self._count(filament, bead=filament > 0.0 or wiped)}")
        if abs(feed - self.feed) > 1e-9:
            words.append(f"F{self.feed_word(feed)}")
        if len(words) > 1:
            self.emit(" ".join(words))
        if to != self.at:
            self.leave()
        self.at, self.feed = to, feed

    def plain(self, ends: Floats, rounded_off: list[float], feed: float) -> None:
        """Print straight and level from where the head stands, all segments at one feed.

        `ends` are the rows of `BeadRows.ends`; none is empty or without filament.
        """
        words = ends.ravel().tolist()
        if self.relative_e:
            self.spare = reduce(add, rounded_off, self.spare)
            self.e = reduce(add, words[2::3], self.e)
        else:
            words[2::3] = list(accumulate(words[2::3], initial=self.e))[1:]
            self.e = words[-1]
        lines = self._bead_line * len(ends) % tuple(words)
        if abs(feed - self.feed) > 1e-9:
            first, newline, rest = lines.partition(self.document.newline)
            lines = b"%b F%b%b%b" % (first, self.feed_word(feed).encode(), newline, rest)
        self.lines.append(lines)
        self.at, self.feed = (words[-3], words[-2], self.at[2]), feed

    def leave(self) -> None:
        """Forget the bead just printed: the head has gone elsewhere, and others may be there."""
        self.tail = None

    def arc(
        self, to: Point, centre: tuple[float, float], clockwise: bool, feed: float, filament: float,
    ) -> None:  # fmt: skip
        """Move along an arc around a centre; equal ends are a full circle."""
        words = ["G2" if clockwise else "G3", f"X{to[0]:{self._xy}}", f"Y{to[1]:{self._xy}}"]
        if to[2] != self.at[2]:
            words.append(f"Z{to[2]:{self._xy}}")
        words.append(f"I{centre[0] - self.at[0]:{self._ij}}")
        words.append(f"J{centre[1] - self.at[1]:{self._ij}}")
        words.append(f"E{self._count(filament, bead=True)}")
        if abs(feed - self.feed) > 1e-9:
            words.append(f"F{self.feed_word(feed)}")
        self.emit(" ".join(words))
        self.leave()
        self.at, self.feed = to, feed

    def set_feed(self, feed: float) -> None:
        """Set the modal feed without moving."""
        if feed > 0.0 and abs(feed - self.feed) > 1e-9:
            self.emit(f"G1 F{self.feed_word(feed)}")
            self.feed = feed

    def set_e(self, e: float) -> None:
        """Make the controller count E from another value, where it counts at all."""
        left = self._rounded_off()
        if not self.relative_e and not abs(self.e - left - e) <= 1e-7:
            self.emit(f"G92 E{e:{self._e}}")
        self.e = e + left

    # -- retraction -------------------------------------------------------------

    def owe(self, owed: float, *, firmware: bool = False, exact: bool = False) -> None:
        """Retract or push back until `owed` mm are retracted; below 0: until so much is pushed.

        A difference that is only rounding, where nothing was retracted, waits for the next
        retraction: it is not worth a stop. If `exact` it does not, nor for long where moves never
        retract.
        """
        if self.firmware_retracted != firmware:
            self.emit("G10" if firmware else "G11")
            self.firmware_retracted = firmware
        change = self.owed - owed
        settings = self.settings
        moves_retract = settings.retract_mm > 0.0 and not settings.firmware_retraction
        waits = ROUNDING_MM if moves_retract else LEFT_MM
        if abs(change) > (1e-6 if self._pulled or exact else waits):
            feed = settings.unretract_feed if change > 0 else settings.retract_feed
            self.push(change, feed)
            self.owed = owed

    def restart(self, due: float) -> None:
        """Begin a bead as the source does: with `due` mm retracted, or so much pushed beyond.

        With the bead the count begins anew.
        """
        self.owe(due)
        self.owed -= due
        self._pulled = False

    def retract(self) -> None:
        """Retract as the source does, wiping along the last bead if it wipes."""
        settings, habits = self.settings, self.document.habits
        if self.cold:
            return
        if settings.firmware_retraction:
            self.owe(self.owed, firmware=True)
            return
        if self._withdrawn():
            return
        self._pulled = True
        wiped = min(settings.wipe_filament_mm, settings.retract_mm - self.owed)
        tail = level_part(self.tail) if settings.wipe_mm > 0.0 and self.tail is not None else None
        if tail is not None and len(tail) > 1 and wiped > 0.0:
            self.owe(settings.retract_mm - wiped)
            self._wipe(tail, wiped)
        self.owe(settings.retract_mm)
        if habits.resets_e:
            self.set_e(0.0)

    def withdraw(self, deep: float) -> None:
        """Pull back until `deep` mm are retracted, standing still, for who stands idle.

        What is still to be pushed beyond (below 0) stays so.
        """
        more = deep - max(self.owed, 0.0)
        if more > ROUNDING_MM and not (self.cold or self.settings.firmware_retraction):
            self._pulled = True
            self.owe(self.owed + more)

    def retract_for(self, way: Sequence[Point]) -> None:
        """Retract if the travel along `way` is one that is retracted."""
        if not self._withdrawn() and retracts(self.walls, self.settings, way):
            self.retract()

    def _withdrawn(self) -> bool:
        """Tell whether there is nothing left to retract."""
        if self.settings.firmware_retraction:
            return self.firmware_retracted
        return self.owed >= self.settings.retract_mm - 1e-6

    def _wipe(self, tail: Floats, filament: float) -> None:
        """Wipe half the length back along the bead and return: a path that was just printed.

        The head ends where the bead ends, so the planned travel starts there.
        """
        half = self.settings.wipe_mm / 2.0
        way = first_part(tail, half)
        length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
        if length < NEAR_MM:
            return
        there = [tuple(p) for p in way.tolist()]
        for to in there[1:] + there[-2::-1]:
            share = math.dist(self.at, to) / (2.0 * length) * filament
            self.move(to, self.settings.wipe_feed or self.travel_feed, -share)
            self.owed += share

    # -- travel -----------------------------------------------------------------

    def travel(self, points: Sequence[Point], passed: Mapping[int, str] | None = None) -> None:
        """Follow the points of a planned path from where the head stands.

        `passed` has what is to be said where the head has come to points of the path.
        """
        length = math.dist(self.at, points[0]) + sum(map(math.dist, points, points[1:]))
        if length < 1e-9:
            for text in (passed or {}).values():
                self.emit(text)
            return
        self.retract_for([self.at, *points])
        for k, to in enumerate(points):
            if to != self.at:
                upright = to[0] == self.at[0] and to[1] == self.at[1]
                self.move(to, (upright and self.settings.z_feed) or self.travel_feed)
            if passed and k in passed:
                self.emit(passed[k])

    def dwell(self, seconds: float, mark: str = WAIT_MARK) -> None:
        """Stand still; `mark` says what for."""
        self.emit(f"G4 P{math.ceil(1000.0 * seconds - 1e-6)} {mark}")

    def approach(self, to: Point) -> None:
        """Go to the first bead: up, across, down.

        Every axis is named, for where homing or a macro left the head is not known. That
        it is lifted over what lies there, outside the part, is why length alone decides
        whether it is retracted.
        """
        if math.dist(self.at, to) >= self.settings.retract_min_travel_mm:
            self.retract()
        over = max(self.at[2], to[2] + APPROACH_MM)
        feed = self.settings.z_feed or self.travel_feed
        self.emit(f"G1 Z{over:{self._xy}} F{self.feed_word(feed)}")
        across = f"X{to[0]:{self._xy}} Y{to[1]:{self._xy}}"
        self.emit(f"G1 {across} F{self.feed_word(self.travel_feed)}")
        self.leave()
        self.at, self.feed = (to[0], to[1], over), self.travel_feed
        self.move(to, feed)

    def hover(self, to: Point) -> None:
        """Go above a place, over everything printed, and do not come down on it."""
        if math.dist(self.at, to) < NEAR_MM:
            return
        over = max(self.top, to[2]) + BRIDGE_LIFT_MM
        x, y, z = self.at
        highest = max(over, z)
        self.travel([(x, y, highest), (to[0], to[1], highest), (to[0], to[1], over)])

    def bridge(self, to: Point) -> None:
        """Go over everything printed so far: up, across, down."""
        if math.dist(self.at, to) < NEAR_MM:
            return
        lift = max(BRIDGE_LIFT_MM, self.settings.hop_mm)
        over = max(self.top, self.at[2], to[2]) + lift
        x, y, _ = self.at
        self.travel([(x, y, over), (to[0], to[1], over), to])

    def text(self) -> bytes:
        """Return all that was written."""
        return b"".join(self.lines)
