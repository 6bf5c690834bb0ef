"""The best order of a window of a sequence, exactly: what a search may have left undone.

Some dozens of contours that follow each other are printed in their best order, by
dynamic programming over order ideals, with what comes before and behind held fast.
Ideals from which a lower bound on the rest leads to no less than the window costs
now are given up, so a window that is optimal already is soon known to be.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.random_kernels import below
from decmcts.search.bounds.ideals_kernels import (
    NOWHERE,
    WINDOW,
    Frontier,
    IdealRules,
    Ideals,
    extend,
    price_steps,
    reset,
    trace,
)
from decmcts.search.bounds.pricing_kernels import NONE, Choices
from decmcts.search.sequence.entries_kernels import use_entry
from decmcts.search.sequence.metric_kernels import distance
from decmcts.search.sequence.moves_kernels import Tour, port_in, port_out, refresh

LONGEST = WINDOW - 2  # positions of a window
_ONE = np.uint64(1)
_LEAST_GAIN = 1e-9  # mm or s
_ASCENTS = 100  # of the lower bound on a window, at most
_IN_VAIN = 5  # ascents, before their steps are halved
_LEAST_SCALE = 0.05  # of a step; then it ends
_MOST_CHOICES = 2000  # of all contours of a window; travels between all are looked at first
_LOOKS = 32  # travels looked at while one is priced, about
_SHORTEST = 8.0  # positions
_LONGER, _SHORTER = 1.01, 0.9  # after a window that was solved, and one that was not


@kernel
def _choices_of(tour: Tour, first: int, last: int) -> Choices:
    """Return the choices for positions [first, last); the guards at its ends have one each."""
    order, n, most = tour.order, len(tour.order), 0
    for p in range(first, last):
        c = order[p]
        most += 2 + int(tour.entry_offsets[c + 1] - tour.entry_offsets[c])
    offsets = np.zeros(last - first + 1, np.int64)
    into, out, count = np.empty(most, np.int64), np.empty(most, np.int64), 0
    for p in range(first, last):
        c = order[p]
        guard = (p == first and first > 0) or (p == last - 1 and last < n)
        if tour.entry_id[c] >= 0 and not guard:
            for entry in range(tour.entry_offsets[c], tour.entry_offsets[c + 1]):
                into[count], out[count] = 2 * n + 2 * entry, 2 * n + 2 * entry + 1
                count += 1
        else:
            into[count], out[count] = port_in(tour.reversed, c), port_out(tour.reversed, c)
            count += 1
            if tour.reversible[c] and not guard:
                into[count], out[count] = out[count - 1], into[count - 1]
                count += 1
        offsets[p - first + 1] = count
    return Choices(tour.metric, offsets, np.arange(count + 1), into[:count], out[:count])


@kernel
def _before(tour: Tour, first: int, last: int) -> NDArray[np.uint64]:
    """Return what must be printed before each position of [first, last), as bits, (k,)."""
    before = np.zeros(last - first, np.uint64)
    for p in range(first, last):
        for e in range(tour.pred_offsets[tour.order[p]], tour.pred_offsets[tour.order[p] + 1]):
            at = tour.position[tour.preds[e]] - first
            if at >= 0:
                before[p - first] |= before[at] | (_ONE << np.uint64(at))
    if first > 0:
        before[1:] |= _ONE
    if last < len(tour.order):
        before[-1] = (_ONE << np.uint64(last - first - 1)) - _ONE
    return before


@kernel
def _rules_of(before: NDArray[np.uint64], slack: float) -> IdealRules:
    """Return which contour may follow on an ideal."""
    k = len(before)
    reach, needed = np.empty(k, np.int64), np.zeros(k, np.uint64)
    for j in range(k):
        needed[j] = before[j] << np.uint64(WINDOW - j) if j > 0 else np.uint64(0)
        reach[j] = j
        for i in range(j):
            if not (before[j] >> np.uint64(i)) & _ONE:
                reach[i] = j
    return IdealRules(reach, needed, slack)


class Potentials(NamedTuple):
    """Node potentials, by which the cheapest entries bound what a sequence costs.

    A potential is got back at leaving by a choice and paid at entering by it: in all a
    sequence pays that of its last choice less that of its first.
    """

    node: Ints  # (w,) of each choice
    value: Floats  # (nodes,)
    least: Floats  # (k,) cheapest entry into each contour, with potentials


@kernel
def _nodes_of(choices: Choices) -> tuple[Ints, Ints]:
    """Return the node of each choice, (w,), and the first of each contour, (k + 1,).

    Each choice is one, but all of a loop that may be entered at many vertices are one
    together.
    """
    k = len(choices.offsets) - 1
    node, first = np.empty(len(choices.into), np.int64), np.zeros(k + 1, np.int64)
    for c in range(k):
        count = choices.offsets[c + 1] - choices.offsets[c]
        for w in range(count):
            node[choices.offsets[c] + w] = first[c] + (w if count == 2 else 0)
        first[c + 1] = first[c] + (2 if count == 2 else 1)
    return node, first


@kernel
def _travels(choices: Choices, before: NDArray[np.uint64], node: Ints, nodes: int) -> Floats:
    """Return the least travel from node to node, (nodes, nodes), infinite where impossible."""
    k = len(before)
    travel = np.full((nodes, nodes), np.inf)
    for j in range(k):
        between = np.uint64(0)  # before what is before it: no neighbour
        for i in range(j):
            if (before[j] >> np.uint64(i)) & _ONE:
                between |= before[i]
        for i in range(k):
            if i == j or (before[i] >> np.uint64(j)) & _ONE or (between >> np.uint64(i)) & _ONE:
                continue
            for w in range(choices.offsets[i], choices.offsets[i + 1]):
                for v in range(choices.offsets[j], choices.offsets[j + 1]):
                    cost = distance(choices.metric, choices.out[w], choices.into[v])
                    if cost < travel[node[v], node[w]]:
                        travel[node[v], node[w]] = cost
    return travel


@kernel
def _entries(travel: Floats, first: Ints, value: Floats, least: Floats, slope: Floats) -> float:
    """Mutate `least` and `slope`; return the sum of the cheapest entries, all but the first's.

    The slope is how that sum grows with each potential.
    """
    total = 0.0
    slope[:] = 0.0
    for j in range(len(least)):
        cheapest, into, out = np.inf, first[j], 0
        for v in range(first[j], first[j + 1]):
            for w in range(len(value)):
                cost = travel[v, w] - value[w] + value[v]
                if cost < cheapest:
                    cheapest, into, out = cost, v, w
        least[j] = cheapest
        if j > 0:
            total += cheapest
            slope[into] += 1.0
            slope[out] -= 1.0
    return total


@kernel
def _bounded(
    choices: Choices, before: NDArray[np.uint64], most: float, fixed: bool
) -> tuple[Potentials, float, int]:
    """Return potentials and the lower bound they give, by subgradient ascent towards `most`.

    If the ends are not `fixed`, all potentials are 0, and nothing is said of the whole.
    The last number is how many travels were looked at.
    """
    node, first = _nodes_of(choices)
    m = int(first[-1])
    travel, looks = _travels(choices, before, node, m), len(choices.into) ** 2
    value, slope, least = np.zeros(m), np.empty(m), np.zeros(len(before))
    best_value, best_least, best, scale, vain = value.copy(), least.copy(), -np.inf, 1.0, 0
    for _ in range(_ASCENTS if fixed else 1):
        bound = value[0] - value[-1] + _entries(travel, first, value, least, slope)
        looks += m * m
        slope[0] += 1.0
        slope[-1] -= 1.0
        if bound > best:
            best, vain = bound, 0
            best_value[:], best_least[:] = value, least
        else:
            vain += 1
            if vain == _IN_VAIN:
                vain, scale = 0, scale / 2
        norm = (slope * slope).sum()
        if best >= most or norm == 0.0 or scale < _LEAST_SCALE:
            break
        value += slope * (scale * (most - bound) / norm)
    return Potentials(node, best_value, best_least), best if fixed else -np.inf, looks


@kernel
def _give_up(
    ideals: Ideals, choices: Choices, at: Frontier, bounds: Potentials, most: float
) -> int:
    """Mutate the newest ideals: drop what cannot end below `most`; return how many are left."""
    alive = 0
    for i in range(at.first, at.ideals):
        rest, bits = -bounds.value[-1], ideals.bits[i]
        for j in range(ideals.lacks[i], len(bounds.least)):
            if not bits & _ONE:
                rest += bounds.least[j]
            bits >>= _ONE
        e, hope = ideals.newest[i], False
        while e != NONE:
            w = choices.offsets[ideals.contour[e]]
            for x in range(ideals.base[e], ideals.base[e + 1]):
                after = rest + bounds.value[bounds.node[w + x - ideals.base[e]]]
                if ideals.travel[x] + after >= most:
                    ideals.travel[x] = np.inf
                else:
                    hope = True
            e = ideals.older[e]
        if hope:
            alive += 1
        else:
            ideals.bits[i] = NOWHERE
    return alive


@kernel
def _apply_order(tour: Tour, first: int, choices: Choices, order: Int32s, choice: Ints) -> None:
    """Mutate the tour: positions from `first` on in this order, in these choices."""
    n, k = len(tour.order), len(order)
    old = tour.order[first : first + k].copy()
    for x in range(k):
        c, into = old[order[x]], choices.into[choice[x]]
        tour.order[first + x], tour.position[c] = c, first + x
        if into >= 2 * n:
            use_entry(tour, first + x, (into - 2 * n) // 2)
        else:
            tour.reversed[c] = into - 2 * c
    refresh(tour, first - 1, first + k)


@kernel
def solve_window(
    tour: Tour, ideals: Ideals, first: int, last: int, slack: float, widest: int, limit: int
) -> tuple[bool, int]:
    """Mutate the tour: positions [first, last), `LONGEST` at most, in their best order.

    The first and the last of them stay unless they begin or end the tour; its groups are
    not heeded. Returns whether no order of them costs less now, and the travels priced or
    as much work; `limit` of them, or `widest` steps from the ideals of a level, are too much.
    """
    cost = 0.0
    for p in range(first, last - 1):
        cost += tour.after[tour.order[p]]
    choices = _choices_of(tour, first, last)
    if len(choices.into) > _MOST_CHOICES:
        return False, 0
    before, most = _before(tour, first, last), cost - _LEAST_GAIN
    rules, fixed = _rules_of(before, slack), first > 0 and last < len(tour.order)
    bounds, bound, looks = _bounded(choices, before, most, fixed)
    work = looks // _LOOKS
    if bound >= most:
        return True, work
    at = reset(ideals)
    while at.level < last - first:
        then = extend(ideals, choices, rules, at, widest)
        if then.full or then.travels > limit:
            return False, at.travels + work
        price_steps(ideals, choices, rules, at.first, at.ideals)
        at = then
        if _give_up(ideals, choices, at, bounds, most) == 0:
            return True, at.travels + work
    _, order, choice = trace(ideals, choices, at.first)
    _apply_order(tour, first, choices, order, choice)
    return True, at.travels + work


@kernel
def solve_windows(
    tour: Tour,
    ideals: Ideals,
    state: NDArray[np.uint64],
    length: float,
    slack: float,
    widest: int,
    limit: int,
    quota: int,
) -> tuple[float, int]:
    """Mutate the tour: window after window in its best order, from a random one on.

    Each is about `length` long, longer while they are solved, shorter where they are not.
    Returns the length to go on with, and the work done: about `quota`, less if the whole
    tour is one window and solved.
    """
    n, made = len(tour.order), 0
    first = below(state, n)
    while made < quota:
        positions = min(int(length), n)
        first = min(first, n - positions)
        last = first + positions
        solved, work = solve_window(tour, ideals, first, last, slack, widest, limit)
        made += work + positions
        length = min(length * _LONGER, LONGEST) if solved else max(length * _SHORTER, _SHORTEST)
        if solved and positions == n:
            break
        first = first + positions // 2 if last < n else 0
    return length, made
