"""The judge's book of settings: what is in force when a bead is laid.

Each bead is laid with the fan, the factors of speed and flow, accelerations, pressure advance and
the like that it is laid with in the source. A setting is a word of a command (`M204 P`) for what
that command names besides (`M900 T1 K`). Both texts are read by `sim.files.command_book`, not by
the reader that made the result.
"""

from __future__ import annotations

import re
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from sim.faults import LIMIT, Fault, FaultKind, listed
from sim.files.command_book import commands_of

_FAN = re.compile(rb"M(10[67]|12[67])(?![\d.])(.*)", re.I | re.S)
_SET = re.compile(
    rb"(M(?:20[13-8]|22[01]|566|572|593|74|900)(?![\d.])"
    rb"|SET_(?:VELOCITY_LIMIT|PRESSURE_ADVANCE|RETRACTION|FAN_SPEED)\b)(.*)",
    re.I | re.S,
)
_WORDS = re.compile(rb"(?<![A-Z_])([A-Z_]++) ?(?:= ?([^\s=]+)|([-+]?[\d.]*\d[\d.]*))", re.I)
_NAMES = (b"T", b"D", b"EXTRUDER", b"FAN")  # words that say of which tool, or of which fan
_NAMES_NONE = (b"M204", b"M205")  # there T and D set something themselves
_UNSAID = {"fan": "0", "M220 S": "100", "M221 S": "100"}  # in force where nothing was said

Ints = NDArray[np.int64]
Settings = dict[str, list[tuple[int, str]]]
"""Of each setting the lines, from 1, that set it, and to what."""


def check_settings(text: bytes, source: bytes, line: Ints, source_line: Ints) -> list[Fault]:
    """Check that each bead is laid under the settings it is laid under in the source.

    Where the source has not said anything yet, but for `_UNSAID`, anything may be in force.

    Parameters
    ----------
    text, source
        The file and its source.
    line, source_line : (n,)
        Where each bead is laid in the file, and where in the source, from 1.
    """
    ours, theirs = settings_of(text), settings_of(source)
    lines, total = list[str](), 0
    for name, due in theirs.items():
        unsaid = _UNSAID.get(name, "")
        has = ours.get(name, [])
        values = list(dict.fromkeys([unsaid, *(value for _, value in [*has, *due])]))
        a, b = _in_force(has, values, line), _in_force(due, values, source_line)
        wrong = np.flatnonzero((a != b) & ((b > 0) | bool(unsaid)))
        total += len(wrong)
        lines += [
            f"line {line[k]} is printed with {name} {values[a[k]] or 'not set'}, in the source "
            f"with {values[b[k]]} (line {source_line[k]} there)"
            for k in wrong[:LIMIT].tolist()
        ]
    return listed(FaultKind.STATE, lines[:LIMIT], total=total)


def settings_of(text: bytes) -> Settings:
    """Return what a text sets, and where; linear in its length."""
    found: Settings = {}
    for line, command in commands_of(text):
        for name, value in _set_by(command):
            found.setdefault(name, []).append((line, value))
    return found


def _set_by(command: bytes) -> list[tuple[str, str]]:
    """Return the settings that a command changes, and to what."""
    named = _FAN.match(command) or _SET.match(command)
    if named is None:
        return []
    words = [(word.upper(), (a or b).decode("latin-1")) for word, a, b in _WORDS.findall(named[2])]
    if (code := named[1].upper()) in (b"106", b"107", b"126", b"127"):
        said = dict(words)
        fan = said.get(b"P", "").lstrip("0")
        speed = said.get(b"S", "255") if code in (b"106", b"126") else "0"
        with suppress(ValueError):  # a template's word is no number, and stays what it is
            speed = f"{float(speed):g}"
        return [(f"fan{fan and ' '}{fan}", speed)]
    of = b"".join(
        b" %s%s" % (word, value.encode("latin-1"))
        for word, value in words
        if word in _NAMES and code not in _NAMES_NONE
    )
    return [((code + of + b" " + word).decode("latin-1"), value) for word, value in words]


def _in_force(changes: list[tuple[int, str]], values: list[str], line: Ints) -> Ints:
    """Return which of the values holds at each line, (n,)."""
    number = {value: k for k, value in enumerate(values)}
    rows = np.array([0, *(row for row, _ in changes)], np.int64)
    held = np.array([0, *(number[value] for _, value in changes)], np.int64)
    return np.asarray(held[np.searchsorted(rows, line, side="left") - 1])
