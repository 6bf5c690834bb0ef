"""The joint order of any number of heads, built unit by unit, on bare arrays.

A *unit* is one action: the print of one contour, a travel to one, a step aside,
a return to the park. Units are placed one after the other; each begins as early as
its head, what supports its contour and the space reserved by units placed before it allow.
So whatever is placed, in whatever order that keeps the precedence, there is a joint
order, and it has no cycle: a unit waits only for units placed before it.

A head that prints releases its reserved space piece by piece (`spaces_kernels`). A head at rest
where another wants to go steps aside first (`aside_kernels`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.compiled import inlined, kernel
from decmcts.print.lags_kernels import Lags
from decmcts.team.engine.spaces_kernels import (
    Fleet,
    Pieces,
    Point,
    Space,
    keep_space,
    space_at,
    space_of_point,
    space_of_travel,
    too_near,
    travel_seconds,
)

NONE = -1
LOOK_BACK = 64  # units of each other head at most that are looked at for what a unit waits for
PLACES = 32  # of a unit: its pieces, of which there are fewer, and its end
UNIT_PRINT, UNIT_TRAVEL, UNIT_ASIDE, UNIT_PARK = 0, 1, 2, 3


class Visits(NamedTuple):
    """What the kernels know of the contours."""

    ends: Floats  # (n, 2, 3) as sliced: where each begins and ends, mm
    seconds: Floats  # (heads, n) printing time
    reversible: Flags  # (n,)
    pieces: Pieces
    pred_offsets: Ints  # (n + 1,)
    preds: Int32s
    lags: Lags  # every pair is in the closure of the precedence


class Units(NamedTuple):
    """Units in the order they were placed; rows from `used[0]` on are unused."""

    head: Int32s  # (m,)
    kind: NDArray[np.int8]  # (m,)
    contour: Int32s  # (m,) NONE unless printed
    reversed: Flags  # (m,)
    target: Floats  # (m, 3) where it ends
    space: Floats  # (m, 6)
    begin: Floats  # (m,) seconds
    end: Floats  # (m,)
    before: Ints  # (m,) unit before it on its head; NONE
    used: Ints  # (1,)


class TeamState(NamedTuple):
    """Where every head is after what was placed so far; written as units are placed."""

    last: Ints  # (heads,) its last unit; NONE
    free: Floats  # (heads,) end of that unit
    at: Floats  # (heads, 3) where it rests then
    rest: Floats  # (heads, 6) space reserved by that rest
    ended: Floats  # (n,) end of each contour that was placed
    waited: Ints  # (heads, heads) last place of s that r waited for; see `place_in`


@kernel
def new_units(most: int) -> Units:
    """Return empty units with `most` rows."""
    return Units(
        np.empty(most, np.int32),
        np.empty(most, np.int8),
        np.empty(most, np.int32),
        np.zeros(most, np.bool_),
        np.empty((most, 3)),
        np.empty((most, 6)),
        np.empty(most),
        np.empty(most),
        np.empty(most, np.int64),
        np.zeros(1, np.int64),
    )


@inlined
def has_capacity(units: Units, heads: int) -> bool:
    """Whether `units` has rows free for all that one more contour can need."""
    return bool(units.used[0] + heads * (heads + 2) + 2 <= len(units.head))


@kernel
def all_parked(n: int, fleet: Fleet) -> TeamState:
    """All heads at their parks, nothing placed; `n` is the number of contours."""
    heads = len(fleet.parks)
    rest = np.empty((heads, 6))
    for r in range(heads):
        keep_space(space_of_point(fleet.parks[r], -np.inf), rest, r)
    return TeamState(
        np.full(heads, NONE), np.zeros(heads), fleet.parks.copy(), rest, np.zeros(n),
        np.full((heads, heads), NONE),
    )  # fmt: skip


@inlined
def first_clear_piece(
    u: int, space: Space, r: int, visits: Visits, fleet: Fleet, units: Units
) -> int:
    """First piece of unit u that is clear of `space` of head r; NONE: only its end is."""
    c = units.contour[u]
    if c != NONE:
        row = 2 * c + units.reversed[u]
        for k in range(visits.pieces.offsets[row] + 1, visits.pieces.offsets[row + 1]):
            if not too_near(space, space_at(visits.pieces.space, k), r, units.head[u], fleet):
                piece: int = k
                return piece
    return NONE


@inlined
def time_at(u: int, piece: int, visits: Visits, units: Units) -> float:
    """When unit u has come to a piece, or NONE: to its end."""
    end: float = units.end[u]
    if piece != NONE:
        share = visits.pieces.share[piece]
        end = units.begin[u] + share * (units.end[u] - units.begin[u])
    return end


@inlined
def clear_from(
    r: int,
    space: Space,
    begin: float,
    visits: Visits,
    fleet: Fleet,
    units: Units,
    heads: TeamState,
) -> float:
    """When head r may have `space`, no sooner than `begin`, for all that was placed before.

    Of each other head the latest unit that overlaps counts: it began after all others had ended.
    """
    for s in range(len(heads.free)):
        u = heads.last[s] if s != r else NONE
        while u != NONE and units.end[u] > begin:
            if too_near(space, space_at(units.space, u), r, s, fleet):
                k = first_clear_piece(u, space, r, visits, fleet, units)
                begin = max(begin, time_at(u, k, visits, units))
                break
            u = units.before[u]
    return begin


@inlined
def place_in(u: int, piece: int, visits: Visits, units: Units) -> int:
    """Return the place where unit u has come to a piece, or NONE: to its end; later is larger."""
    if piece == NONE:
        return u * PLACES + PLACES - 1
    before: int = visits.pieces.offsets[2 * units.contour[u] + units.reversed[u]]
    return u * PLACES + piece - before


@inlined
def begin_in(
    r: int,
    space: Space,
    begin: float,
    visits: Visits,
    fleet: Fleet,
    units: Units,
    heads: TeamState,
) -> float:
    """When head r begins what needs `space`, no sooner than `begin`, what waiting costs included.

    A head stops wherever it has to wait for a place that it has not waited for before, whether or
    not the other has passed that by then (`decmcts.team.schedule.standing`): `Fleet.rest_s`
    (mutates heads). Units farther back than `LOOK_BACK` count only if they have not ended by then,
    so that long work far apart costs nothing to look through; the exact plan counts all.
    """
    stops = False
    for s in range(len(heads.free)):
        u, left = heads.last[s] if s != r else NONE, LOOK_BACK
        while u != NONE and u * PLACES + PLACES - 1 > heads.waited[r, s]:
            left -= 1
            if left < 0 and units.end[u] <= begin:
                break
            if too_near(space, space_at(units.space, u), r, s, fleet):
                k = first_clear_piece(u, space, r, visits, fleet, units)
                at = place_in(u, k, visits, units)
                if at > heads.waited[r, s]:
                    heads.waited[r, s], stops = at, True
                begin = max(begin, time_at(u, k, visits, units))
                break
            u = units.before[u]
    return begin + fleet.rest_s if stops else begin


@inlined
def place(
    r: int,
    kind: int,
    contour: int,
    is_reversed: bool,
    begin: float,
    end: float,
    space: Space,
    target: Point,
    top: float,
    units: Units,
    heads: TeamState,
) -> None:
    """Append a unit of head r (mutates units and heads); it then rests at most at height `top`."""
    row = units.used[0]
    units.used[0] += 1
    units.head[row], units.kind[row], units.contour[row] = r, kind, contour
    units.reversed[row] = is_reversed
    keep_space(space, units.space, row)
    units.begin[row], units.end[row] = begin, end
    units.before[row] = heads.last[r]
    heads.last[r], heads.free[r] = row, end
    for axis in range(3):
        units.target[row, axis] = heads.at[r, axis] = target[axis]
    keep_space(space_of_point(target, top), heads.rest, r)


@inlined
def place_travel(
    r: int,
    kind: int,
    target: Point,
    visits: Visits,
    fleet: Fleet,
    units: Units,
    heads: TeamState,
) -> None:
    """Append a travel of head r (mutates units and heads); none where it stands there already."""
    at = (heads.at[r, 0], heads.at[r, 1], heads.at[r, 2])
    if at[0] == target[0] and at[1] == target[1] and at[2] == target[2]:
        return
    space = space_of_travel(at, target, fleet.ceiling)
    begin = begin_in(r, space, heads.free[r], visits, fleet, units, heads)
    end = begin + travel_seconds(at, target, fleet.travel[r])
    # one that steps aside may stay as high as it crossed
    top = fleet.ceiling if kind == UNIT_ASIDE else -np.inf
    place(r, kind, NONE, False, begin, end, space, target, top, units, heads)


@inlined
def ready_at(c: int, visits: Visits, heads: TeamState) -> float:
    """When a contour may begin: all that supports it is printed and has cooled.

    All that supports it must have been placed.
    """
    ready, lags = 0.0, visits.lags
    for k in range(visits.pred_offsets[c], visits.pred_offsets[c + 1]):
        ready = max(ready, heads.ended[visits.preds[k]])
    for k in range(lags.offsets[c], lags.offsets[c + 1]):
        ready = max(ready, heads.ended[lags.below[k]] + lags.seconds[k])
    return ready


@inlined
def end_of(c: int, side: int, visits: Visits) -> tuple[float, float, float]:
    """Where contour c begins (side 0) or ends (1) as sliced."""
    return visits.ends[c, side, 0], visits.ends[c, side, 1], visits.ends[c, side, 2]


@inlined
def place_print(
    r: int, c: int, is_reversed: bool, visits: Visits, fleet: Fleet, units: Units, heads: TeamState
) -> None:
    """Append travel and print of a contour (mutates units and heads); the path must be clear."""
    side = 1 if is_reversed else 0
    place_travel(r, UNIT_TRAVEL, end_of(c, side, visits), visits, fleet, units, heads)
    space = space_at(visits.pieces.space, visits.pieces.offsets[2 * c + side])
    begin = max(heads.free[r], ready_at(c, visits, heads))
    begin = begin_in(r, space, begin, visits, fleet, units, heads)
    end = begin + visits.seconds[r, c]
    exit_ = end_of(c, 1 - side, visits)
    place(r, UNIT_PRINT, c, is_reversed, begin, end, space, exit_, -np.inf, units, heads)
    heads.ended[c] = end
