"""What is in force at a line of a head's file, against what is due there in the source."""

from __future__ import annotations

from decmcts.formats.gcode.dialects.dialect import OF_TOOL
from decmcts.formats.gcode.document import DESCRIBES, SILENT, StateTable
from sim.files.settings import settings_of

Settings = frozenset[tuple[str, str]]  # what is set, and to what


def differing(
    ours: StateTable, row: int, theirs: StateTable, due: int, kept: Settings
) -> list[str]:
    """Return in words how a state in force differs from the state that is due.

    `kept` are settings of tools that may be in force as well (`kept_settings`).
    """
    return words_of(in_force(ours, row), in_force(theirs, due), kept)


def kept_settings(table: StateTable, row: int) -> Settings:
    """Return the settings of tools in a state, one by one.

    Where the source chooses another tool, nothing is known of that tool's until it is set. A
    head's file chooses none: what its start code, the source's own, has set stays in force.
    """
    texts = (text for slot, text in in_force(table, row) if slot in OF_TOOL)
    return frozenset(setting for text in texts for setting in _each_setting(text))


def words_of(has: set[tuple[str, str]], wanted: set[tuple[str, str]], kept: Settings) -> list[str]:
    """Return in words what is in force and what should be."""
    ours, due = dict(has - wanted), dict(wanted - has)
    for slot in OF_TOOL & ours.keys() & due.keys():
        mine, theirs = _each_setting(ours[slot]), _each_setting(due[slot])
        if theirs <= mine <= theirs | kept:
            del ours[slot], due[slot]
    words = [f"in force is '{text}'" for _, text in sorted(ours.items())]
    return words + [f"not in force is '{text}'" for _, text in sorted(due.items())]


def _each_setting(text: str) -> Settings:
    """Return what commands set, and to what, one by one."""
    found = settings_of(text.encode("utf-8", "surrogateescape"))
    return frozenset((name, lines[-1][1]) for name, lines in found.items())


def in_force(table: StateTable, row: int) -> set[tuple[str, str]]:
    """Return name and text of the states that command something and are not set by blocks alone."""
    pairs = zip(table.slots, table.rows[row].tolist(), strict=True)
    return {
        (slot, table.values[v])
        for slot, v in pairs
        if v and slot not in DESCRIBES and not slot.startswith(SILENT)
    }
