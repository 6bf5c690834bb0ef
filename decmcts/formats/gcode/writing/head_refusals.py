"""What a source must not hold where several heads print it, nor a plan ask of them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import count

import numpy as np

from decmcts.errors import InputError
from decmcts.formats.gcode.document import GcodeDocument
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.gcode.writing.hot_ends import refuse_cold
from decmcts.formats.gcode.writing.own_lines import pushed_by_moves
from decmcts.formats.gcode.writing.sync_points import SyncPoints
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine, SyncWords, pattern_of
from decmcts.print.plan import ActionKind, HeadActions, JointPlan

PRIMES_MM = 0.1  # of filament; less primes nothing
_MOVES_ALONE = ("homing", "bed probing", "unknown macro", "filament change")
_NAMED_STATE = re.compile(r"M(221|900)(?= ).* T\d", re.I)
_NAMED_DRIVE = re.compile(r"(M572(?= ).* D\d|SET_PRESSURE_ADVANCE .*EXTRUDER)", re.I)
_ORIGIN = re.compile(rb"^[ \t]*+(?:N\d++[ \t]*+)?G92(?![0-9.])[^;(\n]*[XYZ][^\n]*", re.I | re.M)


def refuse_for_heads(document: GcodeDocument, job: PrintJob, machine: Machine) -> None:
    """Raise InputError where no files of several heads can be written, whatever the plan.

    So before any plan: moves of the source's own, lines that would be read as sync points, heads
    that may print with more than one tool of the source, and tools that would print cold.
    """
    _refuse_words(document, machine.words)
    refuse_own_moves(document, job)
    tools = np.unique(job.contours.tool).tolist()
    _refuse_named_states(document, tools)
    for head in machine.heads:
        _refuse_tools(document, head.name, [t for t in tools if not head.tools or t in head.tools])
    refuse_cold(document, job)


def unprimed_note(document: GcodeDocument) -> str | None:
    """Return the line to say where start code primes the nozzle by moves, which are left out."""
    pushed = pushed_by_moves(document.preamble, document.path)
    if pushed < PRIMES_MM:
        return None
    return (
        f"the source's start code extrudes {pushed:.1f} mm of filament on the bed; heads share the "
        "bed, so it is left out: prime each head before its file is run, or in the start code by "
        "E alone"
    )


def only_tool(document: GcodeDocument, job: PrintJob, head: HeadActions) -> int | None:
    """Return the tool a head prints with; None when it prints nothing."""
    printed = head.contour[head.kind == ActionKind.PRINT]
    tools = np.unique(job.contours.tool[printed]).tolist()
    _refuse_tools(document, head.head, tools)
    return int(tools[0]) if tools else None


def _refuse_tools(document: GcodeDocument, head: str, tools: list[int]) -> None:
    if len(tools) > 1:
        raise InputError(
            f"head {head} would print with tools {', '.join(map(str, tools))}; a head of "
            "several has one tool",
            path=document.path,
            advice=f"state the tool of each head: --tool {head}={tools[0]} …, "
            "or `tools` in the machine file",
        )


def _refuse_named_states(document: GcodeDocument, tools: list[int]) -> None:
    """Raise InputError for what sets a state of a tool by its name: a head has but one.

    The name of its drive may stand in the start code, which all heads have, and may be that of a
    lone tool 0: this is the tool in use in a file that chooses none.
    """
    texts = [text for text in document.states.values if _NAMED_STATE.match(text)]
    if tools != [0]:
        texts += [text for text in _changing(document) if _NAMED_DRIVE.match(text)]
    if texts:
        raise InputError(
            f"'{texts[0]}' names the tool whose setting it is, and a head of several has one",
            path=document.path,
            line=_line_of(document, texts[0]),
            advice="leave it out, or the word that names the tool",
        )


def _changing(document: GcodeDocument) -> Iterator[str]:
    """Yield what is in force at beads where the start code has left something else."""
    states = document.states
    used = states.rows[np.unique(document.point_state)]
    for column, begun in zip(used.T, states.rows[document.start.state], strict=True):
        texts = {states.values[value] for value in column.tolist()}
        yield from sorted(texts - {states.values[begun]})


def _line_of(document: GcodeDocument, text: str) -> int | None:
    """Return the first line of the source that begins with a text, from 1."""
    source = document.text or load_text(document.path, document.plate)
    rows = enumerate(source.decode("utf-8", "surrogateescape").splitlines(), 1)
    return next((k for k, row in rows if row.startswith(text)), None)


def refuse_own_moves(document: GcodeDocument, job: PrintJob) -> None:
    """Raise InputError for lines that may move a head where no plan looked."""
    for barrier in job.barriers:
        if barrier.reason in _MOVES_ALONE:
            raise InputError(
                f"'{barrier.text}' ({barrier.reason}) may move the head while another prints",
                path=document.path,
                line=barrier.line,
                advice="remove it from the slicer's custom G-code, or print with one head "
                "(`decmcts plan`)",
            )
    if place := _ORIGIN.search(document.preamble):
        text = place.group(0).decode("utf-8", "replace").strip()
        raise InputError(
            f"'{text}' sets a position that moves left out of a head's file have led to",
            path=document.path,
            advice="remove it from the start G-code, or print with one head (`decmcts plan`)",
        )


def refuse_points(points: SyncPoints, plan: JointPlan) -> None:
    """Raise InputError for signals in motion, which the machine's controllers cannot give."""
    for h, action in points.passed:
        raise InputError(
            f"head {plan.heads[h].head} would have to signal within action {action}, "
            "in motion, and the machine's controllers only do so at rest",
            advice='plan for its release "action", or set release = "point" in the machine file',
        )


def _refuse_words(document: GcodeDocument, words: SyncWords) -> None:
    """Raise InputError where a source has a line with which heads' files signal or wait."""
    patterns = [re.compile(pattern_of(line)) for line in (words.signal, words.passed, words.wait)]
    for row, line in _own_rows(document):
        code = " ".join(row.split(";", 1)[0].split())
        if any(pattern.fullmatch(code) for pattern in patterns):
            raise InputError(
                f"'{code}' is a line with which heads' files signal or wait",
                path=document.path,
                line=line,
                advice="remove it from the custom G-code, or give the machine other `words`",
            )


def _own_rows(document: GcodeDocument) -> Iterator[tuple[str, int | None]]:
    """Yield what of a source stands in files as it is, with its line (from 1) where known."""
    parts = [(document.preamble, 1), *((block.text, block.line) for block in document.blocks)]
    for text, first in parts:
        yield from zip(_rows(text), count(first), strict=False)
    yield from ((row, None) for row in (*_rows(document.postamble), *document.states.values))


def _rows(text: bytes) -> list[str]:
    return text.decode("utf-8", "surrogateescape").split("\n")
