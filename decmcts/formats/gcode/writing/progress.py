"""Progress of a plan, said in M73 where the source says its own.

Which words a source uses lives in `dialects.stated_times`.
"""

from __future__ import annotations

import re

from decmcts.formats.gcode.dialects.stated_times import M73, WORD, without_progress
from decmcts.formats.gcode.document import GcodeDocument
from decmcts.formats.gcode.writing.emitter import Emitter
from decmcts.print.plan import HeadActions


class Progress:
    """Writes M73 anew from the plan's own times, where the source had any."""

    def __init__(self, document: GcodeDocument, actions: HeadActions) -> None:
        self._begin = actions.begin_s
        self._total = float(actions.end_s.max(initial=0.0))
        self._words = document.habits.progress
        self._silent = document.habits.silent_share
        self._shown = -1

    def tell(self, emitter: Emitter, action: int) -> None:
        """Write the progress at the beginning of an action if it changed."""
        if self._total <= 0.0 or not self._words:
            return
        percent = int(100.0 * self._begin[action] / self._total)
        if percent != self._shown:
            left = self._total - float(self._begin[action])
            for words in ("PR", "QS"):
                if set(words) & set(self._words):
                    emitter.say(f"M73 {self._said(words, percent, left)}")
            self._shown = percent

    def _said(self, words: str, percent: float, left_s: float) -> str:
        """Return the parameters of one mode, of those the source has."""
        share = self._silent if words == "QS" else 1.0
        values = (f"{percent:.0f}", f"{left_s * share / 60.0:.0f}")
        return " ".join(f"{w}{v}" for w, v in zip(words, values, strict=True) if w in self._words)

    def above(self, preamble: bytes) -> bytes:
        """Return the start G-code with what its M73 say counted anew."""

        def count(match: re.Match[bytes]) -> bytes:
            left = self._total / 60.0 * (self._silent if match[1] in b"Ss" else 1.0)
            return match[1] + (b"0" if match[1] in b"PpQq" else f"{left:.0f}".encode())

        return b"".join(
            line if M73.match(line) is None else WORD.sub(count, line)
            for line in without_progress(preamble, keep=(b"P", b"R", b"Q", b"S"))
        )
