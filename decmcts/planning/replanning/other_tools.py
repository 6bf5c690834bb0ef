"""Which tools print for others whose heads print no more, as a person allows.

It is another filament: said plainly, and refused where the file says that it does not fit.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from decmcts.errors import InputError
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.planning.problem.own_tools import one_tool_each
from decmcts.planning.problem.source import Source
from decmcts.print.contours import Contours
from decmcts.print.machine import Head, Machine

OPTION = "--print-with"
_PAIR = re.compile(r"([0-9]{1,4})=([0-9]{1,4})", re.ASCII)
_STATED = re.compile(
    rb"^[;#][ \t]*(filament_diameter|nozzle_diameter|extrusion_multiplier|filament_flow_ratio|"
    rb"filament_type)[ \t]*=[ \t]*([^\r\n]*)", re.M,
)  # fmt: skip
_DIAMETER = "filament_diameter"
_NOTES = {
    "nozzle_diameter": "nozzle", "extrusion_multiplier": "flow", "filament_flow_ratio": "flow",
    "filament_type": "filament",
}  # fmt: skip


def other_tools(stated: Sequence[str], machine: Machine, contours: Contours) -> dict[int, int]:
    """Return tools and those that print for them, by ``TOOL=OTHER``.

    Raises
    ------
    InputError
        For what is no pair of tools of the print, chains, and where heads have not one tool each.
    """
    pairs = dict[int, int]()
    for text in stated:
        match = _PAIR.fullmatch(text)
        if match is None:
            raise _refused(text, "it is no pair of tools", "give two numbers, as in 0=1")
        due, has = int(match[1]), int(match[2])
        if pairs.get(due, has) != has:
            raise _refused(text, f"tool {pairs[due]} prints for tool {due} already", "name one")
        pairs[due] = has
    for due, has in pairs.items():
        _refuse_pair(f"{due}={has}", due, has, machine, contours)
        if has in pairs:
            what = f"tool {has} does not print itself: {has}={pairs[has]}"
            raise _refused(f"{due}={has}", what, "name tools that print")
    return dict(sorted(pairs.items()))


def _refuse_pair(text: str, due: int, has: int, machine: Machine, contours: Contours) -> None:
    tools = np.unique(contours.tool).tolist()
    named = ", ".join(map(str, tools))
    if due == has:
        raise _refused(text, "it is one tool", "name another")
    if len(tools) < 2:
        raise _refused(text, f"the print has one tool, {named}", "any head may print it")
    for tool in (due, has):
        if tool not in tools:
            raise _refused(text, f"the print has no tool {tool}", f"its tools are {named}")
    if not one_tool_each(machine, contours):
        what = f"the heads of {machine.name} have not one tool each"
        raise _refused(text, what, "give each head its `tools` in the machine file")


def _refused(text: str, what: str, advice: str) -> InputError:
    return InputError(f"{OPTION} {text}: {what}", advice=advice)


def refuse_unfit(other: Mapping[int, int], machine: Machine, gone: Sequence[str]) -> None:
    """Raise InputError unless other tools' heads print, and those print no more that they are for.

    Parameters
    ----------
    gone : Sequence[str]
        Heads of the machine that print no more.
    """
    for due, has in other.items():
        text = f"{due}={has}"
        living = [head for head in machine.heads if head.name not in gone]
        if (head := _head_of(living, due)) is not None:
            advice = f"name it with --fenced {head} if it prints no more"
            raise _refused(text, f"head {head} has tool {due} and lives", advice)
        if _head_of(living, has) is None:
            advice = f"the heads that live are {', '.join(each.name for each in living)}"
            raise _refused(text, f"no head that lives has tool {has}", advice)


def _head_of(heads: Sequence[Head], tool: int) -> str | None:
    return next((head.name for head in heads if tool in head.tools), None)


def needed(other: Mapping[int, int], machine: Machine, contours: Contours) -> dict[int, int]:
    """Return those pairs of which no living head has the one tool, and some has the other.

    `machine` is that of the heads that live.
    """
    tools = np.unique(contours.tool).tolist()
    has = {tool for head in machine.heads for tool in head.tools}
    return {a: b for a, b in other.items() if a in tools and a not in has and b in has}


def differences(source: Source, other: Mapping[int, int]) -> list[str]:
    """Return in words what the source's file says to be another with these tools.

    Raises
    ------
    InputError
        Where their filaments differ in diameter: so much of E is another amount then.
    """
    stated = _stated(load_text(source.path, source.plate))
    found = list[str]()
    for due, has in other.items():
        for key, values in stated.items():
            if max(due, has) >= len(values) or values[due] == values[has]:
                continue
            if key == _DIAMETER:
                raise InputError(
                    f"{OPTION} {due}={has}: filament of tool {due} is {values[due]} mm thick, of "
                    f"tool {has} {values[has]} mm, so as much of it is another amount",
                    path=source.path,
                )
            found.append(
                f"tool {has} has another {_NOTES[key]} ({values[has]}) than tool {due} "
                f"({values[due]})"
            )
    return found


def _stated(text: bytes) -> dict[str, list[str]]:
    """Return what a slicer states of each tool, by its name for it, the last time it does."""
    found = dict[str, list[str]]()
    for key, value in _STATED.findall(text):
        each = re.split(r"[,;]", value.decode("utf-8", "replace"))
        found[key.decode()] = [one.strip().strip('"') for one in each]
    return found
