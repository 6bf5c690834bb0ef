"""Arcs stay arcs: those of a result against those of its source, whole and by their circles.

A file's chords are compared elsewhere (`sim.content.inventory`); they would be right for lines
in an arc's place too. Here each arc is what its line says: two ends, and a centre worked out
anew from I and J or R. An arc run the other way is the same arc; one of a loop that is entered
elsewhere may come in parts.
"""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from decmcts.arrays import Flags, Floats, Ints
from decmcts.formats.gcode import GcodeDocument, Motions
from decmcts.formats.gcode.controller.motion import Motion
from decmcts.formats.gcode.document import NO_ARC, Arcs
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from sim.content.inventory import NO_MATCH, altered
from sim.faults import Fault, FaultKind, listed

NEAR_MM = 3e-3  # ends and centres together, rounding to three decimals on both sides
ROUND_MM = 5e-3  # of the radius of a part, whose end is rounded, against that of the whole

_NO_MOVES = (np.zeros(0), np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64))


@dataclass(frozen=True, slots=True)
class Turns:
    """Arcs that lay down material, each with the ends it has when run counter-clockwise."""

    ends: Floats  # (n, 6) where it begins and ends
    centre: Floats  # (n, 2)
    extrusion: Floats  # (n,) filament mm
    feed: Floats  # (n,) mm/s
    line: Ints  # (n,) in its file, from 1
    contour: Ints  # (n,) below 0: of none

    def of(self, contours: AbstractSet[int]) -> Turns:
        """Return the arcs of these contours alone."""
        kept = np.isin(self.contour, list(contours))
        return Turns(*(getattr(self, name)[kept] for name in self.__slots__))

    def text(self, i: int) -> str:
        """Return the words for one arc."""
        x0, y0, _, x1, y1, _ = self.ends[i]
        at = ", ".join(f"{value:.3f}" for value in self.centre[i])
        return (
            f"line {self.line[i]}: the arc of ({x0:.3f}, {y0:.3f}) and ({x1:.3f}, {y1:.3f}) "
            f"around ({at})"
        )


def turns_of(motions: Motions, *, all_moves: bool = True) -> Turns:
    """Return the arcs of a file; without `all_moves` those of its contours."""
    if motions.arc is None or motions.arcs is None:
        return _turns(np.zeros(0, np.int64), Arcs.none(), np.zeros((1, 3)), *_NO_MOVES)
    contour = np.asarray(motions.contour, np.int64)
    arc = np.where((contour >= 0) | all_moves, np.asarray(motions.arc, np.int64), NO_ARC)
    line = np.asarray(motions.line, np.int64)
    return _turns(arc, motions.arcs, motions.points, motions.extrusion, motions.feed, line, contour)


def turns_between(motion: Motion, begin: int, end: int) -> Turns:
    """Return the arcs of the moves begin..end - 1 of a file, of no contour that is known."""
    arc = np.full(len(motion.arc), NO_ARC, np.int64)
    arc[begin:end] = motion.arc[begin:end]
    none = np.full(len(arc), NO_MATCH, np.int64)
    return _turns(
        arc, motion.arcs, motion.points, motion.extrusion, motion.feed, motion.line + 1, none
    )


def turns_of_print(job: PrintJob, document: GcodeDocument) -> Turns:
    """Return the arcs of a print's contours; each has the line its contour begins at."""
    contours = job.contours
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))[1:]
    return _turns(
        np.asarray(document.point_arc[1:], np.int64), document.arcs, contours.points,
        contours.extrusion[1:], contours.feed[1:], np.asarray(contours.line, np.int64)[owner],
        owner,
    )  # fmt: skip


def arcs_of_parts(
    points: Floats, arc: Ints, source: Contours, document: GcodeDocument
) -> tuple[Ints, Arcs]:
    """Return the arcs of a print's pieces, (n_points,) and their table.

    Each part of an arc is an arc of its own, its centre counted from where the part begins. `arc`
    is the source's that each segment of the pieces is a chord of, by the point at its end.
    """
    table, own = document.arcs, np.asarray(document.point_arc, np.int64)
    centre = np.zeros((len(table.clockwise), 2))
    begins, stops = _runs(own)
    number = own[begins]
    centre[number] = _centres(table, number, source.points[begins - 1], source.points[stops])
    begins, _ = _runs(arc)
    number = arc[begins]
    words = np.full((len(number), 3), np.nan)
    words[:, :2] = centre[number] - points[begins - 1, :2]
    part = np.searchsorted(begins, np.arange(len(arc)), side="right") - 1
    parts = Arcs(
        centre[number], table.clockwise[number], table.partible[number], words, table.decimals
    )
    return np.where(arc == NO_ARC, NO_ARC, part), parts


def _runs(arc: Ints) -> tuple[Ints, Ints]:
    """Return the first and the last chord of each arc."""
    begins = np.flatnonzero((arc != NO_ARC) & (np.diff(arc, prepend=NO_ARC) != 0))
    stops = np.flatnonzero((arc != NO_ARC) & (np.diff(arc, append=NO_ARC) != 0))
    return begins, stops


def _turns(
    arc: Ints, table: Arcs, points: Floats, extrusion: Floats, feed: Floats, line: Ints,
    contour: Ints,
) -> Turns:  # fmt: skip
    """Return the arcs of which moves have these numbers, NO_ARC: of no arc."""
    begins, stops = _runs(arc)
    laid = np.concatenate([[0.0], np.cumsum(extrusion)])
    lays = laid[stops + 1] > laid[begins]
    begins, stops = begins[lays], stops[lays]
    number, start, end = arc[begins], points[begins], points[stops + 1]
    clockwise = table.clockwise[number]
    return Turns(
        np.where(clockwise[:, None], np.hstack([end, start]), np.hstack([start, end])),
        _centres(table, number, start, end), laid[stops + 1] - laid[begins],
        np.asarray(feed)[begins], line[begins], contour[begins],
    )  # fmt: skip


def _centres(table: Arcs, number: Ints, start: Floats, end: Floats) -> Floats:
    """Return the centre of each arc from its words, (n, 2)."""
    i, j, radius = table.words[number].T
    centre: Floats = start[:, :2] + np.nan_to_num(np.column_stack([i, j]))
    by_radius = np.flatnonzero(~np.isnan(radius))
    a = start[by_radius, 0] + 1j * start[by_radius, 1]
    b = end[by_radius, 0] + 1j * end[by_radius, 1]
    r, half = radius[by_radius], (b - a) / 2.0
    away = np.sqrt(np.maximum(r**2 - np.abs(half) ** 2, 0.0))
    left = np.where(table.clockwise[number[by_radius]], -1.0, 1.0) * np.sign(r)
    found = a + half + 1j * half / np.abs(half) * away * left
    centre[by_radius] = np.column_stack([found.real, found.imag])
    return centre


def check_arcs(ours: Turns, source: Turns, moved: AbstractSet[int]) -> list[Fault]:
    """Return the source's arcs that are no arcs of the result, and what else is turned.

    `moved` are contours of the source that are entered elsewhere: their arcs may come in parts.
    """
    match = _matched(ours, source)
    pairs = np.flatnonzero(match != NO_MATCH)
    faults = altered(ours, source, match)
    gone = np.setdiff1d(np.arange(len(source.line)), match[pairs])
    may_part = gone[np.isin(source.contour[gone], list(moved))]
    extra = np.flatnonzero(match == NO_MATCH)
    foreign = extra[~_are_parts(ours, extra, source, may_part)]
    gone = np.setdiff1d(gone, may_part)
    lines = [f"{ours.text(i)} is not in the source" for i in foreign.tolist()]
    faults += listed(FaultKind.ARC, lines)
    lines = [f"{source.text(i)} is no arc of the result" for i in gone.tolist()]
    return faults + listed(FaultKind.ARC, lines)


def _matched(ours: Turns, source: Turns) -> Ints:
    """Return for each of our arcs the source's arc it is, or NO_MATCH; none twice, (n,)."""
    match = np.full(len(ours.line), NO_MATCH, np.int64)
    if not len(ours.line) or not len(source.line):
        return match
    mine, theirs = (np.hstack([turns.ends, turns.centre]) for turns in (ours, source))
    near = cKDTree(theirs).query_ball_point(mine, NEAR_MM)
    taken: set[int] = set()
    for i in np.lexsort((ours.feed, ours.extrusion)).tolist():
        free = [k for k in near[i] if k not in taken]
        if free:
            unlike = [(abs(float(source.extrusion[k] - ours.extrusion[i])), k) for k in free]
            match[i] = min(unlike)[1]
            taken.add(int(match[i]))
    return match


def _are_parts(ours: Turns, extra: Ints, source: Turns, whole: Ints) -> Flags:
    """Tell which of our arcs `extra` are parts of the source's arcs `whole`, (n,)."""
    parts = np.zeros(len(extra), np.bool_)
    if not len(extra) or not len(whole):
        return parts
    around = cKDTree(source.centre[whole]).query_ball_point(ours.centre[extra], NEAR_MM)
    for k, near in enumerate(around):
        parts[k] = any(_is_part(ours, int(extra[k]), source, int(whole[w])) for w in near)
    return parts


def _is_part(ours: Turns, i: int, source: Turns, k: int) -> bool:
    if np.abs(ours.ends[i, [2, 5]] - source.ends[k, [2, 5]]).max() > NEAR_MM:
        return False
    centre = source.centre[k]
    begin, end = (_polar(source.ends[k, at : at + 2] - centre) for at in (0, 3))
    first, last = (_polar(ours.ends[i, at : at + 2] - centre) for at in (0, 3))
    if max(abs(first[0] - begin[0]), abs(last[0] - end[0])) > ROUND_MM + abs(begin[0] - end[0]):
        return False
    slack = NEAR_MM / max(begin[0], NEAR_MM)
    whole = (end[1] - begin[1] - slack) % (2.0 * np.pi) + slack  # equal ends: a full circle
    at = (first[1] - begin[1] + slack) % (2.0 * np.pi) - slack
    return bool(at + (last[1] - first[1]) % (2.0 * np.pi) <= whole + slack)


def _polar(point: Floats) -> tuple[float, float]:
    return float(np.hypot(*point)), float(np.arctan2(point[1], point[0]))
