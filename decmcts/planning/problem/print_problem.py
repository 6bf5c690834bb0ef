"""What is to be planned: a print, the machine it is for, and what must come before what."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from decmcts.errors import InputError
from decmcts.feasibility.contacts import CollisionError, Contacts
from decmcts.feasibility.digest import problem_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.feasibility.rules import contacts_between, order_rules, with_contacts
from decmcts.formats.gcode import GcodeDocument
from decmcts.planning.events import Report, Step, unheard
from decmcts.planning.options import RULES, Cut, Freedom, Objective, Rules
from decmcts.planning.problem.source import Source, read
from decmcts.print.brief import brief
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.machine_fit import check_fits
from decmcts.search.sequence.pace import pace_of
from decmcts.search.sequence.problem import OrderProblem

PARK_ABOVE_MM = 5.0


@dataclass(frozen=True, slots=True)
class PrintProblem:
    """A source with the rules its order must keep."""

    source: Source
    job: PrintJob  # the source's, with notes on what planning leaves out
    machine: Machine  # the source's, with the limits that count and its park above the print
    graph: DependencyGraph
    rules: Rules
    seconds: dict[str, float]  # time of each step
    cut: Cut = Cut.NONE  # what was cut of it
    whole: PrintProblem | None = None  # the problem before contours were cut; None: none is
    weld_limit_s: float | None = None  # no weld of a cut may be older; None: any age will do

    __repr__ = brief("path", "machine.name", "graph", "rules", "cut")

    @property
    def path(self) -> Path:
        """The file it was read from."""
        return self.source.path

    @property
    def document(self) -> GcodeDocument:
        """The source's text."""
        return self.source.document

    @property
    def digest(self) -> str:
        """Digest that identifies contours, order constraints and machine."""
        return problem_digest(self.job.contours, self.graph, self.machine)

    @property
    def min_layer_time_s(self) -> float:
        """Least time before a spot is printed over, s; 0: no rule."""
        return self.rules.rule_s(self.job, self.machine)

    def for_one_head(self, objective: Objective) -> OrderProblem:
        """Return what a search for one head has to solve."""
        problem = OrderProblem.from_job(
            self.job,
            self.graph,
            self.rules.freedom.value,
            self.rules.seam.value,
        )
        timed = objective == Objective.TIME
        return replace(problem, pace=pace_of(self.job, self.machine.limits) if timed else None)


def load(path: Path, machine: str | Machine | None, rules: Rules = RULES) -> PrintProblem:
    """Read a print and find what must come before what."""
    return problem_of(read(path, machine), rules, unheard)


def problem_of(source: Source, rules: Rules, report: Report) -> PrintProblem:
    """Check that a source fits its machine and find what must come before what.

    With freedom `seam` the graph holds wherever loops are entered. Raises InputError when the
    machine cannot print it, or not in its own order.
    """
    job, machine, started = source.job, source.machine, time.perf_counter()
    if source.own_limits:
        machine = replace(machine, limits=machine.limits.under(job.limits))
    report(Step(f"dependency graph of {len(job.contours)} contours for {machine.name}"))
    with named(source.path):
        refuse_no_feed(job.contours)
        check_fits(job.contours, machine)
        machine = parked_above(machine, job.contours)
        free_seams = rules.freedom == Freedom.SEAM
        contacts = contacts_between(job, machine, free_seams=free_seams)
        job = with_contacts(job, contacts)
        graph = order_graph(job, machine, rules, contacts)
    seconds = {**dict(source.seconds), "graph": time.perf_counter() - started}
    return PrintProblem(source, job, machine, graph, rules, seconds)


def order_graph(
    job: PrintJob, machine: Machine, rules: Rules, contacts: Contacts
) -> DependencyGraph:
    """Return what must come before what by these rules; `contacts` are the job's."""
    return order_rules(
        job,
        machine,
        process_order=rules.process_order.value,
        quality=rules.holds(machine),
        free_seams=rules.freedom == Freedom.SEAM,
        max_layers_ahead=rules.max_layers_ahead,
        contacts=contacts,
    )


@contextmanager
def named(path: Path) -> Iterator[None]:
    """Add the file's name to an InputError raised in the body, which knows only its contours."""
    try:
        yield
    except InputError as error:
        kind = CollisionError if isinstance(error, CollisionError) else InputError
        raise kind(error.what, path=path, line=error.line, advice=error.advice) from error


def refuse_no_feed(contours: Contours) -> None:
    """Raise InputError where a bead has no feed: each firmware then takes another, or stops."""
    begins = np.zeros(len(contours.feed), np.bool_)
    begins[contours.offsets[:-1]] = True
    given = contours.feed > 0.0
    still = np.flatnonzero(~given & ~begins)
    if not len(still):
        return
    first = int(np.searchsorted(contours.offsets, still[0], side="right")) - 1
    what = "no feed (F) above 0 is given for this bead" if given.any() else "no feed is ever given"
    raise InputError(
        f"{what}, so how fast it is printed depends on the firmware",
        line=int(contours.line[first]) or None,
        advice="set F in mm/min on a move before it, such as G1 F1800",
    )


def parked_above(machine: Machine, contours: Contours) -> Machine:
    """Return the machine; if it has one head, with its park above the print.

    Where a single head rests before and after printing is up to the start and end G-code. The
    plan must only not let it rest inside the print.
    """
    if len(machine.heads) != 1 or not len(contours):
        return machine
    head = machine.heads[0]
    x, y, z = head.park
    above = float(contours.top.max()) + PARK_ABOVE_MM
    return replace(machine, heads=(replace(head, park=(x, y, max(z, above))),))
