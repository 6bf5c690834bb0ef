"""Which travels precedence leaves possible, and which of them cost least at given prices.

A travel leads from an exit port to an entry port; port 2c is the start of contour
c and 2c + 1 its end. The search for the cheapest is exact: runs of 64 contours
are skipped only when nothing in them can be among the cheapest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel

WORD = 64  # contours looked at or skipped together
ALL = np.uint64(2**64 - 1)


class Places(NamedTuple):
    """Where contours begin and end."""

    ports: NDArray[np.float64]  # (2n, 3)
    turns: NDArray[np.bool_]  # (n,)
    boxes: NDArray[np.float64]  # (ceil(n / 64), 6) bounds of the exit ports of 64 contours


class Precedence(NamedTuple):
    """Which contours may be neighbours in an order."""

    related: NDArray[np.uint64]  # (n, ceil(n / 64)) bits: itself, before, after, or no contour
    offsets: NDArray[np.int64]  # (n + 1,)
    covers: NDArray[np.int32]  # direct predecessors; no contour is forced between


class Prices(NamedTuple):
    """What a travel costs besides its length, mm."""

    leave: NDArray[np.float64]  # (n + 1,) to leave a contour; n is the root
    turn: NDArray[np.float64]  # (n,) paid leaving forwards, got back entering forwards
    zone: NDArray[np.int64]  # (n,)
    crossing: NDArray[np.float64]  # (zones, zones) refund from zone to zone


@kernel
def is_before(rows: NDArray[np.uint64], a: int, b: int) -> bool:
    """Tell whether a must be printed before b."""
    return bool((rows[b, a >> 6] >> np.uint64(a & 63)) & np.uint64(1))


@kernel
def cover_mask(
    rows: NDArray[np.uint64], offsets: NDArray[np.int64], preds: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Tell which stored edges have nothing forced between their ends, (m,)."""
    kept = np.ones(len(preds), np.bool_)
    for b in range(len(offsets) - 1):
        for e in range(offsets[b], offsets[b + 1]):
            for f in range(offsets[b], offsets[b + 1]):
                if is_before(rows, preds[e], preds[f]):
                    kept[e] = False
                    break
    return kept


@kernel
def add_descendants(
    succ_offsets: NDArray[np.int64], succs: NDArray[np.int32], rows: NDArray[np.uint64]
) -> None:
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
def bound_words(places: Places) -> None:
    """Write the bounds of each 64 contours into `places`."""
    for w in range(len(places.boxes)):
        places.boxes[w, :3] = np.inf
        places.boxes[w, 3:] = -np.inf
        for c in range(w * WORD, min(len(places.turns), (w + 1) * WORD)):
            for port in range(2 * c if places.turns[c] else 2 * c + 1, 2 * c + 2):
                for axis in range(3):
                    value = places.ports[port, axis]
                    places.boxes[w, axis] = min(places.boxes[w, axis], value)
                    places.boxes[w, 3 + axis] = max(places.boxes[w, 3 + axis], value)


@kernel
def word_prices(places: Places, prices: Prices) -> NDArray[np.float64]:
    """Return the least that leaving any of each 64 contours costs, without refunds."""
    least = np.full(len(places.boxes), np.inf)
    for c in range(len(places.turns)):
        least[c // WORD] = min(least[c // WORD], prices.leave[c] - abs(prices.turn[c]))
    return least


@kernel
def distance_to_box(
    ports: NDArray[np.float64], port: int, boxes: NDArray[np.float64], b: int
) -> float:
    """Return the distance of a port from a box."""
    square = 0.0
    for axis in range(3):
        gap = max(boxes[b, axis] - ports[port, axis], ports[port, axis] - boxes[b, 3 + axis], 0.0)
        square += gap * gap
    return float(np.sqrt(square))


@kernel
def port_distance(ports: NDArray[np.float64], a: int, b: int) -> float:
    """Return the distance of two ports."""
    dx = ports[a, 0] - ports[b, 0]
    dy = ports[a, 1] - ports[b, 1]
    dz = ports[a, 2] - ports[b, 2]
    return float(np.sqrt(dx * dx + dy * dy + dz * dz))


@kernel
def travel_price(places: Places, prices: Prices, a: int, b: int) -> float:
    """Return what the travel from exit port a to entry port b costs at these prices."""
    i, j = a >> 1, b >> 1
    price = port_distance(places.ports, a, b) + prices.leave[i]
    price += prices.turn[i] if a & 1 else -prices.turn[i]
    price -= -prices.turn[j] if b & 1 else prices.turn[j]
    return float(price - prices.crossing[prices.zone[i], prices.zone[j]])


@kernel
def insert(cost: NDArray[np.float64], exits: NDArray[np.int64], value: float, port: int) -> None:
    """Mutate the sorted lists: put (value, port) in its place, drop the last."""
    x = len(cost) - 1
    while x > 0 and cost[x - 1] > value:
        cost[x] = cost[x - 1]
        exits[x] = exits[x - 1]
        x -= 1
    cost[x] = value
    exits[x] = port


@kernel
def offer(
    places: Places,
    prices: Prices,
    i: int,
    entry: int,
    cost: NDArray[np.float64],
    exits: NDArray[np.int64],
) -> None:
    """Mutate the sorted lists: enter the travels from contour i if they are cheap enough."""
    for port in range(2 * i if places.turns[i] else 2 * i + 1, 2 * i + 2):
        price = travel_price(places, prices, port, entry)
        if price < cost[-1]:
            insert(cost, exits, price, port)


@kernel
def cheapest_exits(
    places: Places,
    rule: Precedence,
    prices: Prices,
    least: NDArray[np.float64],
    entry: int,
    cost: NDArray[np.float64],
    exits: NDArray[np.int64],
) -> None:
    """Fill `cost` (infinite) and `exits` with the cheapest possible travels into a port, sorted.

    Possible are travels from direct predecessors and from unrelated contours.
    """
    j = entry >> 1
    got = abs(prices.turn[j]) + prices.crossing[:, prices.zone[j]].max()
    for e in range(rule.offsets[j], rule.offsets[j + 1]):
        offer(places, prices, rule.covers[e], entry, cost, exits)
    for step in range(2 * len(places.boxes)):  # own word first: near ones soon rule out others
        w = j // WORD + ((step + 1) // 2 if step % 2 else -(step // 2))
        if w < 0 or w >= len(places.boxes) or rule.related[j, w] == ALL:
            continue
        related = rule.related[j, w]
        near = distance_to_box(places.ports, entry, places.boxes, w)
        if near + least[w] - got >= cost[-1]:
            continue
        for x in range(WORD):
            if not (related >> np.uint64(x)) & np.uint64(1):
                offer(places, prices, w * WORD + x, entry, cost, exits)


@kernel
def price_travels(
    places: Places, rule: Precedence, prices: Prices, width: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the `width` cheapest exit ports for each entry port, and what the rest costs at least.

    Returns
    -------
    exits : (2n, width)
        NONE (-1) where there are fewer; a row of NONE for ports that are no entry.
    rest : (n,)
        No possible travel into the contour that is not listed costs less;
        infinite if all are listed.
    """
    n = len(places.turns)
    exits = np.full((2 * n, width), -1, np.int64)
    rest = np.full(n, np.inf)
    cost = np.empty(width)
    least = word_prices(places, prices)
    for entry in range(2 * n):
        j = entry >> 1
        if entry & 1 and not places.turns[j]:
            continue
        cost[:] = np.inf
        cheapest_exits(places, rule, prices, least, entry, cost, exits[entry])
        rest[j] = min(rest[j], cost[-1])
    return exits, rest


@kernel
def arc_weights(
    exits: NDArray[np.int64],
    entries: NDArray[np.int64],
    places: Places,
    prices: Prices,
    weight: NDArray[np.float64],
) -> None:
    """Write what each arc costs; one from the root has the exit port 2n."""
    root = 2 * len(places.turns)
    for e in range(len(exits)):
        a, b = exits[e], entries[e]
        if a == root:
            turn = prices.turn[b >> 1]
            weight[e] = prices.leave[root >> 1] - (-turn if b & 1 else turn)
        else:
            weight[e] = travel_price(places, prices, a, b)
