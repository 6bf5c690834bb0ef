"""Where a head of several waits for others, stands still, and tells that it has come somewhere.

The waiting head dwells behind its waits for as long as its lags ask, whenever the signal came:
files keep no time among each other. It dwells too, retracted, where the plan rests for cooling.
"""

from __future__ import annotations

from decmcts.formats.gcode.dialects.dialect import IDLE_MARK, WAIT_MARK
from decmcts.formats.gcode.writing.emitter import Emitter
from decmcts.formats.gcode.writing.sync_points import SyncPoints
from decmcts.print.stands import Standby
from decmcts.print.sync_words import SyncWords, said

LONGEST_DWELL_S = 600.0  # of one G4


class HeadWaits:
    """Writes the waits, dwells and signals of one head.

    Parameters
    ----------
    head : int
        Its place in the plan.
    apart_s : float
        How long it stands before a signal at rest that is too near to the one before.
    """

    def __init__(
        self, emitter: Emitter, points: SyncPoints, words: SyncWords, head: int, apart_s: float
    ) -> None:
        self.emitter, self.points, self.words = emitter, points, words
        self.head, self._apart_s = head, apart_s

    def signal(self, number: int) -> None:
        """Signal at rest."""
        self.emitter.say("M400")
        self.emitter.say(self._line(self.words.signal, number))

    def wait(self, number: int) -> None:
        """Wait for a number; the moves above run out by themselves."""
        self.emitter.say(self._line(self.words.wait, number))

    def take_turn(self) -> None:
        """Signal that this head is parked, and wait until all are."""
        heads = len(self.points.done)
        if heads > 1:
            self.signal(self.head + 1)
            if self.head + 1 < heads:
                self.wait(heads)

    def passed(self, action: int) -> dict[int, str] | None:
        """Return what is to be said, by the points of an action's path, as the head passes them."""
        given = self.points.passed.get((self.head, action))
        if given is None:
            return None
        return {point: self._line(self.words.passed, number) for point, number in given.items()}

    def stand(
        self, action: int, rested_s: float, standby: Standby | None, *, hot: float, cold: float
    ) -> None:
        """Write what an action waits for, and for how long the head stands before it.

        With a `standby` the hot end, at `hot` degrees, is at `cold` meanwhile.
        """
        numbers = self.points.waits.get((self.head, action), ())
        lag_s = self.points.lags.get((self.head, action), 0.0)
        if standby is None:
            self._wait_for(numbers, lag_s, rested_s)
            return
        self.emitter.say("M400")
        self.emitter.say(f"M104 S{cold:g} {IDLE_MARK}")
        if not standby.behind:
            self._dwell(standby.cool_s, IDLE_MARK)
            self.emitter.say(f"M104 S{hot:g}")
            self._wait_for(numbers, lag_s, rested_s)
        else:
            self._wait_for(numbers, standby.cool_s)
            self.emitter.say(f"M104 S{hot:g}")
            self._dwell(standby.heat_s)
        self.emitter.say(f"M109 S{hot:g}")

    def ended(self, action: int) -> None:
        """Signal that an action has ended if any head waits for it, without a stop where it can."""
        place = self.head, action
        if (number := self.points.signals.get(place, 0)) <= 0:
            return
        if place in self.points.at_rest:
            self._stand_apart(action)
            self.signal(number)
        else:
            self.emitter.say(self._line(self.words.passed, number))

    def wait_for_all(self, count: int) -> None:
        """Signal that all `count` actions are done, and wait for all heads and the turn to end."""
        done, ended = self.points.done, self.points.ended
        if len(done) == 1:
            return
        self._stand_apart(count)
        self.signal(done[self.head])
        for number in done[: self.head] + done[self.head + 1 :]:
            self.wait(number)
        if self.head > 0:
            self.wait(ended[self.head - 1])
        if self.head + 1 < len(ended):
            self._dwell(self._apart_s)  # a signal stands below the end code, too

    def pass_turn(self) -> None:
        """Signal that the end code has run, if a head waits for its turn."""
        if self.head + 1 < len(self.points.ended):
            self.signal(self.points.ended[self.head])

    def _stand_apart(self, action: int) -> None:
        if (self.head, action) in self.points.apart:
            self._dwell(self._apart_s)

    def _wait_for(self, numbers: tuple[int, ...], *seconds: float) -> None:
        """Wait for numbers, and stand still behind them."""
        for number in numbers:
            self.wait(number)
        for part in seconds:
            self._dwell(part)

    def _dwell(self, seconds: float, mark: str = WAIT_MARK) -> None:
        """Stand still, in as many parts as controllers take."""
        while seconds > 0.0:
            part = min(seconds, LONGEST_DWELL_S)
            self.emitter.dwell(part, mark)
            seconds -= part

    def _line(self, words: str, number: int) -> str:
        return said(words, number, *self.points.given[number])
