"""The problem a team of heads plans: print, machine, graph, and what is derived from them.

Immutable; every agent builds it from the same inputs and compares the digest
before it talks.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.feasibility.digest import DIGEST_BYTES, ROUND_TO, problem_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.kinematics import line_up
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.machine_fit import require_printable
from decmcts.search.bounds.chains_kernels import chain_behind
from decmcts.team.engine.bottleneck import bottleneck
from decmcts.team.engine.dispatch_kernels import KeyTerms
from decmcts.team.engine.joint_kernels import Visits
from decmcts.team.engine.macros import columns_of, cut_macros, part_of, part_progress
from decmcts.team.engine.order import visits_of
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.space import (
    Workspaces,
    build_space,
    fleet_of,
    printing_times,
)
from decmcts.team.engine.spaces_kernels import Fleet
from decmcts.team.engine.start import StartingOrder, start_of


@dataclass(frozen=True, slots=True)
class TeamProblem:
    """What agents plan; build it with `build_team_problem`."""

    job: PrintJob
    machine: Machine
    graph: DependencyGraph
    space: Workspaces
    fleet: Fleet
    visits: Visits  # as sliced
    row: NDArray[np.int64]  # (heads,) in which they stand, lowest first (`line_up`)
    quantile: NDArray[np.float64]  # (n,) share of all work at lower places along that axis, 0..1
    progress: NDArray[np.float64]  # (n,) share of its part's work before it
    urgency: NDArray[np.float64]  # (n,) 0: the longest chain comes after it, 1: nothing does
    bottleneck: NDArray[np.bool_]  # (n,) see decmcts.team.engine.bottleneck
    part: NDArray[np.int64]  # (n,) connected footprint
    column_offsets: NDArray[np.int64]  # (columns + 1,) see decmcts.team.engine.dispatch_kernels
    column: NDArray[np.int32]  # (n,)
    macro: NDArray[np.int32]  # (n,) macro-action of each contour, numbered by progress
    macro_part: NDArray[np.int64]  # (n_macros,)
    n_macros: int
    digest: str
    start: StartingOrder | None = None  # an order that heads begin with
    # of teams of some heads only, as `decmcts.team.engine.resolve.fleet_for` finds them
    fleets: dict[tuple[int, ...], tuple[Fleet, NDArray[np.bool_]]] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    @property
    def head_names(self) -> tuple[str, ...]:
        """Names of the heads, in the machine's order."""
        return tuple(head.name for head in self.machine.heads)

    def side_of(self) -> NDArray[np.int64]:
        """Return the head in whose share of the machine each contour lies, (n,)."""
        heads = len(self.machine.heads)
        return self.row[np.minimum((self.quantile * heads).astype(np.int64), heads - 1)]

    def key_terms(self) -> KeyTerms:
        """Return what a policy makes its keys of."""
        return KeyTerms(self.progress, self.urgency, self.side_of(), self.bottleneck)

    def places(self) -> NDArray[np.float64]:
        """Return where each contour comes in each head's sweep, 0..1, (heads, n).

        Heads are in step where their places are equal; then they stay a share of the machine
        apart.
        """
        heads = len(self.machine.heads)
        place = np.argsort(self.row)
        return np.clip(self.quantile[None] * heads - place[:, None], 0.0, 1.0)


def build_team_problem(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    lags: Lags | None = None,
    start: StatedOrder | None = None,
) -> TeamProblem:
    """Return the problem of printing `job` with all heads of `machine`.

    `lags` say how long what is printed over must cool; None: nothing has to. `start` is a joint
    order to begin with.

    Raises
    ------
    InputError
        If no head may print some contour.
    """
    if graph.n != len(job.contours):
        raise InputError(f"the graph has {graph.n} contours, the print {len(job.contours)}")
    contours = job.contours
    space = build_space(job, machine)
    require_printable(contours, machine, space.eligible)
    by_head = printing_times(job, machine)
    seconds = by_head.min(axis=0, initial=np.inf)
    reversible = contours.reversible & ~contours.closed
    visits = visits_of(
        contours, graph, by_head, reversible, in_pieces=machine.release == "point", lags=lags
    )
    axis, row = line_up(machine)
    quantile = _quantile(seconds, space, axis)
    part = part_of(contours)
    progress = part_progress(seconds, part)
    side = np.minimum((quantile * len(machine.heads)).astype(np.int64), len(machine.heads) - 1)
    macro = cut_macros(seconds, part, progress, side)
    column_offsets, column = columns_of(space.boxes, part, axis)
    begun = None
    if start is not None:
        middle = space.boxes[:, 2 * axis : 2 * axis + 2].mean(axis=1)
        begun = start_of(start, contours.layer.astype(np.int64), middle, seconds)
    return TeamProblem(
        job=job,
        machine=machine,
        graph=graph,
        space=space,
        fleet=fleet_of(job, machine),
        visits=visits,
        row=np.array(row, np.int64),
        quantile=quantile,
        progress=progress,
        urgency=_urgency(seconds, graph),
        bottleneck=bottleneck(space.boxes, seconds, machine),
        part=part,
        column_offsets=column_offsets,
        column=column,
        macro=macro,
        macro_part=_first_of(macro, part),
        n_macros=int(macro.max(initial=-1)) + 1,
        digest=_with_start(_with_lags(problem_digest(contours, graph, machine), lags), start),
        start=begun,
    )


def _with_lags(digest: str, lags: Lags | None) -> str:
    """Return a problem's digest with what must cool in it; as it is where nothing has to."""
    if lags is None or not len(lags.below):
        return digest
    state = blake2b(bytes.fromhex(digest), digest_size=DIGEST_BYTES, person=b"decmcts-lags-1")
    state.update(lags.offsets.astype("<i8").tobytes())
    state.update(lags.below.astype("<i8").tobytes())
    state.update(np.round(lags.seconds / ROUND_TO).astype("<i8").tobytes())
    return state.hexdigest()


def _with_start(digest: str, start: StatedOrder | None) -> str:
    """Return a problem's digest with the order heads begin with in it."""
    if start is None:
        return digest
    state = blake2b(bytes.fromhex(digest), digest_size=DIGEST_BYTES, person=b"decmcts-start-1")
    for row in (start.order, start.reversed, start.head):
        state.update(row.astype("<i8").tobytes())
    return state.hexdigest()


def _first_of(macro: NDArray[np.int32], part: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the part of each macro-action, which lies within one part."""
    return part[np.unique(macro, return_index=True)[1]]


def _urgency(seconds: NDArray[np.float64], graph: DependencyGraph) -> NDArray[np.float64]:
    behind = chain_behind(seconds, graph.succ_offsets, graph.succs)
    return np.asarray(1.0 - behind / max(float(behind.max(initial=0.0)), 1e-12))


def _quantile(seconds: NDArray[np.float64], space: Workspaces, axis: int) -> NDArray[np.float64]:
    """Return the share of all work that lies at lower places along an axis, (n,)."""
    middle = space.boxes[:, 2 * axis] + space.boxes[:, 2 * axis + 1]
    order = np.argsort(middle, kind="stable")
    work = seconds[order]
    quantile = np.empty(len(seconds))
    quantile[order] = (np.cumsum(work) - work / 2) / max(float(work.sum()), 1e-12)
    return quantile
