"""Whether the words of heads' files do what the files count on.

Known of controllers are a few things that make a signal come early, or never; each is looked for
in the text (docs/gcode.md has the lines of their sources).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from decmcts.print.machine import Release
from decmcts.print.sync_words import SyncWords
from sim.faults import Fault, FaultKind, listed

_STOPS = re.compile(r"(M400|G0*4|M0|M1|M25|M226|M577|M598|PAUSE|TEMPERATURE_WAIT)\b", re.I)
WHEN_READ = re.compile(r"(M11[78]|M98|RESPOND|RUN_SHELL_COMMAND)\b|.*action_", re.I)
_RESUMED = re.compile(r"(M0|M1|M25|M601|PAUSE)\b", re.I)
SYSTEMS = re.compile(r"\s*(M59[678]|M606)\b", re.I)
M42 = re.compile(r"\s*M42\b(.*)", re.I)


def check_words(words: SyncWords, release: Release) -> list[Fault]:
    """Check the lines of the files themselves."""
    lines = list(_of_wait(words))
    lines += list(_of_passed(words.passed)) if release == "point" else []
    return listed(FaultKind.COMMAND, lines)


def _of_wait(words: SyncWords) -> Iterator[str]:
    if _RESUMED.match(words.wait):
        yield f"'{words.wait}': what resumes before the pause is dropped, so the head never goes on"
    if SYSTEMS.match(words.wait):
        yield f"'{words.wait}' is for motion systems of one board, files are for one each"


def _of_passed(line: str) -> Iterator[str]:
    """Yield what keeps a line from being a signal in step with the moves."""
    if _STOPS.match(line):
        yield f"'{line}' stops the head, so it is no signal in motion"
    if WHEN_READ.match(line):
        yield f"'{line}' runs when it is read, before the moves above it have ended"
    if not {"{number}", "{count}", "{level}"} & set(re.findall(r"\{\w+\}", line)):
        yield f"'{line}' is the same for every signal, so nothing changes"
    if match := M42.match(line):
        yield from of_m42(match[1])


def of_m42(rest: str) -> Iterator[str]:
    """Yield what keeps M42 out of RepRapFirmware's queue of moves."""
    for word in rest.split():
        if not re.fullmatch(r"[PFQ]\d+|S(\d+(\.\d+)?|\{level\})", word, re.I):
            yield f"M42 with '{word}', which is no literal value, is not queued with the moves"
