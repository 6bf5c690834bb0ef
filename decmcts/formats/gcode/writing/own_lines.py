"""Lines of a source as one head of several is told them: no unplanned moves, no other tools.

Of a source with several tools a head's controller gets temperatures of hot ends and moves of
filament alone only where they are of its own tool: the one they name, else the one selected.
Of temperatures that name none it may get more, see `decmcts.formats.gcode.writing.hot_ends`.
"""

from __future__ import annotations

import re

from decmcts.formats.gcode.dialects.stated_times import without_progress
from decmcts.formats.gcode.writing.hot_ends import OWN, Hears, hears, hot_end_command, selected_by
from decmcts.formats.gcode.writing.own_filament import E_WORD, FILAMENT, MOVE, relative_after

_HOMING = re.compile(rb"^\s*G2[89](?![0-9.])", re.I)
_FOR_TOOL = re.compile(
    rb"^(\s*(?!M0*(?:20[1-5]|593)(?![0-9.]))[MG]\d[^;]*?)(?:(?<!\s)\s++|(?<=[0-9.]))T(\d++)(?=[\s;A-Z(]|$)",
    re.I,
)


def own_lines(
    text: bytes,
    tool: int | None,
    *,
    selected: int | None,
    keep_homing: bool,
    relative_e: bool,
    newline: bytes,
    told: Hears = OWN,
    fed: bool = True,
) -> bytes:
    """Return lines as a head's controller needs them; what is left out stays as a comment.

    Parameters
    ----------
    tool : int | None
        What the head prints with; None: nothing.
    selected : int | None
        The tool in use above the lines; None: the source has one tool, or the head prints none.
    relative_e : bool
        How E counts above the lines.
    told : Hears
        Of temperatures that name no tool, which the head is told while another is selected.
    fed : bool
        Whether what moves filament alone is this head's.
    """
    kept: list[bytes] = []
    for line in without_progress(text):
        relative_e = relative_after(line, relative_e)
        others = selected is not None and selected != tool
        moves = MOVE.match(line) or (not keep_homing and _HOMING.match(line))
        if moves or ((others or not fed) and FILAMENT.match(line)):
            why = b"another head's tool" if others else b"another head's bead"
            why = b"heads share the bed" if moves else why
            kept.append(b"; left out, " + why + b": " + line)
            if (e := E_WORD.match(line)) and not relative_e:  # later E words count from here
                kept.append((b"" if line.endswith(b"\n") else newline) + b"G92 E" + e.group(1))
                kept.append(newline)
        elif (chosen := selected_by(line)) is not None:
            selected = None if selected is None else chosen
            kept.append(b"; left out, one tool: " + line)
        else:
            kept.append(_for_own_tool(line, tool, told if others else None))
    return b"".join(kept)


def _for_own_tool(line: bytes, tool: int | None, told: Hears | None) -> bytes:
    """Return a command without the tool it names, as a comment if that is another head's.

    `told` is given where another tool is selected.
    """
    named = _FOR_TOOL.match(line)
    if named and (tool is None or int(named.group(2)) == tool):
        return named.group(1) + line[named.end() :]
    if named or (told is not None and not hears(told, hot_end_command(line))):
        return b"; left out, another head's tool: " + line
    return line
