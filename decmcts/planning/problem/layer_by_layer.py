"""A safe order for a print whose source has none: layer by layer.

Parts that are printed one after the other may stand so near that the head hits the finished one
(`CollisionError`). Flat layers printed from the bottom to the top never stand in the way. The
source is written anew in that order, the file is judged against the source, and planned in its
place. So everything that follows starts from an order that is safe, and compares with it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from decmcts.errors import InputError
from decmcts.feasibility.contacts import CollisionError
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.gcode import read_gcode, write_gcode
from decmcts.formats.gcode.controller.duration import print_time
from decmcts.formats.gcode.dialects.stated_times import restated
from decmcts.formats.mesh import is_mesh
from decmcts.planning.events import Report, Step
from decmcts.planning.problem.print_problem import parked_above
from decmcts.planning.problem.slicing import SlicedFolder
from decmcts.planning.problem.source import Source
from decmcts.print.contours import Contours
from decmcts.print.toolpath import Toolpath
from decmcts.team.schedule.joint_plan import schedule
from sim.files.written import verify_written

SAME_MM = 3  # decimals of heights that are one layer


def layer_by_layer(source: Source, collision: CollisionError, report: Report) -> Source:
    """Return the source in an order from the bottom to the top, within its barriers.

    Raises
    ------
    InputError
        When that order hits something too, or cannot be written.
    """
    report(Step("the source's own order would hit the part: writing it layer by layer"))
    job, folder = source.job, SlicedFolder()
    order = bottom_up(job.contours)
    lone = parked_above(source.machine, job.contours)
    none = DependencyGraph.from_pairs(len(job.contours), np.empty((0, 2), np.int32))
    plan = schedule(job, lone, none, [Toolpath.of(order, np.zeros(len(order), np.bool_))])
    draft, actions = folder.path / "layers.gcode", plan.heads[0]
    write_gcode(source.document, job, actions, draft)
    if not is_mesh(Path(source.document.path)):
        limits, own = lone.limits, source.own_limits
        was = print_time(source.document.path, limits, own_limits=own, plate=source.plate)
        now = print_time(draft, limits, own_limits=own)
        if was.total_s > 0.0:
            draft.write_bytes(restated(draft.read_bytes(), now.total_s / was.total_s))
    verdict = verify_written(draft, job, source.document, lone, actions=actions)
    if not verdict.ok:
        raise _no_order(source, collision, verdict.shown)
    layered, document = read_gcode(draft)
    note = (
        f"the source's own order would hit the part: {collision.what}; "
        "printed layer by layer instead, and compared with that"
    )
    layered = replace(layered, name=job.name, notes=(*layered.notes, note))
    return replace(
        source, job=layered, document=document, folder=folder, original=source, plate=None
    )


def bottom_up(contours: Contours) -> np.ndarray[tuple[int], np.dtype[np.int32]]:
    """Return the contours by height of their tops, in the source's order where equal, (n,).

    Nothing crosses a barrier.
    """
    top = np.round(contours.top, SAME_MM)
    return np.lexsort((np.arange(len(contours)), top, contours.epoch)).astype(np.int32)


def _no_order(source: Source, collision: CollisionError, why: str) -> InputError:
    """Return the error for a print that cannot be printed layer by layer either."""
    barriers = [f"line {b.line}, {b.text} ({b.reason})" for b in source.job.barriers]
    walls = f"; nothing may be moved across {'; '.join(barriers[:3])}" if barriers else ""
    return InputError(
        f"{collision.what}; layer by layer it cannot be printed either ({why}){walls}",
        path=source.path,
        line=collision.line,
        advice="print with more room between objects, or slice without printing them one by one",
    )
