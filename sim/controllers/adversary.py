"""Delays that bring heads nearest: what an order that trusts a clock would not survive.

Between two stops a head runs without asking anybody. Of all pairs of such legs that no signal puts
in order, those whose swept boxes come nearest are looked at point by point. Then the head that
would come early to its point is delayed, so that both are there at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.print.machine import Head, Machine
from sim.controllers.carry_out import HeadRun, Run
from sim.controllers.compiled import compiled
from sim.controllers.nearness import Shape, gap_between, rail_rows, shape_of, slack_between
from sim.controllers.program import HeadProgram, StopKind, Stops
from sim.controllers.timing import Error, no_error
from sim.heads.sync import Knowledge, Sync

CANDIDATES = 400  # pairs of legs whose boxes are nearest, for each two heads;
PAIRS = 20  # of them those whose points are nearest are tried


def adversaries(
    programs: Sequence[HeadProgram], run: Run, machine: Machine, heads: Sequence[Head]
) -> Iterator[list[Error]]:
    """Yield errors of all heads that make the nearest points meet; `run` is without errors."""
    legs = [_legs(program) for program in programs]
    clocks = _clocks(programs, [above for _, _, above in legs])
    boxes = [_boxes(program, *leg[:2]) for program, leg in zip(programs, legs, strict=True)]
    for a, b in combinations(range(len(programs)), 2):
        shapes = shape_of(heads[a]), shape_of(heads[b])
        reach = np.stack([shapes[1].box[0] - shapes[0].box[1], shapes[0].box[0] - shapes[1].box[1]])
        reach[~np.isfinite(reach)] = 0.0  # heads without a shape
        rails, clear = rail_rows(machine, heads[a], heads[b]), machine.head_clearance_mm
        pairs, gaps = np.zeros((CANDIDATES, 2), np.int64), np.full(CANDIDATES, np.inf)
        _nearest(
            boxes[a], boxes[b], clocks[a][:, b], clocks[b][:, a], reach, rails, clear, pairs, gaps
        )
        pairs = pairs[np.isfinite(gaps)]
        spans = [np.stack(legs[h][:2], axis=1)[pairs[:, n]] for n, h in enumerate((a, b))]
        points, gaps = np.zeros((len(pairs), 2), np.int64), np.zeros(len(pairs))
        _meet(programs[a].points, programs[b].points, spans[0], spans[1], *shapes, rails, clear,
              points, gaps)  # fmt: skip
        for k in np.argsort(gaps, kind="stable")[:PAIRS].tolist():
            errors = [no_error(program) for program in programs]
            firsts = int(spans[0][k, 0]), int(spans[1][k, 0])
            when = [
                _reaches(run.heads[h], firsts[n], int(points[k, n])) for n, h in enumerate((a, b))
            ]
            if np.isfinite(when).all():
                early = int(when[1] < when[0])
                errors[(a, b)[early]].stall_s[firsts[early]] += abs(when[1] - when[0])
            yield errors


def _reaches(run: HeadRun, first: int, point: int) -> float:
    """Return when a head is at a point of a leg."""
    return float(run.begin[first] if point == first else run.end[point - 1])


def _legs(program: HeadProgram) -> tuple[Ints, Ints, Ints]:
    """Return first move, end and stops above of each stretch between two stops that has moves."""
    places = np.concatenate([[0], program.stops.before, [len(program.feed)]]).astype(np.int64)
    above = np.flatnonzero(np.diff(places) > 0)
    return places[above], places[above + 1], above


def _boxes(program: HeadProgram, first: Ints, end: Ints) -> Floats:
    """Return least and most of where the tip is in each leg, (k, 2, 3)."""
    ways = [program.points[a : b + 1] for a, b in zip(first.tolist(), end.tolist(), strict=True)]
    return np.array([(way.min(axis=0), way.max(axis=0)) for way in ways]).reshape(-1, 2, 3)


def _clocks(programs: Sequence[HeadProgram], above: Sequence[Ints]) -> list[Ints]:
    """Return for each leg of each head how many legs of every head must have ended before it.

    `above` are the stops above each leg; a stop is a line for what sync points order.
    """
    known = Knowledge([_syncs(program.stops) for program in programs])
    ended = [
        np.searchsorted(own, np.arange(len(program.stops) + 1))
        for own, program in zip(above, programs, strict=True)
    ]
    return [
        np.array(
            [[legs[known.done(h, k + 1, g)] for g, legs in enumerate(ended)] for k in own.tolist()],
            np.int64,
        ).reshape(-1, len(programs))
        for h, own in enumerate(above)
    ]


def _syncs(stops: Stops) -> list[Sync]:
    rows = enumerate(zip(stops.kind.tolist(), stops.number.tolist(), strict=True), 1)
    kinds = (StopKind.SIGNAL, StopKind.PASS, StopKind.WAIT)
    return [Sync(n, kind != StopKind.WAIT, number) for n, (kind, number) in rows if kind in kinds]


@compiled
def _nearest(
    a: Floats, b: Floats, b_done: Ints, a_done: Ints, reach: Floats, rails: Floats, clear: float,
    pairs: Ints, gaps: Floats,
) -> None:  # fmt: skip
    """Write the pairs of legs that may happen at once and come nearest, in place.

    `b_done` has for each leg of a how many of b have ended, `a_done` the other way round.
    """
    low, worst = 0, 0
    for i in range(len(a)):
        low = max(low, b_done[i])
        for j in range(low, len(b)):
            if a_done[j] > i:
                break
            gap = -np.inf
            for axis in range(3):
                gap = max(gap, b[j, 0, axis] - a[i, 1, axis] + reach[0, axis])
                gap = max(gap, a[i, 0, axis] - b[j, 1, axis] + reach[1, axis])
            gap -= clear
            for r in range(len(rails)):
                axis = int(rails[r, 0])
                ahead = b[j, 0, axis] - a[i, 1, axis]
                if rails[r, 1] < 0.0:
                    ahead = a[i, 0, axis] - b[j, 1, axis]
                gap = min(gap, ahead - rails[r, 2])
            if gap < gaps[worst]:
                gaps[worst], pairs[worst, 0], pairs[worst, 1] = gap, i, j
                worst = int(np.argmax(gaps))


@compiled
def _meet(
    a: Floats, b: Floats, a_spans: Ints, b_spans: Ints, a_shape: Shape, b_shape: Shape,
    rails: Floats, clear: float, points: Ints, gaps: Floats,
) -> None:  # fmt: skip
    """Write for each pair of legs which points of them are nearest, and how near, in place."""
    for k in range(len(gaps)):
        gaps[k] = np.inf
        for i in range(a_spans[k, 0], a_spans[k, 1] + 1):
            for j in range(b_spans[k, 0], b_spans[k, 1] + 1):
                gap = slack_between(rails, a[i], b[j])
                gap = min(gap, gap_between(a_shape, b_shape, a[i], b[j]) - clear)
                if gap < gaps[k]:
                    gaps[k], points[k, 0], points[k, 1] = gap, i, j
