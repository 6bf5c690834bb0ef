"""How a file hands over to its end G-code, against its source."""

from __future__ import annotations

from decmcts.formats.gcode.document import DESCRIBES, GcodeDocument, StateTable
from decmcts.formats.gcode.reading.reader import Ending

HOT_ENDS = ("temperature hotend",)  # how slots begin that say how hot tools are told to be
XYZ_MM = 1e-3
OVER_MM = 1.0  # above the print the head may stand when its end G-code begins


def ending_faults(document: GcodeDocument, ending: Ending, *, hot_ends: bool = True) -> list[str]:
    """Return how a file made from `document` reaches its end G-code otherwise than the source.

    End G-code relies on where the head is, what is retracted, and what is set; without `hot_ends`
    these may be told anything.
    """
    cursor, table, end = ending.cursor, ending.states, document.end
    faults = _place(ending, end.position)
    if abs(cursor.owed - end.owed) > XYZ_MM or cursor.firmware_retracted != end.firmware_retracted:
        faults.append(f"{cursor.owed:.3f} mm are retracted, in the source {end.owed:.3f}")
    if cursor.relative_e != end.relative_e or cursor.tool != end.tool:
        faults.append("the mode of E or the tool is another")
    if not end.relative_e and abs(cursor.e - end.e) > XYZ_MM:
        faults.append(f"E stands at {cursor.e:.5f}, in the source at {end.e:.5f}")
    but = () if hot_ends else HOT_ENDS
    ours, theirs = _commands(table, cursor.state, but), _commands(document.states, end.state, but)
    faults += [f"in force is '{a}'" for _, a in sorted(ours - theirs)]
    faults += [f"not in force is '{a}'" for _, a in sorted(theirs - ours)]
    return [f"before the end G-code {fault}" for fault in faults]


def _place(ending: Ending, place: tuple[float, float, float]) -> list[str]:
    """Return what is wrong with where the head is when it should be at, or above, `place`.

    On the print it may only stand where it has just laid the last bead.
    """
    at = ending.cursor.position
    if max(abs(a - b) for a, b in zip(at[:2], place[:2], strict=True)) > 2 * XYZ_MM:
        return [f"the head is at {at}, in the source at {place}"]
    just_laid = max(abs(a - b) for a, b in zip(at, ending.laid, strict=True)) <= 2 * XYZ_MM
    if just_laid and abs(at[2] - place[2]) <= 2 * XYZ_MM:
        return []
    if at[2] <= ending.top + XYZ_MM:
        return [f"the head comes down on the print at {at}, {ending.top:g} mm high"]
    highest = max(ending.top, place[2]) + OVER_MM
    return [f"the head is at {at}, above {highest:g} mm"] if at[2] > highest else []


def _commands(table: StateTable, state: int, but: tuple[str, ...]) -> set[tuple[str, str]]:
    """Return slot and text of all that commands something in a state, `but` some slots."""
    pairs = zip(table.slots, table.rows[state].tolist(), strict=True)
    return {(slot, table.values[v]) for slot, v in pairs if v and _counts(slot, but)}


def _counts(slot: str, but: tuple[str, ...]) -> bool:
    return slot not in DESCRIBES and not (but and slot.startswith(but))
