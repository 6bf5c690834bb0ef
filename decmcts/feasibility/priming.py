"""What primes the nozzle comes first: skirt, brim, purge and prime lines.

An epoch is what the source prints between two places nothing is moved across.
What it begins an epoch with, tool by tool, stays there, in the source's order and
before all else that tool prints in the epoch, if it is

- skirt, brim, wipe tower or an extrusion of custom G-code;
- without a role, at a tool's first use, and the source names the roles of what
  comes after;
- at a tool's first use where the source names no roles at all: the first contour,
  and those after it up to the last before which everything is loose (`_loose`);
- the first contour after a tool change, a filament change or a pause.

That a brim stays before what touches it, wherever it stands in the source, is a
rule for touching contours (`decmcts.feasibility.touching`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.feasibility.closure_kernels import TOUCH_MM
from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.print.contours import Contours, Role
from decmcts.print.job import PrintJob

FRONT = (Role.SKIRT_BRIM, Role.WIPE_TOWER, Role.CUSTOM)

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class _ToolEpochs:
    """Contours by epoch and tool: group g has `member[begin[g]:begin[g + 1]]`, ascending."""

    member: Ints  # (n,)
    begin: Ints  # (n_groups + 1,)
    of: Ints  # (n,) group of each contour


def prime_first(graph: DependencyGraph, job: PrintJob) -> DependencyGraph:
    """Return the graph with edges that keep what primes the nozzle first.

    What primes becomes a chain and its last contour comes before all that depends on
    nothing else of the same epoch and tool. Edges that follow from these are
    dropped, so a reduced graph of a print with one tool an epoch stays reduced. Linear
    in contours and edges, but for the search for touching contours of the first two
    layers where the source names no roles.
    """
    if graph.n == 0:
        return graph
    groups = _groups_of(job.contours)
    primes = primers(job.contours, job.refills, groups)
    position = np.arange(graph.n)
    last = np.full(len(groups.begin) - 1, -1)  # of each group, what primes last; -1: nothing
    np.maximum.at(last, groups.of[primes], position[primes])
    pairs = graph.pairs().astype(np.int64)
    kept = ~_follows(pairs, job.contours, groups, primes, last)
    chain = groups.member[primes[groups.member]]
    chain = np.stack([chain[:-1], chain[1:]], axis=1)
    chain = chain[groups.of[chain[:, 0]] == groups.of[chain[:, 1]]]
    inside = pairs[(groups.of[pairs[:, 0]] == groups.of[pairs[:, 1]]) & ~primes[pairs[:, 0]]]
    first = (last[groups.of] >= 0) & ~primes
    first[inside[:, 1]] = False
    due = np.flatnonzero(first)
    more = np.concatenate([chain, np.stack([last[groups.of[due]], due], axis=1)])
    return _joined(graph, pairs, kept, more)


def _groups_of(contours: Contours) -> _ToolEpochs:
    member = np.lexsort((contours.tool, contours.epoch)).astype(np.int64)
    epoch, tool = contours.epoch[member], contours.tool[member]
    fresh = np.concatenate([[True], (np.diff(epoch) != 0) | (np.diff(tool) != 0)])
    of = np.empty(len(member), np.int64)
    of[member] = np.cumsum(fresh) - 1
    return _ToolEpochs(member, np.append(np.flatnonzero(fresh), len(member)), of)


def primers(contours: Contours, refills: tuple[int, ...], groups: _ToolEpochs) -> Bools:
    """Return which contours prime the nozzle, (n,)."""
    front = np.isin(contours.role, FRONT)
    unknown = contours.role == Role.UNKNOWN
    first = groups.member[groups.begin[:-1]]  # contour each group begins with
    opens = np.zeros(len(first), np.bool_)  # a tool's first use
    nameless = np.zeros(len(first), np.bool_)
    for tool in np.unique(contours.tool):
        opening = int(groups.of[np.argmax(contours.tool == tool)])
        mine = contours.tool == tool
        opens[opening] = True
        nameless[opening] = not (mine & ~front & ~unknown).any()
    leads = front | (unknown & (opens & ~nameless)[groups.of])
    before = contours.tool[np.maximum(first - 1, 0)]
    refilled = np.isin(contours.epoch[first], refills) | (before != contours.tool[first])
    count = _leading(leads, groups)
    count = np.maximum(count, (refilled | nameless).astype(np.int64))
    for g in np.flatnonzero(nameless).tolist():
        members = groups.member[groups.begin[g] : groups.begin[g + 1]]
        count[g] = max(int(count[g]), _loose(contours, members))
    rank = np.empty(len(front), np.int64)
    rank[groups.member] = np.arange(len(front)) - np.repeat(
        groups.begin[:-1], np.diff(groups.begin)
    )
    return np.asarray(rank < count[groups.of])


def _leading(flag: Bools, groups: _ToolEpochs) -> Ints:
    """Return how many contours each group has before its first without the flag, (n_groups,)."""
    place = np.arange(len(flag))
    ends = np.where(flag[groups.member], len(flag), place)
    stop = np.minimum.reduceat(ends, groups.begin[:-1])
    return np.minimum(stop, groups.begin[1:]) - groups.begin[:-1]


def _loose(contours: Contours, members: Ints) -> int:
    """Return how many of a tool's first contours can only be there to prime it.

    They are the most that, within the layer of the first, touch nothing printed after
    them; and on each of them lies nothing of the layer above, or it goes round all of
    its layer that is printed after them (a skirt of several layers). Where there is no
    layer above, nothing tells them from the part and there are none.
    """
    layer, base = contours.layer, int(contours.layer[members[0]])
    other = np.flatnonzero(layer[members] != base)
    run = members[: int(other[0]) if len(other) else len(members)]
    if not (layer == base + 1).any():
        return 0
    near = np.flatnonzero(layer <= base + 1)
    touching, lies_on = _contacts(contours, run, near)
    box = _boxes(contours)
    later = near[(layer[near] <= base) & (near >= run[0])]
    rest = np.concatenate(  # bounds of all of the layer from each place on
        [np.minimum.accumulate(box[later[::-1]], axis=0)[::-1], np.full((1, 4), np.inf)]
    )[np.searchsorted(later, run, side="right")]
    around = np.where(lies_on[:, None], box[run], -np.inf)
    around = np.maximum.accumulate(around, axis=0)
    goes_round = (around == -np.inf) | ((rest < np.inf) & (around < rest))
    sound = (np.maximum.accumulate(touching) <= run) & goes_round.all(axis=1)
    return int(np.flatnonzero(sound)[-1]) + 1 if sound.any() else 0


def _boxes(contours: Contours) -> NDArray[np.float64]:
    """Return the bounds of each contour as xmin, ymin, -xmax, -ymax: the larger, the smaller."""
    xy, begin = contours.points[:, :2], contours.offsets[:-1]
    return np.hstack([np.minimum.reduceat(xy, begin), -np.maximum.reduceat(xy, begin)])


def _contacts(contours: Contours, run: Ints, near: Ints) -> tuple[Ints, Bools]:
    """Return of each contour of `run` the last of its layer touching it, and if one above does."""
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    rank = np.full(len(contours), -1)
    rank[near] = np.arange(len(near))
    rows = np.flatnonzero(rank[owner] >= 0)
    lines = shapely.linestrings(contours.points[rows, :2], indices=rank[owner[rows]])
    gap = (contours.width[run] + contours.width[near].max()) / 2 + TOUCH_MM
    mine, theirs = shapely.STRtree(lines).query(lines[rank[run]], "dwithin", distance=gap)
    above = contours.layer[near[theirs]] > contours.layer[run[0]]
    last, lies_on = run.copy(), np.zeros(len(run), np.bool_)
    np.maximum.at(last, mine[~above], near[theirs[~above]])
    lies_on[mine[above]] = True
    return last, lies_on


def _follows(
    pairs: Ints, contours: Contours, groups: _ToolEpochs, primes: Bools, last: Ints
) -> Bools:
    """Return which edges follow from the chains and what they lead to, (m,).

    Within a group all edges out of what primes; between epochs of one tool each those
    out of it, but from the end of a chain nothing comes after, and those into what
    comes after the first of a chain.
    """
    a, b = pairs[:, 0], pairs[:, 1]
    here, there = groups.of[a], groups.of[b]
    size = np.diff(groups.begin)
    lone = np.bincount(contours.epoch)[contours.epoch] == size[groups.of]
    first = groups.member[groups.begin[:-1]]
    ends = groups.member[groups.begin[1:] - 1]
    out = primes[a] & (a != ends[here]) & lone[a]
    into = (last[there] >= 0) & (b != first[there]) & lone[b]
    return np.where(here == there, primes[a], out | into)


def _joined(graph: DependencyGraph, pairs: Ints, kept: Bools, more: Ints) -> DependencyGraph:
    """Return the graph of the kept edges and more; one that was there keeps its kind."""
    old = pairs @ np.array([graph.n, 1])
    new = more @ np.array([graph.n, 1])
    kinds = np.full(len(more), EdgeKind.PRIMING, np.uint8)
    sort = np.argsort(old)
    if len(old):
        at = sort[np.minimum(np.searchsorted(old, new, sorter=sort), len(old) - 1)]
        kinds = np.where(old[at] == new, graph.kinds[at], kinds)
    kept = kept & ~np.isin(old, new)
    return DependencyGraph.from_pairs(
        graph.n,
        np.concatenate([pairs[kept], more]).astype(np.int32),
        np.concatenate([graph.kinds[kept], kinds]),
    )
