"""Who is told how hot to be, where a source with several tools does not say which tool it means.

A temperature that names no tool is meant for the tool selected there, if every tool has a hot
end of its own. Where several filaments go through one hot end (MMU, AMS) it is meant for all:
the source heats once and changes filament. Such a source is known by a tool that prints without
having been heated, by name or while it was selected. Heads have a hot end each, so there all of
them are told.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from decmcts.errors import InputError
from decmcts.formats.gcode.controller.held import Targets
from decmcts.formats.gcode.controller.moves_kernels import LAST_TOOL
from decmcts.formats.gcode.dialects.dialect import Kind, classify
from decmcts.formats.gcode.document import GcodeDocument
from decmcts.formats.gcode.text.lines import command_of
from decmcts.print.job import PrintJob

# Who takes temperatures for the selected tool: its own head; all heads; or all, if it is to be off.
HeatTaken = Literal["own", "all", "off"]
OWN: HeatTaken = "own"

_COMMAND = re.compile(rb"^\s*M10([49])(?![0-9.])([^;(]*)", re.I)
_VALUE = re.compile(rb"[SR]\s*(\d+\.?\d*|\.\d+)", re.I)
_TOOL = re.compile(rb"(?:^|(?<=[\s0-9.]))T\s*(\d+)", re.I)
_BED = re.compile(rb"^\s*M1(?:40|90)(?![0-9.])([^;(]*)", re.I)
_MOVES = re.compile(rb"G0*(?:[0-3]|1[01](?!.*[PL]))(?![0-9.])", re.I)
EARLY = "; while other heads are set up"
HELD = (Kind.STATE, Kind.LAYER, Kind.LAYER_NOTE, Kind.LEAVE)  # what is in force goes with beads
_SELECT = re.compile(rb"^\s*T(\d+)(?=[\s;]|$)", re.I)


class HotEndCommand(NamedTuple):
    """A command that sets a hot end's temperature."""

    waits: bool  # M109: and goes on when it is reached
    heats: bool  # else it switches off
    tool: int | None  # that it names
    degrees: float | None = None  # None: the command has no number


class GivenCommand(NamedTuple):
    """A command to a hot end, in the lines above an epoch."""

    epoch: int
    tool: int  # named, or selected there
    named: bool
    command: HotEndCommand


class HotEndTarget:
    """How hot the hot end of a file of one tool is to be, as its lines go by."""

    def __init__(self) -> None:
        self._targets = Targets()

    def take(self, text: bytes) -> None:
        """Take lines of the file."""
        for row in text.splitlines():
            if (code := command_of(row)) and not _MOVES.match(code):
                event = classify(row)
                if event.kind == Kind.BARRIER:
                    self._targets.again(code.decode("utf-8", "replace"), event.text)

    @property
    def degrees(self) -> float | None:
        """How hot it is to be; None: not known, or off. A macro behind that may have heated it."""
        return self._targets.known.get(("hot end", "")) or None


def selected_by(line: bytes) -> int | None:
    """Return the tool a line selects; None: none."""
    match = _SELECT.match(line)
    return int(match[1]) if match and int(match[1]) <= LAST_TOOL else None


def hot_end_command(line: bytes) -> HotEndCommand | None:
    """Return what a line says to a hot end; None: nothing."""
    match = _COMMAND.match(line)
    if match is None:
        return None
    value, tool = _VALUE.search(match[2]), _TOOL.search(match[2])
    degrees = None if value is None else float(value[1])
    hot = degrees is None or degrees > 0.0
    return HotEndCommand(match[1] == b"9", hot, None if tool is None else int(tool[1]), degrees)


def heat_taken_by_heads(document: GcodeDocument, job: PrintJob) -> HeatTaken:
    """Return which temperatures that name no tool heads take: their own tool's, or all."""
    return "all" if _cold_tools(document, job) else OWN


def heats(text: bytes) -> bool:
    """Say whether some of these lines heat a hot end."""
    return any(command.heats for line in text.splitlines() if (command := hot_end_command(line)))


def early_heat(text: bytes) -> list[str]:
    """Return what heats bed and hot end, without waiting, as hot as these lines make them first.

    A head whose start code has to wait for other heads heats meanwhile.
    """
    lines = text.splitlines()
    of_bed = (_BED.match(line) for line in lines)
    bed = [match[1] for match in of_bed if match is not None]
    hot = [match[2] for line in lines if (match := _COMMAND.match(line)) is not None]
    early = []
    for code, found in (("M140", bed), ("M104", hot)):
        values = [value[1].decode() for words in found if (value := _VALUE.search(words))]
        first = next((value for value in values if float(value) > 0.0), None)
        early += [] if first is None else [f"{code} S{first} {EARLY}"]
    return early


def refuse_cold(document: GcodeDocument, job: PrintJob) -> None:
    """Raise InputError where some tool would print with a hot end nobody has waited for.

    That is where the source heats, but each command names another tool.
    """
    for tool, word in _cold_tools(document, job).items():
        first, above = _first_epoch(job, tool), _heated(document, waits=word == "M109")
        if not any(not given.named and given.epoch <= first for given in above):
            does = "waits for the heat of" if word == "M109" else "heats"
            raise InputError(
                f"the source never {does} tool {tool} before it prints with it, and its head has a "
                "hot end of its own",
                path=document.path,
                advice=f"add `{word} T{tool} S…` to the start G-code",
            )


def _cold_tools(document: GcodeDocument, job: PrintJob) -> dict[int, str]:
    """Return the tools that print unheated and the command they lack.

    A source that waits for heat above its first print has to wait for each tool, one that only
    heats has to heat each. None where nothing heats there: a macro may.
    """
    tools = np.unique(job.contours.tool).tolist()
    if not tools:
        return {}
    for waits in (True, False):
        above = _heated(document, waits=waits)
        if any(given.epoch <= job.contours.epoch.min() for given in above):
            word, first = "M109" if waits else "M104", {t: _first_epoch(job, t) for t in tools}
            heated = {each.tool for each in above if each.epoch <= first.get(each.tool, -1)}
            return {tool: word for tool in tools if tool not in heated}
    return {}


def _first_epoch(job: PrintJob, tool: int) -> int:
    return int(job.contours.epoch[job.contours.tool == tool].min())


def _heated(document: GcodeDocument, *, waits: bool) -> list[GivenCommand]:
    """Return where the source heats hot ends, or with `waits` where it waits for them."""
    given = hot_end_commands(document)
    return [each for each in given if each.command.heats and each.command.waits == waits]


def hot_end_commands(document: GcodeDocument) -> Iterator[GivenCommand]:
    """Yield the commands to hot ends above and between prints.

    Of those to one tool's head alone, behind the start code, what is for that tool, by name.
    """
    yield from hot_end_commands_in(document.preamble, 0)
    for own in document.own_starts:
        for given in hot_end_commands_in(own.text, own.selected):
            if own.tool == given.tool:
                yield given._replace(named=True)
    for block in document.blocks:
        yield from hot_end_commands_in(block.text, block.begin.tool, block.epoch)


def hot_end_commands_in(text: bytes, selected: int, epoch: int = 0) -> Iterator[GivenCommand]:
    """Yield the commands to hot ends of some lines, above which a tool is selected."""
    for line in text.splitlines():
        if (tool := selected_by(line)) is not None:
            selected = tool
        elif command := hot_end_command(line):
            tool = selected if command.tool is None else command.tool
            yield GivenCommand(epoch, tool, command.tool is not None, command)


def unknown_row(text: bytes, quiet: re.Pattern[bytes]) -> tuple[int, str] | None:
    """Return which line of a block does what is not known, from 0, and its command; None: none.

    Known are choices of tools, commands to hot ends, what is `quiet`, and what goes with beads.
    """
    for k, row in enumerate(text.split(b"\n")):
        code = command_of(row)
        known = selected_by(code) is not None or hot_end_command(code) or quiet.match(code)
        if code and not known and classify(row).kind not in (Kind.NOTHING, *HELD):
            return k, code[:40].decode("utf-8", "replace")
    return None
