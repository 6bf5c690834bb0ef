"""Who waits for whom: programs of all heads carried out together.

Each head goes through its moves and stops; a wait lasts until its signal was given. What a head
loses where it comes to rest for another is the machine's `rest_s`. Complexity O(stops).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.print.brief import brief
from sim.controllers.compiled import compiled
from sim.controllers.program import HeadProgram, StopKind, Stops
from sim.controllers.timing import Error

_DWELL, _WAIT, _SIGNAL, _PASS, _REST, _TARGET, _HEAT = map(int, StopKind)
NEVER = np.inf


@dataclass(frozen=True, slots=True)
class HeadRun:
    """When one head did what."""

    reached: Floats  # (j,) seconds at which it came to each stop; inf: it never did
    left: Floats  # (j,) and went on
    by: Ints  # (j,) head whose signal ended a wait for which it stood; -1: it did not stand
    begin: Floats  # (m,) seconds at which each move began; inf: it never did
    end: Floats  # (m,)
    end_s: float  # when it has done all; inf: it never did

    __repr__ = brief("end_s", "begin", "reached")


@dataclass(frozen=True, slots=True)
class Run:
    """What all heads did."""

    heads: tuple[HeadRun, ...]
    stuck: tuple[tuple[int, int], ...]  # head and stop of each wait that never ended


def carry_out(
    programs: Sequence[HeadProgram], seconds: Sequence[Floats], error: Sequence[Error],
    rest_s: float,
) -> Run:  # fmt: skip
    """Carry out programs whose moves take so many seconds, (m,) each, with errors of time."""
    first = np.cumsum([0, *(len(p.stops) + 1 for p in programs)]).astype(np.int64)
    kind, number, value, work = (np.zeros(first[-1], t) for t in (np.int64, np.int64, float, float))
    late = [s * e.factor + e.stall_s for s, e in zip(seconds, error, strict=True)]
    for h, program in enumerate(programs):
        rows = slice(int(first[h]) + 1, int(first[h + 1]))
        stops, cumulated = program.stops, np.concatenate([[0.0], np.cumsum(late[h])])
        places = np.concatenate([[0], stops.before, [len(late[h])]])
        kind[rows], number[rows], value[rows] = stops.kind, stops.number, stops.value
        kind[first[h]] = -1  # where it starts
        work[first[h] : first[h + 1]] = np.diff(cumulated[places])
    reached, left, by = np.full(first[-1], NEVER), np.full(first[-1], NEVER), np.full(first[-1], -1)
    given = np.full(int(number.max(initial=0)) + 1, NEVER)
    giver = np.full(len(given), -1)
    done = np.zeros(len(programs), np.int64)
    ends = np.full(len(programs), NEVER)
    hot_ends = np.array(
        [(p.hot_end.warm_c, p.hot_end.heat_c_s, p.hot_end.cool_c_s) for p in programs], np.float64
    ).reshape(-1, 3)
    _run(
        first, kind, number, value, work, rest_s, hot_ends, reached, left, by, given, giver, done,
        ends,
    )  # fmt: skip
    heads = []
    for h, program in enumerate(programs):
        rows = slice(int(first[h]) + 1, int(first[h + 1]))
        begin = _begins(program.stops, late[h], left[rows.start - 1 : rows.stop])
        end = begin + late[h]
        heads.append(HeadRun(reached[rows], left[rows], by[rows], begin, end, float(ends[h])))
    stuck = np.flatnonzero(done < np.diff(first))
    return Run(tuple(heads), tuple((h, int(done[h]) - 1) for h in stuck.tolist()))


def _begins(stops: Stops, seconds: Floats, gone: Floats) -> Floats:
    """Return when moves begin, (m,): each so long after the last stop, or the start, was left."""
    until = np.concatenate([[0.0], np.cumsum(seconds)])
    stop = np.searchsorted(stops.before, np.arange(len(seconds)), side="right")
    origin = until[np.concatenate([[0], stops.before])][stop]
    return np.asarray(gone[stop] + until[:-1] - origin)


@compiled
def _run(
    first: Ints, kind: Ints, number: Ints, value: Floats, work: Floats, rest_s: float,
    hot_ends: Floats, reached: Floats, left: Floats, by: Ints, given: Floats, giver: Ints,
    done: Ints, ends: Floats,
) -> None:  # fmt: skip
    """Carry all heads as far as they go, in place; `done` counts the stops each has passed.

    `hot_ends` has of each head how warm it is, and by how much it warms and cools a second.
    """
    heads = len(done)
    warm, due, since = hot_ends[:, 0].copy(), hot_ends[:, 0].copy(), np.zeros(heads)
    clock, stopped = np.zeros(heads), np.zeros(heads, np.bool_)
    moved = True
    while moved:
        moved = False
        for h in range(heads):
            while first[h] + done[h] < first[h + 1]:
                j = first[h] + done[h]
                now = clock[h]
                reached[j] = now
                if kind[j] == _WAIT:
                    ready = given[number[j]] + value[j]
                    if ready == np.inf:
                        break
                    if ready > now:
                        by[j] = giver[number[j]]
                        now = ready
                    stopped[h] = True
                elif kind[j] == _DWELL:
                    now += value[j]
                elif kind[j] == _TARGET or kind[j] == _HEAT:
                    gap, passed = due[h] - warm[h], now - since[h]
                    if gap > 0.0:
                        warm[h] += min(gap, passed * hot_ends[h, 1])
                    else:
                        warm[h] -= min(-gap, passed * hot_ends[h, 2])
                    due[h] = value[j]
                    if kind[j] == _HEAT and value[j] > warm[h]:
                        now += (value[j] - warm[h]) / hot_ends[h, 1]
                        warm[h] = value[j]
                    since[h] = now
                elif kind[j] == _SIGNAL or kind[j] == _PASS:
                    given[number[j]], giver[number[j]] = now, h
                    stopped[h] = stopped[h] or kind[j] == _SIGNAL
                if work[j] > 0.0 and stopped[h]:
                    now += rest_s
                    stopped[h] = False
                left[j] = now
                clock[h] = now + work[j]
                done[h] += 1
                moved = True
            if first[h] + done[h] == first[h + 1]:
                ends[h] = clock[h]
