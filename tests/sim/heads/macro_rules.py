"""Whether the macros that are shipped do what heads' files count on.

A macro that has none of the known faults may be wrong all the same: nothing here runs it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping

from decmcts.print.machine import Machine, SyncWords
from sim.faults import Fault, FaultKind, listed
from sim.heads.together import M42, SYSTEMS, WHEN_READ, check_words, of_m42

DROPPED_S = 0.1  # Klipper drops changes of an output nearer than this
_SECTION = re.compile(r"^\[([^\]]+)\][^\n]*\n((?:[^\[\n][^\n]*\n|\n)*)", re.M)
_CALLED = re.compile(r'M98 P"([^"]+)"')
_TRIGGER = re.compile(r"^[ \t]*+M581 P(\d+) T(\d+) S([01])\b", re.M)
_INPUT = re.compile(r"^[ \t]*+M950 J(\d+)\b", re.M)
_WAITS = re.compile(r"^while global\.(\w+)\[param\.H\] < param\.C$\n^ +G4 P[1-9]\d*$", re.M)


def check_macros(machine: Machine, texts: Mapping[str, str]) -> list[Fault]:
    """Check macros and sections of one controller, by file name, with the machine's words."""
    plain = {name: _uncommented(text) for name, text in texts.items()}
    every = "\n".join(plain.values())
    lines = [fault.text for fault in check_words(machine.words, machine.release)]
    lines += _of_reprapfirmware(machine.words, plain)
    for title, body in _SECTION.findall(every + "\n"):
        lines += _of_klipper(machine.words, title.strip(), body)
    if "SET_PIN" in machine.words.passed and machine.signal_interval_s < DROPPED_S:
        lines.append(
            f"signal_interval_s is {machine.signal_interval_s:g}, Klipper drops changes of a pin "
            f"nearer than {DROPPED_S:g} s"
        )
    return listed(FaultKind.COMMAND, lines)


def _of_reprapfirmware(words: SyncWords, texts: Mapping[str, str]) -> Iterator[str]:
    if called := _CALLED.match(words.wait):
        text = texts.get(called[1], "")
        if not _WAITS.search(text):
            yield f"{called[1]} does not wait until the signals of head H are C"
        counter = match[1] if (match := _WAITS.search(text)) else "given"
        yield from _of_triggers(texts, counter)
    for name, text in texts.items():
        for row in text.splitlines():
            if SYSTEMS.match(row):
                yield f"{name}: '{row.strip()}': signals are in step on motion system 0 only"
            if match := M42.match(row):
                yield from (f"{name}: {what}" for what in of_m42(match[1]))


def _of_triggers(texts: Mapping[str, str], counter: str) -> Iterator[str]:
    """Yield the inputs of which not both edges are counted, each once and by itself."""
    every = "\n".join(texts.values())
    edges = {(pin, level): number for pin, number, level in _TRIGGER.findall(every)}
    for pin in _INPUT.findall(every) or ["?"]:
        numbers = [edges.get((pin, level)) for level in "10"]
        if None in numbers or numbers[0] == numbers[1]:
            yield f"input {pin}: not both its edges have a trigger of their own"
            continue
        for number in numbers:
            adds = re.findall(
                rf"^set global\.{counter}\[(\d+)\] = global\.{counter}\[\1\] \+ 1$",
                texts.get(f"trigger{number}.g", ""), re.M,
            )  # fmt: skip
            if adds != [pin]:
                yield f"trigger{number}.g does not count the signals of input {pin}"


def _of_klipper(words: SyncWords, title: str, body: str) -> Iterator[str]:
    kind, _, name = title.partition(" ")
    if kind != "gcode_macro":
        return
    rows = [row.strip() for row in body.partition("gcode:")[2].splitlines()]
    pins = [match[1] for row in rows if (match := re.match(r"SET_PIN PIN=(\w+)", row))]
    for pin in {pin for pin, count in Counter(pins).items() if count > 1}:
        yield f"{title} changes {pin} twice, nearer than {DROPPED_S:g} s: none may come"
    if any(re.match(r"(PAUSE|RESUME)\b", row) for row in rows):
        yield f"{title} pauses or resumes: a RESUME before its PAUSE is dropped"
    if "M400" in rows and len(rows) > 1:
        yield f"{title} has an M400 among other lines: a macro is rendered before any of them runs"
    if name == words.wait.split()[0]:
        yield f"{title} is a macro, and no macro waits: its lines run at once"
    if name == words.passed.split()[0] and any(WHEN_READ.match(row) for row in rows):
        yield f"{title} tells others when it is read, before the moves above it have ended"


def _uncommented(text: str) -> str:
    return "\n".join(re.split("[;#]", row, maxsplit=1)[0].rstrip() for row in text.splitlines())
