"""Delays that bring heads nearest: what an order that trusts a clock would not survive.

Between two stops a head runs without asking anybody. Of all pairs of such legs that no signal puts
in order, those whose swept boxes come nearest are made to happen at once, by delaying the head that
would be early.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from decmcts.print.machine import Head, Machine
from sim.controllers.carry_out import Run
from sim.controllers.compiled import compiled
from sim.controllers.nearness import shape_of
from sim.controllers.program import Floats, HeadProgram, Ints, StopKind, Stops
from sim.controllers.timing import Error, no_error

PAIRS = 20  # of legs, tried for each two heads


def adversaries(
    programs: Sequence[HeadProgram], run: Run, machine: Machine, heads: Sequence[Head]
) -> Iterator[list[Error]]:
    """Yield errors of all heads that make the nearest legs meet; `run` is without errors."""
    clocks = _clocks(programs)
    legs = [_legs(program) for program in programs]
    boxes = [_boxes(program, *leg) for program, leg in zip(programs, legs, strict=True)]
    for a, b in combinations(range(len(programs)), 2):
        shapes = shape_of(heads[a]).box, shape_of(heads[b]).box
        pairs, gaps = np.zeros((PAIRS, 2), np.int64), np.full(PAIRS, np.inf)
        reach = np.stack([shapes[1][0] - shapes[0][1], shapes[0][0] - shapes[1][1]])
        reach[~np.isfinite(reach)] = 0.0  # heads without a shape
        _nearest(boxes[a], boxes[b], clocks[a][:, b], clocks[b][:, a], reach, pairs, gaps)
        for k in np.flatnonzero(np.isfinite(gaps)).tolist():
            errors = [no_error(program) for program in programs]
            i, j = (int(legs[h][0][pairs[k, n]]) for n, h in enumerate((a, b)))
            early = float(run.heads[b].begin[j] - run.heads[a].begin[i])
            late, move = (a, i) if early > 0.0 else (b, j)
            if np.isfinite(early):
                errors[late].stall_s[move] += abs(early)
            yield errors


def _legs(program: HeadProgram) -> tuple[Ints, Ints, Ints]:
    """Return first move, end and stops above of each stretch between two stops that has moves."""
    places = np.concatenate([[0], program.stops.before, [len(program.feed)]]).astype(np.int64)
    above = np.flatnonzero(np.diff(places) > 0)
    return places[above], places[above + 1], above


def _boxes(program: HeadProgram, first: Ints, end: Ints, above: Ints) -> Floats:
    """Return least and most of where the tip is in each leg, (k, 2, 3)."""
    rows = np.stack([first, end], axis=1)
    found = [(program.points[a : b + 1].min(axis=0), program.points[a : b + 1].max(axis=0))
             for a, b in rows.tolist()]  # fmt: skip
    return np.array(found).reshape(-1, 2, 3)


def _clocks(programs: Sequence[HeadProgram]) -> list[Ints]:
    """Return for each leg of each head how many legs of every head must have ended before it."""
    n = len(programs)
    legs = [_legs(program) for program in programs]
    known = [np.zeros(n, np.int64) for _ in programs]
    given: dict[int, Ints] = {}
    clocks = [np.zeros((len(leg[0]), n), np.int64) for leg in legs]
    leg_of = [np.searchsorted(leg[2], np.arange(len(p.stops) + 1)) for leg, p in
              zip(legs, programs, strict=True)]  # fmt: skip
    for h in range(n):
        _fill(clocks[h], leg_of[h], 0, known[h])
    done, moved = [0] * n, True
    while moved:
        moved = False
        for h, program in enumerate(programs):
            stops = program.stops
            while (j := done[h]) < len(stops) and not _unknown(stops, j, given):
                known[h] = known[h].copy()
                known[h][h] = leg_of[h][j + 1]
                kind, number = int(stops.kind[j]), int(stops.number[j])
                if kind in (StopKind.SIGNAL, StopKind.PASS):
                    given[number] = known[h]
                elif kind == StopKind.WAIT:
                    known[h] = np.maximum(known[h], given[number])
                _fill(clocks[h], leg_of[h], j + 1, known[h])
                done[h], moved = j + 1, True
    return clocks


def _unknown(stops: Stops, j: int, given: Mapping[int, Ints]) -> bool:
    return stops.kind[j] == StopKind.WAIT and int(stops.number[j]) not in given


def _fill(clocks: Ints, leg_of: Ints, stop: int, known: Ints) -> None:
    """Write what is known behind a stop to the leg that follows it, in place."""
    if stop < len(leg_of) and leg_of[stop] < len(clocks):
        clocks[leg_of[stop]] = known


@compiled
def _nearest(
    a: Floats, b: Floats, b_done: Ints, a_done: Ints, reach: Floats, pairs: Ints, gaps: Floats
) -> None:
    """Write the pairs of legs that may happen at once and come nearest, in place.

    `b_done` has for each leg of a how many of b have ended, `a_done` the other way round.
    """
    low = 0
    for i in range(len(a)):
        low = max(low, b_done[i])
        for j in range(low, len(b)):
            if a_done[j] > i:
                break
            gap = -np.inf
            for axis in range(3):
                gap = max(gap, b[j, 0, axis] - a[i, 1, axis] + reach[0, axis])
                gap = max(gap, a[i, 0, axis] - b[j, 1, axis] + reach[1, axis])
            worst = int(np.argmax(gaps))
            if gap < gaps[worst]:
                gaps[worst], pairs[worst, 0], pairs[worst, 1] = gap, i, j
