"""How fast a team can be at best: a lower bound on the makespan.

The bound is the largest of five:

- all printing, shared evenly;
- what heads on one rail can print at once (`decmcts.team.bounds.rail_bound`);
- what two heads that no rail joins can print at once (`decmcts.team.bounds.pair_bound`);
- the longest chain of the dependency graph;
- what only one head can print.

The time of a contour is what the fastest head that may print it needs, entered where that
takes least, of one head alone at the contour's feeds. For several heads each contour also has its
shares of the travels to and from it (`.least_travel`), but for the first and the last of a head.
The chain counts no travel, since another head may print what comes next in it.

Where heads release reserved space piece by piece (`release` "point") the bounds on a rail and of
two heads are proven for plans as `decmcts.team.engine.order` makes them: a contour has at most
`MOST_PIECES` pieces, each begun where its space has shrunk by `PIECE_MM`, and closed ones entered
as sliced run as sliced. A plan that releases space at every vertex may be faster; docs/team.md
states by how much. The bound of two heads takes reserved spaces as boxes, as plans here do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from decmcts.arrays import Flags, Floats, Int32s
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.kinematics import fixed_order, widest
from decmcts.print.loops import rotated
from decmcts.print.loops_kernels import SLIVER_MM
from decmcts.print.machine import Machine
from decmcts.print.motion import segment_times
from decmcts.print.seam import SeamEntries
from decmcts.search.bounds.chains_kernels import chain_behind
from decmcts.team.bounds.least_travel import TravelShares, ends_of, no_shares, travel_shares
from decmcts.team.bounds.pair_bound import pair_bound
from decmcts.team.bounds.rail_bound import RailUse, rail_bound
from decmcts.team.engine.order import MOST_PIECES, PIECE_MM
from decmcts.team.engine.space import eligibility
from decmcts.team.engine.spaces_kernels import cut_pieces

SAFETY = 1e-6  # relative; the solver's tolerance, taken off the bound
NO_RAMP = 1e15  # mm/s²: any feed is reached at once


@dataclass(frozen=True, slots=True)
class Bound:
    """Lower bounds on the makespan, in seconds."""

    serial_s: float  # W: all printing one after the other, without travel
    travel_s: float  # what heads spend at least between contours, all together
    shared_s: float  # all printing, shared as well as the heads' reserved spaces allow
    chain_s: float  # longest chain of the dependency graph
    exclusive_s: float  # most work that only one head can do
    bound_s: float  # no plan of these heads, in such pieces, prints faster


def makespan_bound(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    *,
    entries: SeamEntries | None = None,
    travel: bool = True,
    rail: bool = True,
) -> Bound:
    """Return the conflict-aware bound for all heads of the machine.

    Parameters
    ----------
    entries : SeamEntries | None
        Where loops may be entered besides as sliced; None: nowhere.
    travel : bool
        Whether to count travel.
    rail : bool
        Whether to count the space that heads reserve from each other along a rail, which takes a
        linear programme.
    """
    # by tool and reach alone: by boxes some head that fits would count as one that does not
    eligible = eligibility(job.contours, machine.heads)
    time, parts = least_times(job, machine, eligible, entries)
    serial, heads = float(time.sum()), len(machine.heads)
    shares = no_shares(len(time))
    if travel and heads > 1:
        shares = travel_shares(job, machine, graph, time, entries)
    travelled = shares.spent(heads)
    chain = float(chain_behind(time, graph.succ_offsets, graph.succs).max(initial=0.0))
    alone = eligible.sum(axis=1) == 1
    exclusive = 0.0
    for r in range(heads):
        mine = alone & eligible[:, r]
        exclusive = max(exclusive, float(time[mine].sum()) + shares.spent(1, mine))
    even = (serial + travelled) / heads
    shared = max(even, _of_pair(job, machine, parts, entries))
    if rail:
        shared = max(shared, _on_rail(job, machine, parts, entries, shares))
    bound = max(shared, chain, exclusive) * (1.0 - SAFETY)
    return Bound(serial, travelled, shared, chain, exclusive, bound)


def _on_rail(
    job: PrintJob,
    machine: Machine,
    parts: Floats,
    entries: SeamEntries | None,
    shares: TravelShares,
) -> float:
    """Return the bound of heads that are all in order along one rail; 0 where they are not.

    `parts` are the seconds of the segment ending at each point, here and below.
    """
    row, heads = fixed_order(machine), len(machine.heads)
    if row is None or heads < 2:
        return 0.0
    held = _held(row.axis, job, machine, parts, entries)
    if shares.leaving.any() or shares.entering.any():
        held = _with_travels(held, job.contours, row.axis, entries, shares)
    found = rail_bound(held, separation_mm=row.apart_mm, heads=heads)
    return found - shares.without(heads)


def _of_pair(job: PrintJob, machine: Machine, parts: Floats, entries: SeamEntries | None) -> float:
    """Return the bound of two heads that no rail joins; 0 for others."""
    if len(machine.heads) != 2 or widest(machine) is not None:
        return 0.0
    x, y = (_held(axis, job, machine, parts, entries) for axis in (0, 1))
    height = float(np.ptp(job.contours.points[:, 2])) if len(job.contours) else 0.0
    return pair_bound(x, y, machine, height_mm=height)


def _with_travels(
    held: RailUse, contours: Contours, axis: int, entries: SeamEntries | None, shares: TravelShares
) -> RailUse:
    """Return what is held with the shares of travels besides.

    A head is no farther from where it ended a contour, or begins one, than it gets in that time.
    """
    choice = np.unique(held.choice)
    contour, is_reversed = choice // 2, choice % 2 == 1
    reversible = np.isin(contour, contour[is_reversed])  # others are left, or entered, at any end
    first, last = contours.start[contour, axis], contours.end[contour, axis]
    outs, ins = ends_of(contours, entries)
    low, high, seconds = [held.low], [held.high], [held.seconds]
    for share, ends, own in (
        (shares.leaving, outs, np.where(is_reversed, first, last)),
        (shares.entering, ins, np.where(is_reversed, last, first)),
    ):
        least, most = np.full(len(contours), np.inf), np.full(len(contours), -np.inf)
        np.minimum.at(least, ends.contour, ends.points[:, axis])
        np.maximum.at(most, ends.contour, ends.points[:, axis])
        reach = shares.pace.reach(share)[contour]
        low.append(np.where(reversible, own, most[contour]) + reach)
        high.append(np.where(reversible, own, least[contour]) - reach)
        seconds.append(share[contour])
    choice = np.concatenate([held.choice, choice, choice])
    travels = np.arange(len(choice)) >= len(held.choice)
    return RailUse(
        np.concatenate(low), np.concatenate(high), np.concatenate(seconds), choice, travels
    )


def _held(
    axis: int, job: PrintJob, machine: Machine, parts: Floats, entries: SeamEntries | None
) -> RailUse:
    """Return what space along an axis each piece of each contour holds, and for how long.

    Pieces are those that `decmcts.team.engine.order` makes, of contours it may reverse; loops
    may be entered at `entries`.
    """
    contours = job.contours
    reversible = contours.reversible & ~contours.closed
    most = MOST_PIECES if machine.release == "point" else 1
    reversible &= most > 1  # whole contours hold the same in both directions
    pieces = cut_pieces(contours.points, contours.offsets, reversible, PIECE_MM, most)
    choice = np.repeat(np.arange(2 * len(contours)), np.diff(pieces.offsets))
    contour, is_reversed = choice // 2, choice % 2 == 1
    first, last = contours.offsets[contour], contours.offsets[contour + 1] - 1
    spent = np.cumsum(parts)
    vertex = np.where(is_reversed, last - pieces.point, first + pieces.point)
    begin = np.where(is_reversed, spent[last] - spent[vertex], spent[vertex] - spent[first])
    is_last = np.diff(choice, append=-1) != 0
    end = np.where(is_last, spent[last] - spent[first], np.roll(begin, -1))
    low, high = pieces.space[:, 2 * axis], pieces.space[:, 2 * axis + 1]
    held = RailUse(low, high, end - begin, choice)
    if entries is None:
        return held
    if machine.release == "point":
        return _entered_anywhere(held, contours, parts, axis, entries)
    return _whole_from_any(held, contours, axis, entries)


def _entered_anywhere(
    held: RailUse, contours: Contours, parts: Floats, axis: int, entries: SeamEntries
) -> RailUse:
    """Return what is held if loops may be entered at `entries`, and run in either direction.

    Of such a loop a head holds at least the segment it prints, less the seam's gap, which may
    be at either end of it.
    """
    moved = np.maximum.reduceat(entries.vertices, entries.offsets[:-1]) > 0
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    at = contours.points[:, axis]
    before = np.roll(at, 1)
    ends = np.concatenate([contours.offsets[:-1], contours.offsets[1:] - 1])
    before[ends] = at[ends]  # what is printed through the old gap counts there
    gap = np.linalg.norm(contours.end - contours.start, axis=1)[owner] + SLIVER_MM
    rows = moved[owner]
    stays = ~moved[held.choice // 2]
    return RailUse(
        np.concatenate([held.low[stays], (np.minimum(before, at) + gap)[rows]]),
        np.concatenate([held.high[stays], (np.maximum(before, at) - gap)[rows]]),
        np.concatenate([held.seconds[stays], parts[rows]]),
        np.concatenate([held.choice[stays], 2 * owner[rows]]),
    )


def _whole_from_any(held: RailUse, contours: Contours, axis: int, entries: SeamEntries) -> RailUse:
    """Return what whole contours hold from every entry: the gap may lie where one reaches out.

    `held` has one piece a contour.
    """
    low, high = held.low.copy(), held.high.copy()
    for entry in choices(entries, len(contours)):
        run, offsets = rotated(contours, entry)
        at = run.points[:, axis]
        np.maximum(low, np.minimum.reduceat(at, offsets[:-1]), out=low)
        np.minimum(high, np.maximum.reduceat(at, offsets[:-1]), out=high)
    return held._replace(low=low, high=high)


def least_times(
    job: PrintJob, machine: Machine, eligible: Flags, entries: SeamEntries | None = None
) -> tuple[Floats, Floats]:
    """Return the least times over the heads that may print each contour, and over its entries.

    Heads of a team stand still between actions, for they may have to wait there, so their times
    are from rest to rest. A head alone may run on from contour to contour, so its times are those
    at the contours' feeds, without any ramps. O(heads with limits of their own · entries of one
    contour · points).

    Parameters
    ----------
    eligible : (n, heads)
        A contour that no head may print is taken to be any head's.
    entries : SeamEntries | None
        Where loops may be entered besides as sliced; None: nowhere.

    Returns
    -------
    contour : (n,) seconds
    segment : (n_points,) seconds
        Of the segment ending at each point, 0 at a start. Those of a contour may sum to less than
        the contour's, since each is by the head and entry that are best for it.
    """
    contours = job.contours
    may = eligible | ~eligible.any(axis=1, keepdims=True)
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    contour, segment = np.full(len(contours), np.inf), np.full(len(contours.points), np.inf)
    limits, alone = [machine.limits_of(head) for head in machine.heads], len(machine.heads) == 1
    if alone:
        limits = [
            replace(
                limits[0], max_acceleration=(NO_RAMP,) * 4, acceleration=NO_RAMP,
                retract_acceleration=NO_RAMP,
            )
        ]  # fmt: skip
    kinds = {own: [k for k, other in enumerate(limits) if other == own] for own in limits}
    for entry in choices(entries, len(contours)):
        run, offsets = rotated(contours, entry)
        running = replace(
            contours, points=run.points, extrusion=run.extrusion, feed=run.feed, offsets=offsets
        )
        set_by = None if job.acceleration is None or alone else job.acceleration[run.rows]
        for kind, heads in kinds.items():
            mine = np.asarray(may[:, heads].any(axis=1))
            seconds = segment_times(running, kind, set_by)
            whole = np.add.reduceat(seconds, offsets[:-1])
            parts = np.bincount(run.rows, seconds, len(owner))
            np.minimum(contour, whole, out=contour, where=mine)
            np.minimum(segment, parts, out=segment, where=mine[owner])
    return contour, segment


def choices(entries: SeamEntries | None, n: int) -> Iterator[Int32s]:
    """Yield vertices of all contours, (n,), until each contour had all it may be entered at."""
    yield np.zeros(n, np.int32)
    if entries is None:
        return
    first, count = entries.offsets[:-1], np.diff(entries.offsets)
    for k in range(int(count.max(initial=0))):
        chosen = entries.vertices[first + np.minimum(k, count - 1)]
        if chosen.any():
            yield chosen
