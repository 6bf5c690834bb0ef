"""The lines with which the files of several heads signal and wait, as a controller has them.

What is in braces is filled in: {number} of the sync point, the same in all files; {head}, the
place (from 1) of the file whose head gives it; {count}, how many signals that head has given by
then, this one included; {level}, 1 and 0 in turn with the count, for an output that changes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from string import Formatter

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
