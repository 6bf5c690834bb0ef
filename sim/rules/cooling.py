"""Whether a plan prints over any spot too soon; docs/definitions.md has the rule (*Cooling*).

Of the source's time only what it printed in between counts here, so the judge asks for no more
than is due. Times are those of the judge's own motion model; retractions are no motion, and
slicers set accelerations for single lines, so an action may take as long as the plan says within
reason.

Between several heads only the time counts that passes for every timing. A head may be slower than
planned and may rest wherever it likes, but no leg takes less than its motion. So the least time
from the end of one leg to the begin of another is the longest way between them through the partial
order: along legs, waits and lags.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.plan import ActionKind, HeadActions, OrderRules, PlanDocument
from sim.content.paths import Legs
from sim.faults import Fault, FaultKind, listed
from sim.rules.order import PartialOrder

SLACK_S = 0.5  # by which the time models of judge and planner may differ
TIE_MM = 1e-4  # heights and distances that differ by less are equal
# An action may take longer than by the judge's model, as its source states lower limits:
TRAVEL_TIMES = 15.0  # a travel up to so many times as long,
TRAVEL_MORE_S = 1.0  # and so much more for retraction and priming;
PRINT_TIMES = 3.0  # a print so many times: short lines at a ninth of the acceleration

Recent = tuple[int, NDArray[Any], Floats]  # a contour, which ended before it, how long before


@dataclass(frozen=True, slots=True)
class TooSoon:
    """A contour that begins too short a time after one under it."""

    contour: int
    under: int
    gap_s: float
    due_s: float

    def __str__(self) -> str:
        return (
            f"contour {self.contour} begins {self.gap_s:.1f} s after contour {self.under} under "
            f"it, {self.due_s:.1f} s are due"
        )


class _Stack:
    """The contours on top of each other, and when the source prints them."""

    def __init__(self, contours: Contours, rule: float, work: Floats) -> None:
        """Take what printing each contour takes, (n,)."""
        self.contours, self.rule = contours, rule
        self.before = np.concatenate([[0.0], np.cumsum(work)])  # (n + 1,) s, as sliced
        self.top, self.floor = contours.top, contours.bottom - contours.height  # (n,)

    def too_soon(self, b: int, recent: NDArray[Any], gaps: Floats) -> Iterator[TooSoon]:
        """Yield each contour under b that ended too short a time before it."""
        contours, before, top = self.contours, self.before, self.top
        half, floor = contours.height[b] / 2, self.floor[b]
        meets = _ends_under(top[recent] - floor, half)
        for k in np.flatnonzero(meets & (recent < b)).tolist():
            a, gap = int(recent[k]), float(gaps[k])
            due = min(self.rule, float(before[b] - before[a + 1]))
            if gap >= due - SLACK_S or not _over(contours, a, b):
                continue
            under = a + 1 + np.flatnonzero(_ends_under(top[a + 1 : b] - floor, half))
            last = next((c for c in under[::-1].tolist() if _over(contours, c, b)), a)
            due = min(self.rule, float(before[b] - before[last + 1]))
            if gap < due - SLACK_S:
                yield TooSoon(b, a, gap, due)


def check_cooling(
    document: PlanDocument, legs: Legs, order: PartialOrder, arrivals: list[Floats]
) -> list[Fault]:
    """Check the plan's rule; `arrivals` are the seconds to each point of each head's paths."""
    rule = document.min_layer_time_s
    if rule <= 0.0:
        return []
    all_actions = legs.whole
    seconds = [
        _seconds(actions, times) for actions, times in zip(all_actions, arrivals, strict=True)
    ]
    work = np.zeros(len(document.contours))
    for actions, taken in zip(all_actions, seconds, strict=True):
        prints = actions.kind == ActionKind.PRINT
        work[actions.contour[prints]] = taken[prints]
    busy = [h for h, actions in enumerate(all_actions) if (actions.kind == ActionKind.PRINT).any()]
    if len(busy) == 1:
        actions, ends = all_actions[busy[0]], np.cumsum(seconds[busy[0]])
        prints = np.flatnonzero(actions.kind == ActionKind.PRINT)
        begin, end = np.full((2, len(document.contours)), np.inf)
        end[actions.contour[prints]] = ends[prints]
        begin[actions.contour[prints]] = ends[prints] - seconds[busy[0]][prints]
        recent = _recent_by(begin, end, rule)
    else:
        recent = _recent_of_all(legs, order, _of_legs(legs, arrivals, seconds), rule)
    stack = _Stack(document.contours, rule, work)
    lines = [str(each) for b, a, gap in recent for each in stack.too_soon(b, a, gap)]
    return listed(FaultKind.COOLING, lines)


def too_soon_in(document: PlanDocument, begin: Floats, end: Floats) -> Iterator[TooSoon]:
    """Yield what breaks the plan's rule where contours begin and end at these seconds, (n,).

    inf: it is never printed. Complexity O(contours × those that end within the rule).
    """
    rule, work = document.min_layer_time_s, np.zeros(len(document.contours))
    if rule <= 0.0:
        return
    for actions in document.plan.heads:
        prints = actions.kind == ActionKind.PRINT
        work[actions.contour[prints]] = (actions.end_s - actions.begin_s)[prints]
    stack = _Stack(document.contours, rule, work)
    for b, recent, gaps in _recent_by(begin, end, rule):
        yield from stack.too_soon(b, recent, gaps)


def check_stated(document: PlanDocument, source: PrintJob, held: OrderRules) -> list[Fault]:
    """Check that a plan states no shorter layer time than its source's slicer keeps.

    As for `decmcts plan` and `launch`, the slicer's rule only counts with `quality`.
    """
    due, stated = source.settings.min_layer_time_s, document.min_layer_time_s
    if stated >= due or not held.quality:
        return []
    text = (
        f"the plan states {f'{stated:g} s' if stated else 'no time'} before a spot is printed "
        f"over, the source's slicer {due:g} s; --min-layer-time {stated:g}, if that was asked for"
    )
    return [Fault(FaultKind.COOLING, text)]


def _recent_by(begin: Floats, end: Floats, rule: float) -> Iterator[Recent]:
    """Yield each contour with those that ended within the rule before it, by these seconds."""
    order = np.argsort(end)
    first = np.searchsorted(end[order], begin - rule, side="right")
    last = np.searchsorted(end[order], begin, side="right")
    for b in np.flatnonzero(np.isfinite(begin)).tolist():
        recent = order[first[b] : last[b]]
        yield b, recent, begin[b] - end[recent]


def _recent_of_all(
    legs: Legs, order: PartialOrder, seconds: list[Floats], rule: float
) -> Iterator[Recent]:
    """Yield each contour with those that may have ended within the rule before it."""
    time = LeastTime(legs, order, seconds)
    ends = [legs.last(h) for h in range(len(legs.all_actions))]
    for h, actions in enumerate(legs.all_actions):
        for leg in np.flatnonzero((actions.kind == ActionKind.PRINT) & legs.begins(h)).tolist():
            found = [
                (int(legs.all_actions[g].contour[k]), passed)
                for g, k, passed in time.since(h, leg, rule)
                if legs.all_actions[g].kind[k] == ActionKind.PRINT and ends[g][k] == k
            ]
            contours = np.array([c for c, _ in found], np.int64)
            yield int(actions.contour[leg]), contours, np.array([gap for _, gap in found])


def _of_legs(legs: Legs, arrivals: list[Floats], seconds: list[Floats]) -> list[Floats]:
    """Return how long each leg takes: its share of the action by the judge's own motion."""
    taken = []
    for h, actions in enumerate(legs.all_actions):
        origin, own = legs.origin[h], legs.arrivals(h, arrivals[h])[actions.path_offsets[1:] - 1]
        whole = np.bincount(origin, own, len(seconds[h]))[origin]
        share = np.where(whole > 0.0, own / np.where(whole > 0.0, whole, 1.0), legs.begins(h))
        taken.append(seconds[h][origin] * share)
    return taken


def _seconds(actions: HeadActions, arrivals: Floats) -> Floats:
    own = arrivals[actions.path_offsets[1:] - 1]
    stated = actions.end_s - actions.begin_s
    travel = (actions.kind == ActionKind.TRAVEL) | (actions.kind == ActionKind.PARK)
    most = np.where(travel, TRAVEL_TIMES * own + TRAVEL_MORE_S, PRINT_TIMES * own)
    moves = travel | (actions.kind == ActionKind.PRINT)
    return np.where(moves, np.maximum(own, np.minimum(stated, most)), own)


def _ends_under(above_floor: Floats, half: float) -> Flags:
    """Say whether material whose top is so far above a bead's underside lies right under the bead.

    `half` is half the bead's height, the tolerance either way: a bridge of twice the layer's
    height begins within the layer that carries it.
    """
    return (above_floor > TIE_MM - half) & (above_floor < half + TIE_MM)


def _over(contours: Contours, a: int, b: int) -> bool:
    """Say whether one's centreline runs over the other's bead."""
    one, other = (shapely.LineString(contours.polyline(c)[:, :2]) for c in (a, b))
    reach = max(float(contours.width[a]), float(contours.width[b])) / 2 + TIE_MM
    return bool(shapely.dwithin(one, other, reach))


class LeastTime:
    """The partial order with what each leg takes at least."""

    def __init__(self, legs: Legs, order: PartialOrder, seconds: list[Floats]) -> None:
        """Take the legs' seconds, (n_legs,) a head."""
        self._order, self._seconds = order, seconds
        self._rank = [np.empty(len(actions), np.int64) for actions in legs.all_actions]
        for rank, (head, leg) in enumerate(order.sequence.tolist()):
            self._rank[head][leg] = rank
        self._waits = [
            {
                k: actions.after_edges(k)
                for k in np.flatnonzero(np.diff(actions.after_offsets)).tolist()
            }
            for actions in legs.all_actions
        ]

    def since(self, head: int, leg: int, limit_s: float) -> Iterator[tuple[int, int, float]]:
        """Yield (head, leg, seconds) of each leg that may have ended less than `limit_s` before.

        Only legs that have ended for sure when the given one begins. Backwards through the
        order: a leg is looked at when all that follows it has been.
        """
        done = np.zeros(len(self._seconds), np.int64)  # legs of each head that ended long before
        least: dict[tuple[int, int], float] = {}
        heap: list[tuple[int, int, int]] = []

        def step(h: int, j: int, begun: float) -> None:
            """Note what has ended when leg `j` of head `h` begins, `begun` seconds before."""
            waits = self._waits[h].get(j, ())
            ended = [(edge.head, edge.action, edge.lag_s) for edge in waits]
            if j:
                ended.append((h, j - 1, 0.0))
            for g, k, lag_s in ended:
                if (g, k) not in least:
                    heapq.heappush(heap, (-int(self._rank[g][k]), g, k))
                least[g, k] = max(least.get((g, k), 0.0), begun + lag_s)

        step(head, leg, 0.0)
        while heap:
            _, g, k = heapq.heappop(heap)
            passed = least[g, k]
            if k < done[g]:
                continue
            if passed >= limit_s:
                np.maximum(done, self._order.clocks[g][k], out=done)
                continue
            yield g, k, passed
            step(g, k, passed + float(self._seconds[g][k]))
