"""The joint plan that files of several heads carry out, read from the files alone.

Where no plan.json is at hand a plan is made of what the files do. Each bead is a print action,
what lies between beads and sync points is a travel, and an action waits for another, or for a
point within it, only where sync points make it wait. A signal given in motion does not split an
action. Beads that run a loop of the source from another vertex are recognised by the segments
they share with it.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from decmcts.arrays import Floats, Ints
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import (
    NO_CONTOUR,
    ActionKind,
    After,
    HeadActions,
    JointPlan,
    PlanDocument,
)
from sim.content.inventory import (
    NO_MATCH,
    Segments,
    compare,
    contour_segments,
    match_segments,
    move_segments,
)
from sim.content.laid import ROUNDING_MM, lying
from sim.content.paths import legs_of
from sim.content.same_print import check_print
from sim.content.seams import job_with, seams_of_paths
from sim.faults import Fault
from sim.heads.file import AXIS_MOVE, SAME_MM, HeadFile
from sim.heads.sync import Knowledge
from sim.replay.execution import execute
from sim.replay.least import least_arrivals
from sim.rules.order import PartialOrder, order_of

ACTION_S = 1.0  # more than its motion; times mean nothing: files are judged for every timing


@dataclass(slots=True)
class _Act:
    """One action while it is collected."""

    contour: int
    path: list[Floats]
    lines: list[int]  # from 1, of the move to each point but the first
    reversed: bool = False


def plan_of_files(
    files: Sequence[HeadFile], job: PrintJob, machine: Machine
) -> tuple[PlanDocument, list[Fault]]:
    """Return the plan of the files, one head each, and what they lay down unlike the source."""
    dots = _dots_of(job)
    laying = [_laying(file, dots) for file in files]
    ours = Segments.joined(
        [
            move_segments(m.points, m.extrusion, m.feed, m.line + 1, rows)
            for m, rows in zip((file.motion for file in files), laying, strict=True)
        ]
    )
    sizes = [len(rows) for rows in laying]
    parts = _contours(ours, contour_segments(job.contours), sizes)
    loops = [
        path
        for file, rows, ids in zip(files, laying, parts, strict=True)
        for path in _beads(file, rows, ids)
    ]
    moved = {seam.contour: seam for seam in seams_of_paths(loops, job.contours)}
    entered, _ = job_with(job, moved.values())
    theirs = contour_segments(entered.contours)
    match = match_segments(ours, theirs)
    faults = check_print(ours, theirs, match, theirs.place) or compare(ours, theirs, match)
    parts = _contours(ours, theirs, sizes)
    acts = [
        _acts(file, rows, ids, entered)
        for file, rows, ids in zip(files, laying, parts, strict=True)
    ]
    entry = {contour: seam.entry for contour, seam in moved.items()}
    known = Knowledge([file.syncs for file in files])
    all_actions = tuple(
        _head_actions(h, file.name, acts, known, entry) for h, file in enumerate(files)
    )
    document = PlanDocument(
        "", machine, job.contours, np.zeros((0, 2), np.int32), JointPlan(all_actions), {}
    )
    return replace(document, plan=JointPlan(_timed(document, all_actions, job))), faults


def _contours(ours: Segments, theirs: Segments, sizes: Sequence[int]) -> list[Ints]:
    """Return the contour of each of a file's segments, NO_CONTOUR where it is of none, by file."""
    match = match_segments(ours, theirs)
    contour = np.where(match == NO_MATCH, NO_CONTOUR, theirs.place[match])
    return np.split(contour, np.cumsum(sizes)[:-1])


def _beads(file: HeadFile, moves: Ints, contour: Ints) -> list[Floats]:
    """Return the path of each bead, (k, 3), given the contour of each laying move.

    A segment that is of no contour belongs to the bead before it, if no travel lies in between;
    else to the bead after it.
    """
    points = file.motion.points
    if not len(moves):
        return []
    apart = (points[moves[1:]] != points[moves[:-1] + 1]).any(axis=1)
    runs = np.split(np.arange(len(moves)), np.flatnonzero(apart) + 1)
    beads = [bead for run in runs for bead in _parted(run, contour[run])]
    return [np.concatenate([points[moves[b[:1]]], points[moves[b] + 1]]) for b in beads]


def _parted(run: Ints, contour: Ints) -> list[Ints]:
    known = np.flatnonzero(contour != NO_CONTOUR)
    if not len(known):
        return [run]
    at = np.searchsorted(known, np.arange(len(run)), side="right") - 1
    ids = contour[known[np.maximum(at, 0)]]
    return np.split(run, np.flatnonzero(np.diff(ids)) + 1)


def _begin(file: HeadFile) -> int:
    """Return the first move after the set-up: after the first signal.

    A head that signals nothing goes up, goes across to its park position, and begins.
    """
    if given := file.rests.signals:
        return int(file.motion.before[given[0] - 1])
    across = [line for line, code in file.rest if AXIS_MOVE.match(code)][1:2]
    return int(file.motion.before[across[0]]) if across else 0


def _acts(file: HeadFile, rows: Ints, contour: Ints, job: PrintJob) -> list[_Act]:
    motion, syncs = file.motion, [s.line for s in file.syncs if not s.moving]
    laid = dict(zip(rows.tolist(), contour.tolist(), strict=True))
    acts: list[_Act] = []
    begin = _begin(file)
    moving = np.flatnonzero((np.diff(motion.points[begin:], axis=0) != 0).any(axis=1)) + begin
    for m in np.union1d(moving, rows).tolist():
        line, key = int(motion.line[m]) + 1, laid.get(m, NO_CONTOUR)
        last = acts[-1] if acts else None
        if last is not None and last.contour != NO_CONTOUR and motion.extrusion[m] < 0:
            continue  # a wipe back along a bead belongs to it (`sim.heads.walk`)
        above = bisect_left(syncs, line)
        parted = last is None or (above > 0 and syncs[above - 1] > last.lines[-1])
        if parted or last is None or last.contour != key:
            acts.append(_Act(key, [motion.points[m], motion.points[m + 1]], [line]))
        else:
            last.path.append(motion.points[m + 1])
            last.lines.append(line)
    for act in acts:
        _snap(act, job)
    for before, act in pairwise(acts):  # files are rounded
        if act.contour == NO_CONTOUR:
            act.path[0] = before.path[-1]
        else:
            before.path[-1] = act.path[0]
    return acts


def _laying(file: HeadFile, dots: cKDTree | None) -> Ints:
    """Return those moves that lay down material; on the spot where the source has dots."""
    motion, begin = file.motion, _begin(file)
    rows = np.arange(begin, len(motion.extrusion))
    step = np.diff(motion.points[begin:], axis=0)
    filament = motion.extrusion[begin:]
    beyond = lying(motion.extrusion, np.zeros(len(motion.extrusion), np.int64))[begin:]
    laid = (filament > 0) & (step[:, :2] != 0).any(axis=1)
    spots = (beyond > ROUNDING_MM) & ~laid
    still = spots & (step == 0).all(axis=1)
    at = motion.points[rows[still]]
    if dots is not None and len(at):
        spots[still] = np.isfinite(dots.query(at, distance_upper_bound=SAME_MM)[0])
    else:
        spots[still] = False
    return np.asarray(rows[laid | spots])


def _dots_of(job: PrintJob) -> cKDTree | None:
    """Return the places where the source pushes filament on the spot; None if there are none."""
    ends = contour_segments(job.contours).ends
    dots = ends[(ends[:, :3] == ends[:, 3:]).all(axis=1), :3]
    return cKDTree(dots) if len(dots) else None


def _snap(act: _Act, job: PrintJob) -> None:
    """Move the path of a bead to its contour's points, set `reversed`; mutates act."""
    if act.contour == NO_CONTOUR:
        return
    line, path = job.contours.polyline(act.contour), np.array(act.path)
    for is_reversed in (False, True):
        way = line[::-1] if is_reversed else line
        if (places := _places(way, path)) is not None:
            act.lines = [act.lines[max(place - 1, 0)] for place in places[1:]]
            act.path, act.reversed = list(way), is_reversed
            return


def _places(way: Floats, path: Floats) -> list[int] | None:
    """Return for each point of a way its index in a file's path; None if they differ.

    Neighbouring points that are one in a file of three decimals have one index.
    """
    places = [0]
    for point in way[1:]:
        near = np.abs(path[places[-1] : places[-1] + 2] - point).max(axis=1) <= SAME_MM
        if not near.any():
            return None
        places.append(places[-1] + int(near[-1] and len(near) > 1))
    same = np.abs(way[0] - path[0]).max() <= SAME_MM and places[-1] == len(path) - 1
    return places if same else None


def _head_actions(
    h: int, name: str, acts: list[list[_Act]], known: Knowledge, entry: Mapping[int, int]
) -> HeadActions:
    """Return the actions of one head with the waits that its sync points make.

    `entry` has the vertex at which contours are entered, of those not entered as sliced.
    """
    mine = acts[h]
    after = _waits(h, acts, known)
    flat = [edge for edges in after for edge in edges]
    kind = [ActionKind.TRAVEL if a.contour == NO_CONTOUR else ActionKind.PRINT for a in mine]
    if kind and kind[-1] == ActionKind.TRAVEL:
        kind[-1] = ActionKind.PARK
    paths = [np.array(act.path) for act in mine]
    n = len(mine)
    return HeadActions(
        name, np.array(kind, np.int8), np.array([a.contour for a in mine], np.int32),
        np.array([a.reversed for a in mine], np.bool_),
        np.array([entry.get(a.contour, 0) for a in mine], np.int32),
        np.cumsum([0, *map(len, paths)]).astype(np.int64),
        np.concatenate(paths) if paths else np.zeros((0, 3)), np.zeros(n), np.zeros(n),
        np.cumsum([0, *map(len, after)]).astype(np.int64),
        np.array([edge.head for edge in flat], np.int32),
        np.array([edge.action for edge in flat], np.int32),
        np.array([edge.point for edge in flat], np.int32), np.zeros(len(flat)),
    )  # fmt: skip


def _waits(h: int, acts: list[list[_Act]], known: Knowledge) -> list[list[After]]:
    """Return for each action of a head how far it knows the others to be, where that is news."""
    known_of = [(0, 0)] * len(acts)  # per head: actions ended, and points of the next one passed
    ended = [np.array([act.lines[-1] for act in other], np.int64) for other in acts]
    after: list[list[After]] = []
    for act in acts[h]:
        edges = []
        for g in range(len(acts)):
            line = known.done(h, act.lines[0], g)
            count = int(np.searchsorted(ended[g], line))
            point = bisect_left(acts[g][count].lines, line) if count < len(acts[g]) else 0
            if g == h or (count, point) <= known_of[g]:
                continue
            if count > known_of[g][0]:
                edges.append(After(g, count - 1))
            if point:
                edges.append(After(g, count, point))
            known_of[g] = (count, point)
        after.append(edges)
    return after


def _timed(
    document: PlanDocument, all_actions: tuple[HeadActions, ...], job: PrintJob
) -> tuple[HeadActions, ...]:
    """Return all actions with times that keep their order, at the slowest feed of the print.

    Behind each stands what the machine's controllers need to start and to tell signals apart.
    """
    legs = legs_of(all_actions)
    order = order_of(legs.all_actions)
    if not isinstance(order, PartialOrder):
        return all_actions
    slowest = float(job.contours.feed[job.contours.feed > 0.0].min(initial=1.0))
    stands = document.machine.rest_s + document.machine.signal_interval_s
    seconds = []
    for h, (actions, whole) in enumerate(zip(legs.all_actions, all_actions, strict=True)):
        least = legs.arrivals(h, least_arrivals(document, whole, job, rests=True))
        paths = (actions.action_path(k) for k in range(len(actions)))
        length = [np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths]
        ends = least[actions.path_offsets[1:] - 1]
        seconds.append(ACTION_S + np.array(length, np.float64) / slowest + ends)
    begin = execute(legs.all_actions, order, [taken + stands for taken in seconds])
    timed = []
    for h, actions in enumerate(all_actions):
        ends = begin[h] + seconds[h]
        first = np.searchsorted(legs.origin[h], np.arange(len(actions)))
        last = np.searchsorted(legs.origin[h], np.arange(len(actions)), side="right") - 1
        timed.append(replace(actions, begin_s=begin[h][first], end_s=ends[last]))
    return tuple(timed)
