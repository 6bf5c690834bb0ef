"""All order constraints of a print on a machine: the one place they are put together.

Planners and agents build their graph here, so that no rule is on in one command
and off in another.

**Lead**: how many layers one part may run ahead of the rest. With a limit of N nothing of layer L +
N + 1 is begun before all of layer L is printed. Said for every pair of contours that is a product
of two layers, so on layers with many contours one contour stands for the rule: the first of layer L
+ N in the source, all of layer L before it, it before all of layer L + N + 1. That is a little
stricter than asked, since that one contour is waited for. So is what rests on nothing: it waits for
one contour of the layer below, through which the layers further down come before it.

**Priming**: what primes the nozzle comes first, as skirt, brim, purge and prime lines do. An
epoch is what the source prints between two places nothing is moved across.
What it begins an epoch with, tool by tool, stays there, in the source's order and
before all else that tool prints in the epoch, if it is

- skirt, brim, wipe tower or an extrusion of custom G-code;
- without a role, at a tool's first use, and the source names the roles of what
  comes after;
- at a tool's first use where the source names no roles at all: the first contour,
  and those after it up to the last before which everything is loose (`_loose`);
- the first contour after a tool change, a filament change or a pause.

That a brim stays before what touches it, wherever it stands in the source, is a
rule for touching contours (`decmcts.feasibility.build`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import shapely

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.feasibility.build import build_graph
from decmcts.feasibility.closure_kernels import TOUCH_MM
from decmcts.feasibility.contacts import Contacts, contacts_of
from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.print.contours import Contours, Role
from decmcts.print.job import PrintJob
from decmcts.print.loops import close_gaps
from decmcts.print.machine import Machine

FRONT = (Role.SKIRT_BRIM, Role.WIPE_TOWER, Role.CUSTOM)


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
    kept |= np.isin(pairs @ [graph.n, 1], more @ [graph.n, 1])
    graph = DependencyGraph.from_pairs(graph.n, pairs[kept], graph.kinds[kept])
    return graph.with_edges(more, EdgeKind.PRIMING)


def _groups_of(contours: Contours) -> _ToolEpochs:
    member = np.lexsort((contours.tool, contours.epoch)).astype(np.int64)
    epoch, tool = contours.epoch[member], contours.tool[member]
    fresh = np.concatenate([[True], (np.diff(epoch) != 0) | (np.diff(tool) != 0)])
    of = np.empty(len(member), np.int64)
    of[member] = np.cumsum(fresh) - 1
    return _ToolEpochs(member, np.append(np.flatnonzero(fresh), len(member)), of)


def primers(contours: Contours, refills: tuple[int, ...], groups: _ToolEpochs) -> Flags:
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


def _leading(flag: Flags, groups: _ToolEpochs) -> Ints:
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


def _boxes(contours: Contours) -> Floats:
    """Return the bounds of each contour as xmin, ymin, -xmax, -ymax: the larger, the smaller."""
    xy, begin = contours.points[:, :2], contours.offsets[:-1]
    return np.hstack([np.minimum.reduceat(xy, begin), -np.maximum.reduceat(xy, begin)])


def _contacts(contours: Contours, run: Ints, near: Ints) -> tuple[Ints, Flags]:
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
    pairs: Ints, contours: Contours, groups: _ToolEpochs, primes: Flags, last: Ints
) -> Flags:
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


def order_rules(
    job: PrintJob,
    machine: Machine,
    *,
    process_order: Literal["keep", "free"] = "keep",
    quality: bool = False,
    free_seams: bool = False,
    max_layers_ahead: int | None = None,
    contacts: Contacts | None = None,
) -> DependencyGraph:
    """Return what must come before what when `job` is printed on `machine`.

    Parameters
    ----------
    process_order, quality
        As in `decmcts.feasibility.build.build_graph`.
    free_seams : bool
        Whether loops may begin anywhere, so that they count as closed.
    max_layers_ahead : int | None
        As `layers` in `decmcts.feasibility.rules.limit_lead`; None: no limit.
    contacts : Contacts | None
        What `contacts_between` returned; None: they are found here.

    Raises
    ------
    CollisionError
        If the source itself cannot be printed in its own order with this machine.
    """
    graph = build_graph(
        _material(job, free_seams),
        machine.heads,
        clearance_mm=machine.clearance_mm,
        bead_width=machine.bead_width,
        process_order=process_order,
        quality=quality,
        contacts=contacts,
    )
    graph = prime_first(graph, job)
    if max_layers_ahead is not None:
        graph = limit_lead(graph, job.contours.layer, layers=max_layers_ahead)
    return graph


def contacts_between(job: PrintJob, machine: Machine, *, free_seams: bool = False) -> Contacts:
    """Return the contacts of head and beads in the order of the job's contours.

    Raises
    ------
    CollisionError
        If one of them is deeper than contacts may be.
    """
    return contacts_of(_material(job, free_seams), machine)


def with_contacts(job: PrintJob, contacts: Contacts) -> PrintJob:
    """Return the job with what must run as sliced never reversed, and a note on the contacts."""
    if not len(contacts):
        return job
    reversible = job.contours.reversible.copy()
    reversible[contacts.as_sliced] = False
    contours = replace(job.contours, reversible=reversible)
    return replace(job, contours=contours, notes=(*job.notes, contacts.note()))


def _material(job: PrintJob, free_seams: bool) -> Contours:
    return close_gaps(job.contours) if free_seams else job.contours


DENSE = 8  # edges a contour up to which the pairs themselves are stored


def limit_lead(graph: DependencyGraph, layer: Int32s, *, layers: int) -> DependencyGraph:
    """Return the graph with edges that let no contour run more than `layers` layers ahead.

    Where the source itself goes down again (objects printed one by one) the
    limit holds within each climb, so the source stays a solution. With 0 the
    print goes layer by layer.

    Parameters
    ----------
    layer : (n,) layer of each contour in source order
    layers : int
        At least 0.

    Raises
    ------
    ValueError
        If `layers` is negative.
    """
    if layers < 0:
        raise ValueError(f"{layers} layers ahead, expected 0 or more")
    step = np.diff(layer)
    run = np.concatenate([[0], np.cumsum(step != 0)])[: graph.n]
    climb = np.concatenate([[0], np.cumsum(step < 0)])[: graph.n]
    lasts, firsts = _ends(graph, run)
    begins = np.flatnonzero(np.diff(run, prepend=-1))
    pairs = graph.pairs()
    supported = np.zeros(graph.n, np.bool_)  # something of the layer below comes before it
    supported[pairs[run[pairs[:, 0]] == run[pairs[:, 1]] - 1, 1]] = True
    found = [np.empty((0, 2), np.int64)]
    for low in range(len(begins) - layers - 1):
        high = low + layers + 1
        if climb[begins[low]] == climb[begins[high]]:
            # The contour that stands for the rule; for no layer ahead the last of the layer.
            hub = begins[high - 1] if layers else begins[high] - 1
            found.append(_between(lasts[low], firsts[high], hub))
            loose = firsts[high][~supported[firsts[high]]]
            found.append(np.stack([np.full(len(loose), begins[high - 1]), loose], axis=1))
    return graph.with_edges(np.concatenate(found), EdgeKind.LEAD)


def _ends(graph: DependencyGraph, run: Ints) -> tuple[list[Ints], list[Ints]]:
    """Return of each run the contours nothing of it comes after, and before."""
    pairs = graph.pairs()
    inside = pairs[run[pairs[:, 0]] == run[pairs[:, 1]]]
    last, first = np.ones(graph.n, np.bool_), np.ones(graph.n, np.bool_)
    last[inside[:, 0]] = False
    first[inside[:, 1]] = False
    return _by_run(np.flatnonzero(last), run), _by_run(np.flatnonzero(first), run)


def _by_run(contour: Ints, run: Ints) -> list[Ints]:
    if not len(run):
        return []
    return np.split(contour, np.searchsorted(run[contour], np.arange(1, int(run[-1]) + 1)))


def _between(before: Ints, after: Ints, hub: int) -> Ints:
    """Return edges that put all of `before` before all of `after`, (k, 2)."""
    if len(before) * len(after) <= DENSE * (len(before) + len(after)):
        return np.stack([np.repeat(before, len(after)), np.tile(after, len(before))], axis=1)
    into = before[before != hub]
    return np.concatenate(
        [
            np.stack([into, np.full(len(into), hub)], axis=1),
            np.stack([np.full(len(after), hub), after], axis=1),
        ]
    )
