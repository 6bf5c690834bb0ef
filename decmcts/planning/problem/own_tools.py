"""A source of several tools for heads that have one each: its changes of tools are no walls."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from decmcts.errors import InputError
from decmcts.feasibility.contacts import CollisionError
from decmcts.formats.gcode import GcodeDocument, read_gcode
from decmcts.formats.gcode.controller.moves_kernels import LAST_TOOL
from decmcts.formats.gcode.reading.without_tower import without_tower
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.formats.gcode.writing.own_tools import with_own_tools
from decmcts.formats.mesh import is_mesh
from decmcts.planning.events import Note, Report
from decmcts.planning.options import Rules
from decmcts.planning.problem.layer_by_layer import safe_problem
from decmcts.planning.problem.print_problem import PrintProblem, problem_of
from decmcts.planning.problem.source import Source
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.machine_fit import refuse_unknown_head
from sim.files.written import read_without_tower
from sim.heads.changes import as_planned


def team_problem(source: Source, rules: Rules, report: Report) -> PrintProblem:
    """Return the problem of a source for several heads.

    Changes of tools are walls only where they have to be, or where no order is safe without them.
    Raises InputError when the machine cannot print it.
    """
    if rules.without_tower:
        source = towerless(source)
    if one_tool_each(source.machine, source.job.contours):
        freed = with_own_tools(source.job, source.document)
        if isinstance(freed, str):
            report(Note(f"changes of tools stay places nothing is moved across: {freed}"))
        else:
            given = source.given or source
            free = replace(source, job=freed.job, document=freed.document, given=given)
            with suppress(CollisionError):
                return problem_of(free, rules, report)
    return safe_problem(source, rules, report)


def towerless(source: Source) -> Source:
    """Return the source without its wipe tower.

    Raises InputError where some head has several tools, which the tower is for, and where it has
    none.
    """
    if not one_tool_each(source.machine, source.job.contours):
        raise InputError(
            "a wipe tower is left out only where a print has several tools and each head one",
            path=source.path,
            advice="state each head's tool: --tool HEAD=N, or `tools` in the machine file",
        )  # fmt: skip
    text, moves = b"", 0
    if not is_mesh(source.path):
        text, moves = without_tower(load_text(source.path, source.plate), source.path)
    if not moves:
        raise InputError(
            "the source has no wipe tower that could be left out", path=source.path,
            advice="take --without-tower away",
        )  # fmt: skip
    job, document = read_gcode(source.path, source.plate, text=text)
    note = f"the wipe tower is left out, as asked ({moves} moves)"
    job = replace(job, notes=(*job.notes, note))
    return replace(source, job=job, document=document, given=source, towerless=True)


def with_tools(machine: Machine, stated: Sequence[str]) -> Machine:
    """Return the machine with tools of its heads as stated, each ``HEAD=N``: its one tool.

    Heads that are not named keep theirs. Raises InputError for heads the machine has not, heads
    named twice, and numbers that are none.
    """
    found = dict[str, int]()
    for text in stated:
        name, _, number = text.partition("=")
        refuse_unknown_head("--tool", text, name, machine)
        if name in found:
            raise InputError(
                f"--tool {text}: head {name} has tool {found[name]} already",
                advice="a head of several prints with one tool",
            )
        if not (number.isascii() and number.isdigit() and int(number) <= LAST_TOOL):
            raise InputError(
                f"--tool {text}: {number!r} is no tool",
                advice=f"give its number in the source, 0 to {LAST_TOOL}: --tool {name}=0",
            )
        found[name] = int(number)
    heads = [
        replace(head, tools=(found[head.name],)) if head.name in found else head
        for head in machine.heads
    ]
    return replace(machine, heads=tuple(heads))


def one_tool_each(machine: Machine, contours: Contours) -> bool:
    """Tell whether a print has several tools and each head of a machine one of them at most."""
    tools = set(np.unique(contours.tool).tolist())
    return len(tools) > 1 and all(
        head.tools and len(tools.intersection(head.tools)) < 2 for head in machine.heads
    )


def for_the_judge(problem: PrintProblem) -> tuple[PrintJob, GcodeDocument]:
    """Return the source as the judge takes it: what changes of tools are no walls it finds anew.

    Its contours are whole.
    """
    problem = problem.whole or problem
    given = problem.source.given
    if given is None or problem.source.original is not None:  # a safe order has other numbers
        return problem.job, problem.document
    read = given.job, given.document
    if problem.source.towerless:
        read = read_without_tower(given.document, given.plate)
    return as_planned(problem.job.contours.epoch, problem.machine, *read)
