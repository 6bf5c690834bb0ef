"""The partial order of a joint plan: units, what each must wait for, what comes later.

Front of `carry_out_kernels` and `waits_kernels`: validates sequences and turns units into arrays.
Paths and exact times are `decmcts.team.schedule.joint_plan`'s.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decmcts.arrays import Flags, Floats
from decmcts.errors import InputError
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags, no_lags
from decmcts.print.loops import enter_at
from decmcts.print.machine import Machine
from decmcts.print.machine_fit import require_printable
from decmcts.print.toolpath import Toolpath, entries_by_contour
from decmcts.team.engine.carry_out_kernels import CONTRADICTED, SHUT_IN, Sequences, carry_out
from decmcts.team.engine.joint_kernels import PLACES, Units, Visits
from decmcts.team.engine.spaces_kernels import Fleet, cut_pieces
from decmcts.team.engine.waits_kernels import UnitOrder, find_waits, first_later

PIECE_MM = 4.0  # a contour's next piece begins where the space still needed has shrunk by this
MOST_PIECES = PLACES // 2  # of one contour


def visits_of(
    contours: Contours,
    graph: DependencyGraph,
    seconds: Floats,
    reversible: Flags,
    *,
    in_pieces: bool,
    lags: Lags | None = None,
) -> Visits:
    """Return what the kernels need to know of contours.

    Parameters
    ----------
    contours : Contours
        As they are entered.
    seconds : (heads, n) printing times
    reversible : (n,) contours that may be reversed, or that are
    in_pieces : bool
        Whether a print releases its reserved space piece by piece.
    lags : Lags | None
        How long what is below must cool; None: nothing has to.
    """
    pieces = cut_pieces(
        contours.points, contours.offsets, reversible, PIECE_MM, MOST_PIECES if in_pieces else 1
    )
    first, last = contours.points[contours.offsets[:-1]], contours.points[contours.offsets[1:] - 1]
    ends = np.stack([first, last], axis=1)
    cooling = no_lags(len(contours)) if lags is None else lags
    return Visits(ends, seconds, reversible, pieces, graph.pred_offsets, graph.preds, cooling)


def require_complete(
    job: PrintJob, machine: Machine, eligible: Flags, toolpaths: Sequence[Toolpath]
) -> None:
    """Raise InputError unless every contour is printed once, by a head that can."""
    if len(toolpaths) != len(machine.heads):
        raise InputError(
            f"{len(toolpaths)} toolpaths for the {len(machine.heads)} heads of {machine.name}"
        )
    require_printable(job.contours, machine, eligible)
    order = np.concatenate([toolpath.order for toolpath in toolpaths])
    counts = np.bincount(order, minlength=len(job.contours))
    wanted = np.arange(len(counts)) < len(job.contours)
    if (counts != wanted).any():
        wrong = int(np.flatnonzero(counts != wanted)[0])
        raise InputError(
            f"contour {wrong} is printed {counts[wrong]} times, expected {int(wanted[wrong])}"
        )
    for r, toolpath in enumerate(toolpaths):
        refused = toolpath.order[~eligible[toolpath.order, r]]
        if len(refused):
            raise InputError(
                f"head {machine.heads[r].name} can not print contour {int(refused[0])} "
                f"(tool, reach or no path past the others), {len(refused)} such in its toolpath"
            )


def sequences_of(toolpaths: Sequence[Toolpath]) -> Sequences:
    """Return the toolpaths as the kernels take them; turns are used if all of them have some."""
    order = np.concatenate([toolpath.order for toolpath in toolpaths]).astype(np.int32)
    is_reversed = np.concatenate([toolpath.reversed for toolpath in toolpaths]).astype(np.bool_)
    offsets = np.cumsum([0, *(len(toolpath) for toolpath in toolpaths)]).astype(np.int64)
    turns = [toolpath.turn for toolpath in toolpaths if toolpath.turn is not None]
    if len(turns) < len(toolpaths):
        turns = []
    return Sequences(order, is_reversed, offsets, np.concatenate([*turns, np.empty(0, np.int64)]))


def refuse(verdict: int, machine: Machine) -> None:
    """Raise InputError for a joint order that could not be completed."""
    if verdict == CONTRADICTED:
        raise InputError(
            "the heads' sequences contradict each other: no head can begin its next contour",
            advice="every contour must come after those that support it, on whatever head they are",
        )
    if verdict == SHUT_IN:
        raise InputError(
            f"the heads of {machine.name} shut each other in: one is parked where another passes",
            advice="move the parks so that each head can leave its own while all others are there",
        )


def visits_along(
    job: PrintJob, graph: DependencyGraph, machine: Machine, seconds: Floats,
    toolpaths: Sequence[Toolpath], lags: Lags | None,
) -> tuple[Contours, Visits]:  # fmt: skip
    """Return contours as toolpaths enter them, and what the kernels need to know of them then.

    `seconds` (heads, n) are printing times.
    """
    n = len(job.contours)
    is_reversed = np.zeros(n, np.bool_)
    for toolpath in toolpaths:
        is_reversed[toolpath.order] = toolpath.reversed
    entered = enter_at(job.contours, entries_by_contour(toolpaths, n))
    in_pieces = len(machine.heads) > 1 and machine.release == "point"
    visits = visits_of(entered, graph, seconds, is_reversed, in_pieces=in_pieces, lags=lags)
    return entered, visits


def units_of(visits: Visits, fleet: Fleet, machine: Machine, paths: Sequence[Toolpath]) -> Units:
    """Place everything in these toolpaths; raises InputError where that cannot be."""
    units, verdict = carry_out(sequences_of(paths), visits, fleet)
    refuse(verdict, machine)
    m = int(units.used[0])
    return units._replace(**{name: getattr(units, name)[:m] for name in Units._fields[:-1]})


def order_units(
    visits: Visits, fleet: Fleet, machine: Machine, toolpaths: Sequence[Toolpath]
) -> UnitOrder:
    """Return the partial order that sequences make; raises InputError where they make none."""
    units = units_of(visits, fleet, machine, toolpaths)
    waits = find_waits(visits, fleet, units)
    later = first_later(units.head, waits)
    return UnitOrder(units.head, units.kind, units.contour, units.target, *waits, later)
