"""A source of several tools for heads that have one each: its changes of tools are no walls."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from decmcts.feasibility.contacts import CollisionError
from decmcts.formats.gcode import GcodeDocument
from decmcts.formats.gcode.writing.own_tools import with_own_tools
from decmcts.planning.events import Note, Report
from decmcts.planning.options import Rules
from decmcts.planning.problem.layer_by_layer import safe_problem
from decmcts.planning.problem.print_problem import PrintProblem, problem_of
from decmcts.planning.problem.source import Source
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from sim.heads.changes import as_planned


def team_problem(source: Source, rules: Rules, report: Report) -> PrintProblem:
    """Return the problem of a source for several heads.

    Changes of tools are walls only where they have to be, or where no order is safe without them.

    Raises
    ------
    InputError
        When the machine cannot print it.
    """
    free = unwalled(source, report)
    if free is not source:
        with suppress(CollisionError):
            return problem_of(free, rules, report)
    return safe_problem(source, rules, report)


def unwalled(source: Source, report: Report) -> Source:
    """Return the source without the changes of tools that its heads need not make.

    As it stands where it has one tool, where some head has several of its tools, and where no
    change is understood; the report is told why.
    """
    if not one_tool_each(source.machine, source.job.contours):
        return source
    freed = with_own_tools(source.job, source.document)
    if isinstance(freed, str):
        report(Note(f"changes of tools stay places nothing is moved across: {freed}"))
        return source
    return replace(source, job=freed.job, document=freed.document, walled=source)


def one_tool_each(machine: Machine, contours: Contours) -> bool:
    """Tell whether a print has several tools and each head of a machine one of them at most."""
    tools = set(np.unique(contours.tool).tolist())
    return len(tools) > 1 and all(
        head.tools and len(tools.intersection(head.tools)) < 2 for head in machine.heads
    )


def for_the_judge(problem: PrintProblem) -> tuple[PrintJob, GcodeDocument]:
    """Return the source as the judge takes it: what changes of tools are no walls it finds anew."""
    walled = problem.source.walled
    if walled is None:
        return problem.job, problem.document
    return as_planned(problem.job.contours.epoch, walled.job, walled.document)
