"""Which travels precedence leaves possible, and which of them cost least at given prices.

A contour has one or more choices, as sliced and reversed, and a choice may have
several pairs of points, as the entries of a loop. A travel from one contour to
another is as cheap as the cheapest from a choice of the one to a choice of the other.
The search for the cheapest is exact: contours, and runs of 64, are skipped only
when nothing in them can be among the cheapest.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import kernel
from decmcts.search.sequence.metric_kernels import Metric, distance, price

WORD = 64  # contours looked at or skipped together
ALL = np.uint64(2**64 - 1)
NONE = -1
LOOKS = 4  # pairs of points that are looked at sooner than their boxes


class Choices(NamedTuple):
    """The choices for each contour; those of contour c are offsets[c]:offsets[c + 1]."""

    metric: Metric
    offsets: Ints  # (n + 1,)
    pairs: Ints  # (w + 1,) choice w has into and out pairs[w]:pairs[w + 1]
    into: Ints  # (p,) point of the metric that is entered at
    out: Ints  # (p,) and the one left at


class Boxes(NamedTuple):
    """Bounds in space, least and largest x, y, z."""

    enter: Floats  # (n, 6) of the points a contour may be entered at
    leave: Floats  # (n, 6) of those it may be left at
    words: Floats  # (ceil(n / 64), 6) of `leave` of 64 contours


class PossibleTravels(NamedTuple):
    """Which contours may be neighbours in an order."""

    related: NDArray[np.uint64]  # (n, ceil(n / 64)) bits: itself, before, after, or no contour
    offsets: Ints  # (n + 1,)
    covers: Int32s  # direct predecessors; exclusive travels are always listed


class Prices(NamedTuple):
    """What a travel costs besides, in the metric's unit."""

    leave: Floats  # (n + 1,) to leave a contour; n is the root
    by_choice: Floats  # (w,) paid leaving by a choice, got back entering by it
    zone: Ints  # (n,)
    crossing: Floats  # (zones, zones) refund from zone to zone


@kernel
def is_before(rows: NDArray[np.uint64], a: int, b: int) -> bool:
    """Tell whether a must be printed before b."""
    return bool((rows[b, a >> 6] >> np.uint64(a & 63)) & np.uint64(1))


@kernel
def cover_mask(rows: NDArray[np.uint64], offsets: Ints, preds: Int32s) -> Flags:
    """Tell which stored edges, each once, have nothing forced between their ends, (m,)."""
    kept = np.ones(len(preds), np.bool_)
    for b in range(len(offsets) - 1):
        for e in range(offsets[b], offsets[b + 1]):
            for f in range(offsets[b], offsets[b + 1]):
                if is_before(rows, preds[e], preds[f]) or (f < e and preds[f] == preds[e]):
                    kept[e] = False
                    break
    return kept


@kernel
def add_descendants(succ_offsets: Ints, succs: Int32s, rows: NDArray[np.uint64]) -> None:
    """Make of ancestors (n, ceil(n / 64)) all that is related, and bar bits of no contour."""
    n, words = rows.shape
    after = np.zeros((n, words), np.uint64)
    for a in range(n - 1, -1, -1):
        own = a // WORD
        after[a, own] |= np.uint64(1) << np.uint64(a % WORD)
        for e in range(succ_offsets[a], succ_offsets[a + 1]):
            for w in range(own, words):
                after[a, w] |= after[succs[e], w]
        for w in range(own, words):
            rows[a, w] |= after[a, w]
        if n % WORD:
            rows[a, words - 1] |= ALL << np.uint64(n % WORD)


@kernel
def box_price(metric: Metric, one: Floats, other: Floats) -> float:
    """Return what a travel between two boxes costs at least."""
    dx = max(one[0] - other[3], other[0] - one[3], 0.0)
    dy = max(one[1] - other[4], other[1] - one[4], 0.0)
    dz = max(one[2] - other[5], other[2] - one[5], 0.0)
    return float(price(metric, math.sqrt(dx * dx + dy * dy), dz))


@kernel
def choice_cost(choices: Choices, p: int, q: int) -> float:
    """Return what the cheapest travel from choice p to choice q costs without prices."""
    least = np.inf
    for a in range(choices.pairs[p], choices.pairs[p + 1]):
        for b in range(choices.pairs[q], choices.pairs[q + 1]):
            least = min(least, distance(choices.metric, choices.out[a], choices.into[b]))
    return float(least)


@kernel
def travel_price(choices: Choices, prices: Prices, i: int, j: int) -> float:
    """Return what the cheapest travel from contour i to contour j costs at these prices."""
    least = np.inf
    for p in range(choices.offsets[i], choices.offsets[i + 1]):
        for q in range(choices.offsets[j], choices.offsets[j + 1]):
            least = min(
                least, choice_cost(choices, p, q) + prices.by_choice[p] - prices.by_choice[q]
            )
    return float(least + prices.leave[i] - prices.crossing[prices.zone[i], prices.zone[j]])


@kernel
def insert(cost: Floats, tails: Ints, value: float, tail: int) -> None:
    """Mutate the sorted lists: put (value, tail) in its place, drop the last."""
    x = len(cost) - 1
    while x > 0 and cost[x - 1] > value:
        cost[x] = cost[x - 1]
        tails[x] = tails[x - 1]
        x -= 1
    cost[x] = value
    tails[x] = tail


class Extremes(NamedTuple):
    """What prices come to at the least and at the most."""

    paid: Floats  # (n,) to leave a contour by its cheapest choice, without refunds
    word: Floats  # (ceil(n / 64),) the least of 64 contours
    back: Floats  # (n,) got back entering a contour by its best choice


@kernel
def extremes_of(choices: Choices, prices: Prices) -> Extremes:
    """Return the extremes of prices."""
    n = len(choices.offsets) - 1
    paid, back, word = np.empty(n), np.empty(n), np.full((n + WORD - 1) // WORD, np.inf)
    for c in range(n):
        low, high = np.inf, -np.inf
        for w in range(choices.offsets[c], choices.offsets[c + 1]):
            low, high = min(low, prices.by_choice[w]), max(high, prices.by_choice[w])
        paid[c], back[c] = prices.leave[c] + low, high
        word[c // WORD] = min(word[c // WORD], paid[c])
    return Extremes(paid, word, back)


@kernel
def pairs_of_points(choices: Choices, c: int) -> int:
    """Return how many pairs of points all choices of a contour have."""
    return int(choices.pairs[choices.offsets[c + 1]] - choices.pairs[choices.offsets[c]])


@kernel
def offer(
    choices: Choices,
    boxes: Boxes,
    prices: Prices,
    extremes: Extremes,
    i: int,
    j: int,
    cost: Floats,
    tails: Ints,
) -> None:
    """Mutate the sorted lists: enter the travel from i to j if it is cheap enough."""
    if pairs_of_points(choices, i) * pairs_of_points(choices, j) > LOOKS:
        least = box_price(choices.metric, boxes.leave[i], boxes.enter[j])
        least += extremes.paid[i] - extremes.back[j]
        if least - prices.crossing[prices.zone[i], prices.zone[j]] >= cost[-1]:
            return
    value = travel_price(choices, prices, i, j)
    if value < cost[-1]:
        insert(cost, tails, value, i)


@kernel
def cheapest_tails(
    choices: Choices,
    boxes: Boxes,
    rule: PossibleTravels,
    prices: Prices,
    extremes: Extremes,
    j: int,
    cost: Floats,
    tails: Ints,
) -> None:
    """Fill `cost` (infinite) and `tails` with the cheapest possible travels to j, sorted.

    Possible are travels from direct predecessors and from unrelated contours; those
    that `rule` leaves out are not looked at.
    """
    got = extremes.back[j] + prices.crossing[:, prices.zone[j]].max()
    for e in range(rule.offsets[j], rule.offsets[j + 1]):
        offer(choices, boxes, prices, extremes, rule.covers[e], j, cost, tails)
    words = len(boxes.words)
    for step in range(2 * words):  # own word first: near ones soon rule out others
        w = j // WORD + ((step + 1) // 2 if step % 2 else -(step // 2))
        if w < 0 or w >= words or rule.related[j, w] == ALL:
            continue
        related = rule.related[j, w]
        near = box_price(choices.metric, boxes.enter[j], boxes.words[w])
        if near + extremes.word[w] - got >= cost[-1]:
            continue
        for x in range(WORD):
            if not (related >> np.uint64(x)) & np.uint64(1):
                offer(choices, boxes, prices, extremes, w * WORD + x, j, cost, tails)


@kernel
def price_travels(
    choices: Choices, boxes: Boxes, rule: PossibleTravels, prices: Prices, width: int
) -> tuple[Ints, Floats]:
    """Return from where the `width` cheapest travels lead to each contour, and the rest's least.

    Returns
    -------
    tails : (n, width)
        NONE where there are fewer.
    rest : (n,)
        No possible travel to the contour that is neither listed nor left out by
        `rule` costs less; infinite if all are listed.
    """
    n = len(boxes.enter)
    tails, rest = np.full((n, width), NONE, np.int64), np.empty(n)
    cost = np.empty(width)
    extremes = extremes_of(choices, prices)
    for j in range(n):
        cost[:] = np.inf
        cheapest_tails(choices, boxes, rule, prices, extremes, j, cost, tails[j])
        rest[j] = cost[-1]
    return tails, rest


@kernel
def travel_costs(choices: Choices, tails: Ints, heads: Ints) -> Floats:
    """Return what travels cost without prices, (m, 4): from choice x to choice y in column 2x + y.

    No contour has more than two choices; the root, tail n, has none.
    """
    cost = np.full((len(tails), 4), np.inf)
    for e in range(len(tails)):
        if tails[e] == len(choices.offsets) - 1:
            continue
        p, q = choices.offsets[tails[e]], choices.offsets[heads[e]]
        for x in range(choices.offsets[tails[e] + 1] - p):
            for y in range(choices.offsets[heads[e] + 1] - q):
                cost[e, 2 * x + y] = choice_cost(choices, p + x, q + y)
    return cost


@kernel
def cheapest_choices(
    offsets: Ints,
    i: int,
    j: int,
    cost: Floats,
    choice: Floats,
) -> tuple[float, int, int]:
    """Return price and choices of the cheapest travel from i to j; the root has choice -1.

    `cost` (4,) is a row of `travel_costs`.
    """
    q = offsets[j]
    if i == len(offsets) - 1:
        for y in range(q + 1, offsets[j + 1]):
            q = y if choice[y] > choice[q] else q
        return float(-choice[q]), -1, int(q)
    p, least, leave, enter = offsets[i], np.inf, -1, -1
    for x in range(offsets[i + 1] - p):
        for y in range(offsets[j + 1] - q):
            value = cost[2 * x + y] + choice[p + x] - choice[q + y]
            if value < least:
                least, leave, enter = value, p + x, q + y
    return float(least), int(leave), int(enter)


@kernel
def arc_weights(
    offsets: Ints,
    tails: Ints,
    heads: Ints,
    cost: Floats,
    prices: Prices,
    weight: Floats,
) -> None:
    """Write what each arc costs at these prices; the root is the tail n."""
    root = len(offsets) - 1
    for e in range(len(tails)):
        i, j = tails[e], heads[e]
        weight[e] = prices.leave[i] + cheapest_choices(offsets, i, j, cost[e], prices.by_choice)[0]
        if i != root:
            weight[e] -= prices.crossing[prices.zone[i], prices.zone[j]]


@kernel
def used_choices(offsets: Ints, tails: Ints, heads: Ints, cost: Floats, choice: Floats) -> Floats:
    """Return how often arcs leave by each choice, less how often they enter by it, (w,)."""
    used = np.zeros(len(choice))
    for e in range(len(tails)):
        _, leave, enter = cheapest_choices(offsets, tails[e], heads[e], cost[e], choice)
        if leave >= 0:
            used[leave] += 1.0
        used[enter] -= 1.0
    return used
