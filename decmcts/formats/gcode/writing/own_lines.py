"""Lines of a source as one head of several is told them: no unplanned moves, no other tools.

Of a source with several tools a head's controller gets temperatures of hot ends and moves of
filament alone only where they are of its own tool: the one they name, else the one selected.
Of temperatures that name none it may get more, see `decmcts.formats.gcode.writing.hot_ends`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from decmcts.formats.gcode.controller.motion import interpret
from decmcts.formats.gcode.dialects.stated_times import without_progress
from decmcts.formats.gcode.text.lines import split_lines
from decmcts.formats.gcode.writing.hot_ends import OWN, Hears, hears, hot_end_command, selected_by

_MOVE = re.compile(rb"^\s*(?:N\d+\s*)?G0*[0123](?![0-9.])(?=[^;(]*[XYZIJ])", re.I)
_HOMING = re.compile(rb"^\s*G2[89](?![0-9.])", re.I)
_E_WORD = re.compile(rb"^[^;(]*?E\s*([-+]?[0-9.]+)", re.I)
_E_MODE = re.compile(rb"^\s*(?:N\d+\s*)?(M8[23]|G9[01])(?![0-9.])", re.I)
_SETS_E = re.compile(rb"^\s*(?:N\d+\s*)?G92(?![0-9.])[^;(]*E", re.I)
_FOR_TOOL = re.compile(
    rb"^(\s*(?!M0*(?:20[1-5]|593)(?![0-9.]))[MG]\d[^;]*?)(?:(?<!\s)\s++|(?<=[0-9.]))T(\d++)(?=[\s;A-Z(]|$)",
    re.I,
)
_FILAMENT = re.compile(
    rb"^\s*(?:N\d+\s*)?G0*(?:[01](?![0-9.])(?=[^;(]*E)|1[01](?![0-9.])(?![^;(]*L))", re.I
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
        relative_e = _relative_after(line, relative_e)
        others = selected is not None and selected != tool
        moves = _MOVE.match(line) or (not keep_homing and _HOMING.match(line))
        if moves or ((others or not fed) and _FILAMENT.match(line)):
            why = b"another head's tool" if others else b"another head's bead"
            why = b"heads share the bed" if moves else why
            kept.append(b"; left out, " + why + b": " + line)
            if (e := _E_WORD.match(line)) and not relative_e:  # later E words count from here
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


def pushed_by_moves(text: bytes, path: Path | str) -> float:
    """Return the filament, mm, that the moves of start code along an axis push: purge lines."""
    lines = split_lines(text, path)
    motion = interpret(lines)
    moves = [bool(_MOVE.match(lines.raw(line))) for line in motion.line.tolist()]
    return float(motion.extrusion[np.array(moves, np.bool_) & (motion.extrusion > 0.0)].sum())


def pushes(text: bytes) -> bool:
    """Tell whether some of these lines push or pull filament."""
    return any(map(_FILAMENT.match, text.splitlines()))


def owed_after(
    text: bytes, owed: float, *, e: float, relative_e: bool, e_area: float = 0.0
) -> float:
    """Return how much filament, mm, is retracted behind lines above which `owed` is.

    E stands at `e` there; it is in mm³ where it is volumetric, of filament of `e_area` mm².
    """
    for value, sets in _e_words(text, relative_e):
        if sets:
            e = value
            continue
        to = e + value if sets is None else value
        owed, e = max(0.0, owed - (to - e) / (e_area or 1.0)), to
    return owed


def _e_words(text: bytes, relative_e: bool) -> Iterator[tuple[float, bool | None]]:
    """Yield each E word: (where E is set, True), (where it goes, False), (by how much, None)."""
    for line in text.splitlines():
        relative_e = _relative_after(line, relative_e)
        word = _E_WORD.match(line)
        if word and _SETS_E.match(line):
            yield float(word.group(1)), True
        elif word and _FILAMENT.match(line):
            yield float(word.group(1)), None if relative_e else False


def _relative_after(line: bytes, relative_e: bool) -> bool:
    """Return how E counts after a line: M82, M83 and, as in Marlin, G90 and G91 say so."""
    mode = _E_MODE.match(line)
    return relative_e if mode is None else mode.group(1).upper() in (b"M83", b"G91")
