"""The best order of a stretch of a sequence, exactly: what a search may have left undone.

Some dozens of contours that follow each other are printed in their best order, by
dynamic programming over order ideals, with what comes before and behind held fast.
Ideals from which a lower bound on the rest leads to no less than the stretch costs
now are given up, so a stretch that is optimal already is soon known to be.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.ideals import (
    NOWHERE,
    WINDOW,
    Ideals,
    Rules,
    Stand,
    extend,
    price_steps,
    trace,
)
from decmcts._kernels.jit import kernel
from decmcts._kernels.metric import distance, points_of
from decmcts._kernels.moves import Tour, entry, leave, refresh
from decmcts._kernels.pricing import NONE, Ways
from decmcts._kernels.random import below

LONGEST = WINDOW - 2  # positions of a stretch
_ONE = np.uint64(1)
_LEAST_GAIN = 1e-9  # mm or s
_ASCENTS = 100  # of the lower bound on a stretch, at most
_PATIENCE, _LEAST_SCALE = 5, 0.05  # ascents in vain before their steps are halved, how far
_SHORTEST = 8.0  # positions
_LONGER, _SHORTER = 1.01, 0.9  # after a stretch that was solved, and one that was not


@kernel
def _ways_of(tour: Tour, first: int, last: int) -> Ways:
    """Return the ways to print positions [first, last); the guards at its ends have one each."""
    order, n, most = tour.order, len(tour.order), 0
    for p in range(first, last):
        c = order[p]
        most += 2 + int(tour.seat_offsets[c + 1] - tour.seat_offsets[c])
    offsets = np.zeros(last - first + 1, np.int64)
    into, out, count = np.empty(most, np.int64), np.empty(most, np.int64), 0
    for p in range(first, last):
        c = order[p]
        guard = (p == first and first > 0) or (p == last - 1 and last < n)
        if tour.seat[c] >= 0 and not guard:
            for option in range(tour.seat_offsets[c], tour.seat_offsets[c + 1]):
                into[count], out[count] = 2 * n + 2 * option, 2 * n + 2 * option + 1
                count += 1
        else:
            into[count], out[count] = entry(tour.flip, c), leave(tour.flip, c)
            count += 1
            if tour.turns[c] and not guard:
                into[count], out[count] = out[count - 1], into[count - 1]
                count += 1
        offsets[p - first + 1] = count
    return Ways(tour.metric, offsets, np.arange(count + 1), into[:count], out[:count])


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
def _rules_of(before: NDArray[np.uint64], slack: float) -> Rules:
    """Return which contour may follow on an ideal."""
    k = len(before)
    reach, needed = np.empty(k, np.int64), np.zeros(k, np.uint64)
    for j in range(k):
        needed[j] = before[j] << np.uint64(WINDOW - j) if j > 0 else np.uint64(0)
        reach[j] = j
        for i in range(j):
            if not (before[j] >> np.uint64(i)) & _ONE:
                reach[i] = j
    return Rules(reach, needed, slack)


class Prices(NamedTuple):
    """What is paid besides the travels, so that the cheapest entries bound a sequence.

    A price is paid at leaving by a way and got back at entering by it: in all a sequence pays
    that of its first way less that of its last.
    """

    node: NDArray[np.int64]  # (w,) the price each way has
    value: NDArray[np.float64]  # (nodes,)
    least: NDArray[np.float64]  # (k,) cheapest entry into each contour, after prices


@kernel
def _nodes_of(ways: Ways) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the price of each way, (w,), and the first of each contour, (k + 1,).

    Each way has one, but all ways of a loop that may be entered at many vertices share one.
    """
    k = len(ways.offsets) - 1
    node, first = np.empty(len(ways.into), np.int64), np.zeros(k + 1, np.int64)
    for c in range(k):
        count = ways.offsets[c + 1] - ways.offsets[c]
        for w in range(count):
            node[ways.offsets[c] + w] = first[c] + (w if count == 2 else 0)
        first[c + 1] = first[c] + (2 if count == 2 else 1)
    return node, first


@kernel
def _travels(
    ways: Ways, before: NDArray[np.uint64], node: NDArray[np.int64], nodes: int
) -> NDArray[np.float64]:
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
            for w in range(ways.offsets[i], ways.offsets[i + 1]):
                for v in range(ways.offsets[j], ways.offsets[j + 1]):
                    cost = distance(ways.metric, ways.out[w], ways.into[v])
                    if cost < travel[node[v], node[w]]:
                        travel[node[v], node[w]] = cost
    return travel


@kernel
def _entries(
    travel: NDArray[np.float64],
    first: NDArray[np.int64],
    price: NDArray[np.float64],
    least: NDArray[np.float64],
    slope: NDArray[np.float64],
) -> float:
    """Mutate `least` and `slope`; return the sum of the cheapest entries, all but the first's.

    The slope is how that sum grows with each price.
    """
    total = 0.0
    slope[:] = 0.0
    for j in range(len(least)):
        cheapest, into, out = np.inf, first[j], 0
        for v in range(first[j], first[j + 1]):
            for w in range(len(price)):
                cost = travel[v, w] - price[w] + price[v]
                if cost < cheapest:
                    cheapest, into, out = cost, v, w
        least[j] = cheapest
        if j > 0:
            total += cheapest
            slope[into] += 1.0
            slope[out] -= 1.0
    return total


@kernel
def _priced(
    ways: Ways, before: NDArray[np.uint64], most: float, fixed: bool
) -> tuple[Prices, float]:
    """Return prices and the lower bound they give, by subgradient ascent towards `most`.

    If the ends are not `fixed`, all prices are 0, and the bound is not known.
    """
    node, first = _nodes_of(ways)
    m = int(first[-1])
    travel = _travels(ways, before, node, m)
    price, slope, least = np.zeros(m), np.empty(m), np.zeros(len(before))
    best_price, best_least, best, scale, vain = price.copy(), least.copy(), -np.inf, 1.0, 0
    for _ in range(_ASCENTS if fixed else 1):
        bound = price[0] - price[-1] + _entries(travel, first, price, least, slope)
        slope[0] += 1.0
        slope[-1] -= 1.0
        if bound > best:
            best, vain = bound, 0
            best_price[:], best_least[:] = price, least
        else:
            vain += 1
            if vain == _PATIENCE:
                vain, scale = 0, scale / 2
        norm = (slope * slope).sum()
        if best >= most or norm == 0.0 or scale < _LEAST_SCALE:
            break
        price += slope * (scale * (most - bound) / norm)
    return Prices(node, best_price, best_least), best if fixed else -np.inf


@kernel
def _give_up(ideals: Ideals, ways: Ways, at: Stand, prices: Prices, most: float) -> int:
    """Mutate the newest ideals: drop what cannot end below `most`; return how many are left."""
    alive = 0
    for i in range(at.first, at.ideals):
        rest, bits = -prices.value[-1], ideals.bits[i]
        for j in range(ideals.lacks[i], len(prices.least)):
            if not bits & _ONE:
                rest += prices.least[j]
            bits >>= _ONE
        e, hope = ideals.newest[i], False
        while e != NONE:
            w = ways.offsets[ideals.contour[e]]
            for x in range(ideals.base[e], ideals.base[e + 1]):
                after = rest + prices.value[prices.node[w + x - ideals.base[e]]]
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
def _print_so(
    tour: Tour, first: int, ways: Ways, order: NDArray[np.int32], way: NDArray[np.int64]
) -> None:
    """Mutate the tour: positions from `first` on in this order, in these ways."""
    n, k = len(tour.order), len(order)
    old, points = tour.order[first : first + k].copy(), points_of(tour.metric)
    for x in range(k):
        c, into = old[order[x]], ways.into[way[x]]
        tour.order[first + x], tour.position[c] = c, first + x
        if into >= 2 * n:
            tour.seat[c] = (into - 2 * n) // 2
            for port in range(2):
                for axis in range(3):
                    points[2 * c + port, axis] = points[into + port, axis]
        else:
            tour.flip[c] = into - 2 * c
    refresh(tour, first - 1, first + k)


@kernel
def solve_stretch(
    tour: Tour, ideals: Ideals, first: int, last: int, slack: float, widest: int
) -> tuple[bool, int]:
    """Mutate the tour: positions [first, last), `LONGEST` at most, in their best order.

    The first and the last of them stay unless they begin or end the tour. Returns whether
    the order is the best now, and the travels priced; more than `widest` steps from the
    ideals of a level, or no room, are too much.
    """
    cost = 0.0
    for p in range(first, last - 1):
        cost += tour.after[tour.order[p]]
    ways, before = _ways_of(tour, first, last), _before(tour, first, last)
    rules, most = _rules_of(before, slack), cost - _LEAST_GAIN
    fixed = first > 0 and last < len(tour.order)
    prices, bound = _priced(ways, before, most, fixed)
    if bound >= most:
        return True, 0
    ideals.slots[:] = -1
    ideals.lacks[0] = ideals.begin[0] = ideals.ports[0] = ideals.base[0] = 0
    ideals.bits[0], ideals.newest[0] = 0, NONE
    at = Stand(0, 0, 1, 0, False)
    while at.level < last - first:
        then = extend(ideals, ways, rules, at, widest)
        if then.full:
            return False, at.travels
        price_steps(ideals, ways, rules, at.first, at.ideals)
        at = then
        if _give_up(ideals, ways, at, prices, most) == 0:
            return True, at.travels
    _, order, way = trace(ideals, ways, at.first)
    _print_so(tour, first, ways, order, way)
    return True, at.travels


@kernel
def solve_stretches(
    tour: Tour,
    ideals: Ideals,
    state: NDArray[np.uint64],
    length: float,
    slack: float,
    widest: int,
    quota: int,
) -> tuple[float, int]:
    """Mutate the tour: stretch after stretch in its best order, from a random one on.

    Each is about `length` long, longer while they are solved, shorter where they are not.
    Returns the length to go on with, and the steps made, `quota` or somewhat more.
    """
    n, made = len(tour.order), 0
    first = below(state, n)
    while made < quota:
        positions = min(int(length), n)
        first = min(first, n - positions)
        solved, travels = solve_stretch(tour, ideals, first, first + positions, slack, widest)
        made += travels + positions * positions
        length = min(length * _LONGER, LONGEST) if solved else max(length * _SHORTER, _SHORTEST)
        first = first + positions // 2 if first + positions < n else 0
    return length, made
