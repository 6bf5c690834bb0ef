"""The problem a team of heads plans: print, machine, graph, and what is derived from them.

Immutable; every agent builds it from the same inputs and compares the digest
before it talks.

**Macro-actions** are what a head's plan is made of. A part is a connected footprint on the bed.
Each part's work is cut into chunks, in source order. Each chunk is cut again by the heads' shares
of the machine in which its contours lie; such a piece is a macro-action. A plan says how much later
than usual each macro-action comes, so plans stay short and messages small.

**Bottleneck.** Heads on one rail keep a separation, so in a window as wide as m separations at most
m heads can print. The bottleneck is the window with the most work for each of its m heads. Whenever
fewer than m heads print there, the whole print ends later (`decmcts.team.bounds.makespan` has the
proof).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.errors import InputError
from decmcts.feasibility.digest import DIGEST_BYTES, ROUND_TO, problem_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.kinematics import fixed_order, line_up
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.machine_fit import require_printable
from decmcts.search.bounds.chains_kernels import chain_behind
from decmcts.team.engine.dispatch_kernels import KeyTerms
from decmcts.team.engine.joint_kernels import Visits
from decmcts.team.engine.order import visits_of
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.space import Workspaces, build_space, fleet_of, printing_times
from decmcts.team.engine.spaces_kernels import Fleet
from decmcts.team.engine.start import StartingOrder, start_of


def bottleneck(boxes: Floats, seconds: Floats, machine: Machine) -> Flags:
    """Return which contours lie in the bottleneck, (n,); none where heads stand in no fixed order.

    Parameters
    ----------
    boxes : (n, 4) min x, max x, min y, max y of each contour, mm
    seconds : (n,) printing times
    """
    row = fixed_order(machine)
    inside, most = np.zeros(len(seconds), np.bool_), 0.0
    if row is None or not len(seconds):
        return inside
    low, high = boxes[:, 2 * row.axis], boxes[:, 2 * row.axis + 1]
    for heads in range(1, len(machine.heads)):
        width = heads * row.apart_mm
        begin, work = _fullest(low - width, high, seconds)
        if work / heads > most:
            most, inside = work / heads, (low - width < begin) & (begin < high)
    return inside


def _fullest(low: Floats, high: Floats, work: Floats) -> tuple[float, float]:
    """Return the place in most of the open intervals `low` to `high`, by work, and that work."""
    origin = low.min()
    cells = int((high.max() - origin) / CELL_MM) + 2
    first = np.floor((low - origin) / CELL_MM).astype(np.int64) + 1
    end = np.ceil((high - origin) / CELL_MM).astype(np.int64)
    change = np.bincount(first, work, cells + 1) - np.bincount(end, work, cells + 1)
    sums = np.cumsum(change)
    best = int(np.argmax(sums))
    return float(origin + best * CELL_MM), float(sums[best])


@dataclass(frozen=True, slots=True)
class TeamProblem:
    """What agents plan; build it with `build_team_problem`."""

    job: PrintJob
    machine: Machine
    graph: DependencyGraph
    space: Workspaces
    fleet: Fleet
    visits: Visits  # as sliced
    row: Ints  # (heads,) in which they stand, lowest first (`line_up`)
    quantile: Floats  # (n,) share of all work at lower places along that axis, 0..1
    key_terms: KeyTerms  # what a policy makes its keys of
    part: Ints  # (n,) connected footprint
    column_offsets: Ints  # (columns + 1,) see decmcts.team.engine.dispatch_kernels
    column: Int32s  # (n,)
    macro: Int32s  # (n,) macro-action of each contour, numbered by progress
    macro_part: Ints  # (n_macros,)
    n_macros: int
    digest: str
    start: StartingOrder | None = None  # an order that heads begin with
    # of teams of some heads only, as `decmcts.team.engine.resolve.fleet_for` finds them
    fleets: dict[tuple[int, ...], tuple[Fleet, Flags]] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    @property
    def head_names(self) -> tuple[str, ...]:
        """Names of the heads, in the machine's order."""
        return tuple(head.name for head in self.machine.heads)

    def places(self) -> Floats:
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
    axis, heads_in_row = line_up(machine)
    row = np.array(heads_in_row, np.int64)
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
        row=row,
        quantile=quantile,
        key_terms=KeyTerms(
            progress, _urgency(seconds, graph), row[side], bottleneck(space.boxes, seconds, machine)
        ),
        part=part,
        column_offsets=column_offsets,
        column=column,
        macro=macro,
        macro_part=part[np.unique(macro, return_index=True)[1]],  # each lies within one part
        n_macros=int(macro.max(initial=-1)) + 1,
        digest=_digest(problem_digest(contours, graph, machine), lags, start),
        start=begun,
    )


def _digest(digest: str, lags: Lags | None, start: StatedOrder | None) -> str:
    """Return a problem's digest with what must cool and the order heads begin with in it."""
    more: dict[bytes, tuple[NDArray[Any], ...]] = {}
    if lags is not None and len(lags.below):
        more[b"decmcts-lags-1"] = lags.offsets, lags.below, np.round(lags.seconds / ROUND_TO)
    if start is not None:
        more[b"decmcts-start-1"] = start.order, start.reversed, start.head
    for person, rows in more.items():
        state = blake2b(bytes.fromhex(digest), digest_size=DIGEST_BYTES, person=person)
        for row in rows:
            state.update(row.astype("<i8").tobytes())
        digest = state.hexdigest()
    return digest


def _urgency(seconds: Floats, graph: DependencyGraph) -> Floats:
    behind = chain_behind(seconds, graph.succ_offsets, graph.succs)
    return np.asarray(1.0 - behind / max(float(behind.max(initial=0.0)), 1e-12))


def _quantile(seconds: Floats, space: Workspaces, axis: int) -> Floats:
    """Return the share of all work that lies at lower places along an axis, (n,)."""
    middle = space.boxes[:, 2 * axis] + space.boxes[:, 2 * axis + 1]
    order = np.argsort(middle, kind="stable")
    work = seconds[order]
    quantile = np.empty(len(seconds))
    quantile[order] = (np.cumsum(work) - work / 2) / max(float(work.sum()), 1e-12)
    return quantile


CELL_MM = 1.0  # of the footprint's grid; also the gap that still joins two beads
COLUMN_MM = 25.0  # cells of columns: contours of one column begin and end in the same ones
MACROS = 120  # wanted pieces of one print


def part_of(contours: Contours) -> Ints:
    """Return the part each contour belongs to, numbered from 0, (n,)."""
    from scipy.ndimage import label  # takes long to load

    if not len(contours):
        return np.empty(0, np.int64)
    x, y = contours.points[:, 0].copy(), contours.points[:, 1].copy()
    low = x.min() - 2 * CELL_MM, y.min() - 2 * CELL_MM
    column, row = _cells(x, low[0]), _cells(y, low[1])
    covered = np.zeros((column.max() + 4, row.max() + 4), np.bool_)
    covered[column, row] = True
    leaves = (column[1:] != column[:-1]) | (row[1:] != row[:-1])  # others lie in one cell
    leaves[contours.offsets[1:-1] - 1] = False  # no segment: the next contour begins
    x, y = _samples(x[:-1][leaves], y[:-1][leaves], x[1:][leaves], y[1:][leaves])
    covered[_cells(x, low[0]), _cells(y, low[1])] = True
    labels, _ = label(covered, structure=np.ones((3, 3), np.int64))
    first = contours.offsets[:-1]
    return np.asarray(
        np.unique(labels[column[first], row[first]], return_inverse=True)[1], np.int64
    )


def _cells(at: Floats, low: float) -> Ints:
    """Return the cell of each coordinate, counted from `low`."""
    return np.asarray(((at - low) / CELL_MM).astype(np.int64))


def _samples(x: Floats, y: Floats, to_x: Floats, to_y: Floats) -> tuple[Floats, Floats]:
    """Return points of segments a cell apart: they lie in cells that touch, if only at a corner."""
    steps = np.ceil(np.hypot(to_x - x, to_y - y) / CELL_MM).astype(np.int64) + 1
    segment = np.repeat(np.arange(len(x)), steps)
    along = (np.arange(len(segment)) - (np.cumsum(steps) - steps)[segment]) / steps[segment]
    return x[segment] + (to_x - x)[segment] * along, y[segment] + (to_y - y)[segment] * along


def numbered(*keys: Ints) -> Ints:
    """Return the rank of each row that these keys make, equal rows alike, (n,)."""
    code = np.zeros(len(keys[0]), np.int64)
    for key in keys:
        own = key - key.min(initial=0)
        code = code * (int(own.max(initial=0)) + 1) + own
    return np.asarray(np.unique(code, return_inverse=True)[1].reshape(-1))


def part_progress(seconds: Floats, part: Ints) -> Floats:
    """Return how much of its part's work comes before each contour in the source, 0..1, (n,)."""
    order = np.argsort(part, kind="stable")
    done = np.cumsum(seconds[order]) - seconds[order]
    total = np.bincount(part, weights=seconds)
    first = np.concatenate([[0.0], np.cumsum(total)])[:-1]
    progress = np.empty(len(part))
    progress[order] = (done - first[part[order]]) / np.maximum(total[part[order]], 1e-12)
    return np.clip(progress, 0.0, 1.0)


def cut_macros(seconds: Floats, part: Ints, progress: Floats, side: Ints) -> Int32s:
    """Return the macro-action of each contour, numbered by progress, (n,).

    `side` (n,) is the head in whose share of the machine it lies.
    """
    if not len(part):
        return np.empty(0, np.int32)
    work = np.bincount(part, weights=seconds)
    chunks = np.maximum(1, np.rint(MACROS / 2 * work / max(work.sum(), 1e-12))).astype(np.int64)
    chunk = np.minimum((progress * chunks[part]).astype(np.int64), chunks[part] - 1)
    piece = numbered(part, chunk, side)
    middle = (chunk + 0.5) / chunks[part]
    when = np.bincount(piece, weights=middle) / np.bincount(piece)
    rank = np.empty(len(when), np.int32)
    rank[np.argsort(when, kind="stable")] = np.arange(len(when), dtype=np.int32)
    return rank[piece]


def columns_of(boxes: Floats, part: Ints, axis: int) -> tuple[Ints, Int32s]:
    """Return the contours by column: those of one part and one place, each in source order.

    `boxes` (n, 4) are min x, max x, min y and max y; the place is that along `axis`.
    Returns the offsets of the columns and the contours, column after column.
    """
    cells = (boxes[:, 2 * axis : 2 * axis + 2] // COLUMN_MM).astype(np.int64)
    column = numbered(part, cells[:, 0], cells[:, 1])
    order = np.argsort(column, kind="stable")
    count = int(column.max(initial=-1)) + 1
    return np.searchsorted(column[order], np.arange(count + 1)), order.astype(np.int32)
