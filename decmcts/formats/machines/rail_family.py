"""Presets `rail-3` to `rail-8`: as many heads like those of `dual-gantry` along one rail.

    parked            over the bed           parked
    [1] [2] [3] |   0 ........... W   |  [4] [5]        (rail-5)

The bed is 150 mm long a head, 300 at least. The heads park beyond its two ends, one
behind the other as near as the rail lets them.
"""

from __future__ import annotations

from dataclasses import replace

from decmcts.print.machine import Head, Machine, Rail

SIZES = range(3, 9)
_BED_A_HEAD_MM, _SHORTEST_BED_MM = 150.0, 300.0
_SLACK_MM = 5.0  # of reach: a head at its end of the bed does not touch the limit of the rail


def rail_machine(pair: Machine, heads: int, length_mm: float | None = None) -> Machine:
    """Return a machine of `heads` heads shaped like those of `pair`, two heads on a rail.

    Parameters
    ----------
    pair : Machine
        Its first head parks left of its bed, its second as far right of it.
    heads : int
        How many.
    length_mm : float | None
        Of the bed; None: as the presets'.
    """
    (rail,) = pair.rails
    length = length_mm or max(_SHORTEST_BED_MM, _BED_A_HEAD_MM * heads)
    placed = [_head(pair, k, heads, length) for k in range(heads)]
    return replace(
        pair,
        name=f"rail-{heads}",
        bed_max=(length, pair.bed_max[1]),
        heads=tuple(placed),
        rails=(Rail(rail.axis, tuple(head.name for head in placed), rail.separation_mm),),
        source=f"{heads} heads of {pair.name} along one rail; {pair.name}: {pair.source}",
    )


def _head(pair: Machine, k: int, heads: int, length: float) -> Head:
    """Return head k, counted from the left.

    It reaches as far as the heads beyond it leave room for, pushed together up to the
    nearest park on the other side.
    """
    first, last = pair.heads
    step = pair.rails[0].separation_mm
    left = (heads + 1) // 2  # so many park left of the bed
    beyond = last.park[0] - pair.bed_max[0]  # from the end of the bed to the nearest park
    low, high = 0.0, length
    if k < left:
        x = first.park[0] - step * (left - 1 - k)
        high = min(high, length + beyond - step * (left - k) - _SLACK_MM)
    else:
        x = length + beyond + step * (k - left)
        low = max(low, first.park[0] + step * (k - left + 1) + _SLACK_MM)
    return replace(
        first,
        name=f"head-{k + 1}",
        park=(x, *first.park[1:]),
        reach_min=(low, *first.reach_min[1:]),
        reach_max=(high, *first.reach_max[1:]),
    )
