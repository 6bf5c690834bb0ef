"""Moves that take along whatever precedence demands.

Exchanges of segments fail where a single contour in between is bound to one
side. An insertion lets contour d follow contour c by sorting the window between them:
what d needs goes before c (or what needs d goes behind d), the rest keeps its
order. It is feasible by construction and costs O(window).
"""

from __future__ import annotations

from decmcts.compiled import kernel
from decmcts.search.sequence.metric_kernels import distance
from decmcts.search.sequence.moves_kernels import Tour, port_in, port_out, refresh
from decmcts.search.sequence.timed_lags_kernels import rearranging_keeps

LONGEST_INSERTION = 200  # positions; longer windows rarely keep their cost


@kernel
def _mark_needed(tour: Tour, p: int, at: int) -> bool:
    """Mutate `tour.mark`: ancestors of the contour at `at` within (p, at), and itself.

    Return False if the contour at p is needed by one of those ancestors.
    """
    tour.mark[tour.order[at]] = True
    for q in range(at - 1, p - 1, -1):
        c = tour.order[q]
        for e in range(tour.succ_offsets[c], tour.succ_offsets[c + 1]):
            b = tour.succs[e]
            if tour.mark[b] and (q > p or tour.position[b] < at):
                tour.mark[c] = True
                break
    blocked = tour.mark[tour.order[p]]
    for q in range(p, at + 1):
        if blocked:
            tour.mark[tour.order[q]] = False
    return not blocked


@kernel
def _mark_needing(tour: Tour, at: int, p: int) -> bool:
    """Mutate `tour.mark`: the contour at `at` and its descendants within [at, p].

    Return False if the contour at p is one of them.
    """
    tour.mark[tour.order[at]] = True
    for q in range(at + 1, p + 1):
        c = tour.order[q]
        for e in range(tour.pred_offsets[c], tour.pred_offsets[c + 1]):
            if tour.mark[tour.preds[e]]:
                tour.mark[c] = True
                break
    blocked = tour.mark[tour.order[p]]
    for q in range(at, p + 1):
        if blocked:
            tour.mark[tour.order[q]] = False
    return not blocked


@kernel
def _sort_window(tour: Tour, first: int, last: int, marked_first: bool) -> None:
    """Mutate `tour.scratch`: the window with its marked contours first or last; clears marks.

    Both parts keep their order.
    """
    front = 0
    for want in (marked_first, not marked_first):
        for q in range(first, last):
            c = tour.order[q]
            if tour.mark[c] == want:
                tour.scratch[front] = c
                front += 1
    for q in range(first, last):
        tour.mark[tour.order[q]] = False


@kernel
def _window_change(tour: Tour, first: int, last: int) -> float:
    """Return the cost change of putting `tour.scratch` in place of [first, last), mm."""
    metric, order, is_reversed, scratch = tour.metric, tour.order, tour.reversed, tour.scratch
    change = 0.0
    for q in range(max(first - 1, 0), last):
        change -= tour.after[order[q]]
    for x in range(1, last - first):
        change += distance(
            metric, port_out(is_reversed, scratch[x - 1]), port_in(is_reversed, scratch[x])
        )
    if first > 0:
        change += distance(
            metric, port_out(is_reversed, order[first - 1]), port_in(is_reversed, scratch[0])
        )
    if last < len(order):
        end = scratch[last - first - 1]
        change += distance(metric, port_out(is_reversed, end), port_in(is_reversed, order[last]))
    return change


@kernel
def try_insertion(tour: Tour, p: int, at: int, slack: float) -> float:
    """Mutate the tour: let the contour at `at` follow that at p; return the change, 0 if refused.

    p and `at` are in one group, at != p + 1. Ahead of p comes what the contour
    needs, behind it what needs it.
    """
    order, n_window = tour.order, abs(at - p) + 1
    first, last = min(p, at), max(p, at) + 1
    if n_window > LONGEST_INSERTION or tour.group[order[first]] != tour.group[order[last - 1]]:
        return 0.0
    if not (_mark_needed(tour, p, at) if at > p else _mark_needing(tour, at, p)):
        return 0.0
    if at > p:
        follower = order[at]
        tour.mark[follower] = False
        _sort_window(tour, first, last, True)
        _slide_in(tour, order[p], follower, n_window)
    else:
        _sort_window(tour, first, last, False)
    change = _window_change(tour, first, last)
    if change > slack or not rearranging_keeps(
        tour.lags, order, tour.position, tour.scratch, first, last
    ):
        return 0.0
    for x in range(n_window):
        order[first + x] = tour.scratch[x]
        tour.position[tour.scratch[x]] = first + x
    refresh(tour, first - 1, last)
    return change


@kernel
def _slide_in(tour: Tour, leader: int, follower: int, n_window: int) -> None:
    """Mutate `tour.scratch`: move its last contour, `follower`, right behind `leader`."""
    x = n_window - 1
    while tour.scratch[x - 1] != leader:
        tour.scratch[x] = tour.scratch[x - 1]
        x -= 1
    tour.scratch[x] = follower
