"""A safe order for a print whose source has none: layer by layer.

Parts that are printed one after the other may stand so near that the head hits the finished one
(`CollisionError`). Flat layers printed from the bottom to the top never stand in the way. The
source is written anew in that order, the file is judged against the source, and planned in its
place. So everything that follows starts from an order that is safe, and compares with it. Lines
are those of the source in all that is said.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from decmcts.arrays import Int32s
from decmcts.errors import InputError
from decmcts.feasibility.contacts import CollisionError
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.gcode import GcodeDocument, read_gcode, write_gcode
from decmcts.formats.gcode.controller.duration import print_time
from decmcts.formats.gcode.dialects.stated_times import restated
from decmcts.formats.mesh import is_mesh
from decmcts.planning.events import Report, Step
from decmcts.planning.options import Rules
from decmcts.planning.problem.first_check import SourceLines
from decmcts.planning.problem.print_problem import PrintProblem, parked_above, problem_of
from decmcts.planning.problem.slicing import SlicedFolder
from decmcts.planning.problem.source import Source
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import HeadActions
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.alone import lone_machine
from decmcts.team.schedule.joint_plan import schedule
from sim.files.temperatures import in_phases
from sim.files.written import verify_written

SAME_MM = 3  # decimals of heights that are one layer
ADVICE = (
    "print with more room between the objects, slice without printing them one by one, or take "
    "out of the file what stands in the way"
)


def safe_problem(
    source: Source, rules: Rules, report: Report, *, make_safe: bool = True
) -> PrintProblem:
    """Return the problem of a source, or of a safe order made of it where its own has none.

    Raises InputError when the machine cannot print it; where `make_safe` is False, also when its
    own order is not safe.
    """
    try:
        return problem_of(source, rules, report)
    except CollisionError as error:
        if not make_safe:
            raise InputError(
                error.what, path=error.path, line=error.line,
                advice="--make-safe prints it layer by layer instead, where that is safe",
            ) from error  # fmt: skip
        collision = error
    return problem_of(layer_by_layer(source, collision, report), rules, report)


def layer_by_layer(source: Source, collision: CollisionError, report: Report) -> Source:
    """Return the source in an order from the bottom to the top, within its barriers.

    Raises InputError when that order hits something too, or cannot be written.
    """
    report(Step("the source's own order would hit the part: writing it layer by layer"))
    job, contours = source.job, source.job.contours
    by_height = np.arange(len(contours)), np.round(contours.top, SAME_MM), contours.epoch
    order = np.lexsort(by_height).astype(np.int32)
    if (barrier := barrier_between(contours, source.document, order)) is not None:
        if (phases := in_phases(job, source.document)) is None:
            raise _no_order(source, collision, f"nothing may be moved across {barrier}")
        once = replace(source, job=phases[0], document=phases[1])
        return layer_by_layer(once, collision, report)
    alone = source.machine if len(source.machine.heads) == 1 else lone_machine(source.machine)
    machine = parked_above(alone, contours)
    found = rewritten(source, job, source.document, order, machine, times=True)
    if isinstance(found, str):
        raise _no_order(source, collision, found + _in_one_piece(contours))
    note = (
        f"the source's own order would hit the part (line {collision.line}: {collision.what}); "
        "it is printed layer by layer instead, and compared with that"
    )
    layered = replace(found.job, notes=(*found.job.notes, note))
    return replace(found, job=layered, original=source)


def barrier_between(contours: Contours, document: GcodeDocument, order: Int32s) -> str | None:
    """Return what an order goes down again behind; None where it never does.

    It goes down where a contour ends below the bottom of one before it, and that is so only
    behind a barrier.
    """
    bottom, top = contours.bottom[order], np.round(contours.top[order], SAME_MM)
    highest = np.maximum.accumulate(np.round(bottom, SAME_MM))
    down = np.flatnonzero(top[1:] < highest[:-1])
    if not len(down):
        return None
    k = int(down[0]) + 1
    low, high = int(contours.epoch[order[k - 1]]), int(contours.epoch[order[k]])
    for block in document.blocks:
        if low < block.epoch <= high:
            text = block.text.decode("utf-8", "replace").split(";", 1)[0].strip().split("\n")[0]
            return f"line {block.line}, {text} ({block.reason})"
    first = contours.line[contours.epoch == high].min()
    return f"line {first}, above which something is set that nothing has set before"


def rewritten(
    source: Source, job: PrintJob, document: GcodeDocument, order: Int32s,
    machine: Machine, *, times: bool = False,
) -> Source | str:  # fmt: skip
    """Write a source in an order, have that judged, and return it as it reads, or why it does not.

    `job` and `document` are the source as it is written: barriers may be others. `machine` has one
    head, which reaches all of it. With `times` those that the text states become the new order's.
    """
    folder = SlicedFolder()
    draft = folder.path / "anew.gcode"
    actions = write_order(job, document, order, machine, draft)
    if times and not is_mesh(Path(document.path)):
        limits, own = machine.limits, source.own_limits
        was = print_time(document.path, limits, own_limits=own, plate=source.plate)
        now = print_time(draft, limits, own_limits=own)
        if was.total_s > 0.0:
            draft.write_bytes(restated(draft.read_bytes(), now.total_s / was.total_s))
    verdict = verify_written(draft, source.job, source.document, machine, actions=actions)
    if not verdict.ok:
        lines = SourceLines.of(draft, source.job.contours.line[order])
        return lines.stated(str(verdict.faults[0]))
    anew, text = read_gcode(draft)
    if len(anew.contours) != len(order):
        return "what was written so reads as other contours"
    anew = replace(with_source_lines(anew, source.job, order), name=source.job.name)
    anew, text = with_epochs(anew, text, job.contours.epoch[order])
    return replace(source, job=anew, document=text, folder=folder, plate=None)


def write_order(
    job: PrintJob, document: GcodeDocument, order: Int32s, machine: Machine, draft: Path
) -> HeadActions:
    """Write a print in an order, whatever must come before what; returns its actions."""
    none = DependencyGraph.from_pairs(len(order), np.empty((0, 2), np.int32))
    plan = schedule(job, machine, none, [Toolpath.of(order, np.zeros(len(order), np.bool_))])
    write_gcode(document, job, plan.heads[0], draft)
    return plan.heads[0]


def with_source_lines(layered: PrintJob, source: PrintJob, order: Int32s) -> PrintJob:
    """Return what was read of the draft with the source's lines of contours and barriers."""
    line = {(barrier.text, barrier.reason): barrier.line for barrier in source.barriers}
    barriers = tuple(
        replace(barrier, line=line.get((barrier.text, barrier.reason), barrier.line))
        for barrier in layered.barriers
    )
    contours = replace(layered.contours, line=source.contours.line[order])
    return replace(layered, contours=contours, barriers=barriers)


def with_epochs(
    layered: PrintJob, document: GcodeDocument, own: Int32s
) -> tuple[PrintJob, GcodeDocument]:
    """Return what was read of the draft so that nothing crosses what it may not in the source.

    `own` are the epochs of the source, (n,) in the draft's order: never falling.
    """
    ours = layered.contours.epoch
    begins = (np.diff(ours, prepend=ours[:1]) != 0) | (np.diff(own, prepend=own[:1]) != 0)
    epoch = np.cumsum(begins).astype(np.int32)
    first = np.searchsorted(ours, np.arange(ours.max() + 1))
    anew = epoch[first].tolist()
    blocks = tuple(replace(block, epoch=anew[block.epoch]) for block in document.blocks)
    job = replace(
        layered, contours=replace(layered.contours, epoch=epoch),
        refills=tuple(anew[e] for e in layered.refills),
    )  # fmt: skip
    return job, replace(document, blocks=blocks)


def _in_one_piece(contours: Contours) -> str:
    """Return the words for the highest contour that climbs more than layers are apart, if any."""
    climb = contours.top - contours.bottom
    k = int(climb.argmax())
    if climb[k] <= contours.height.max():
        return ""
    return (
        f"; line {contours.line[k]} climbs from z {contours.bottom[k]:.3f} to "
        f"{contours.top[k]:.3f} mm in one piece, which no order splits"
    )


def _no_order(source: Source, collision: CollisionError, why: str) -> InputError:
    return InputError(
        f"{collision.what}; layer by layer it cannot be printed either: {why}",
        path=source.path,
        line=collision.line,
        advice=ADVICE,
    )
