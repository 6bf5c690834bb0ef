"""How near heads come to each other while they run, and when they touch.

Conservative advancement: where heads are so far apart and can be so fast, nothing can be nearer
for so long, and that time is skipped. So the least distance is found however short it lasts, to
`CLOSEST_MM`. Heads are upright prisms (slices and boxes), so their distance is that of polygons
and of heights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.machine import Head, Machine, Point
from sim.controllers.carry_out import HeadRun
from sim.controllers.compiled import compiled
from sim.controllers.motion import Profile
from sim.controllers.program import HeadProgram
from sim.controllers.timing import Error
from sim.replay.shapes import parts_of, separations_between

CLOSEST_MM = 0.02  # the least distance is found to within this,
CHART_MM = 0.5  # that of each span of time for charts,
INSIDE_MM = 1.0  # and that of a contact
TOUCH_MM = 1e-3  # rounding of files: nearer than the limit by more is a contact
BINS = 400  # spans of time of which the least distance is kept, for charts
MOST_CONTACTS = 100  # of two heads: then no more is looked at
TALL_MM = 1e4


class Course(NamedTuple):
    """Where one head is over time, as the kernels take it."""

    points: Floats  # (m + 1, 3)
    begin: Floats  # (m,) seconds at which each move begins
    end: Floats  # (m,)
    length: Floats  # (m,) mm
    enters: Floats  # (m,) mm/s, of the move as it should be
    leaves: Floats  # (m,)
    top: Floats  # (m,)
    rate: Floats  # (m,)
    slow: Floats  # (m,) times as long as it should be


class Shape(NamedTuple):
    """The convex prisms of one head round its tip."""

    offsets: Ints  # (k + 1,)
    corners: Floats  # (n, 2)
    low: Floats  # (k,)
    high: Floats  # (k,)
    sides: Floats  # (k, 2, 2) least and most x and y of each
    upright: Flags  # (k,) each that is its own box: a rectangle along the axes
    box: Floats  # (2, 3) least and most of all


@dataclass(frozen=True, slots=True)
class HeadContact:
    """Two heads nearer than they may be."""

    heads: tuple[int, int]
    time_s: float
    seconds: float
    gap_mm: float  # the least of it
    at: tuple[Point, Point]
    what: str  # "bodies" or "rail"


@dataclass(frozen=True, slots=True)
class Near:
    """How near two heads came."""

    heads: tuple[int, int]
    gap_mm: float  # the least between their shapes
    time_s: float
    at: tuple[Point, Point]
    rail_mm: float  # the least of what lies between them on a rail beyond its separation; inf: none
    bins: Floats  # (BINS,) least distance in each span of the time, mm
    contacts: tuple[HeadContact, ...]


def course_of(program: HeadProgram, profile: Profile, error: Error, run: HeadRun) -> Course:
    """Return where a head is over time."""
    begin = run.end - error.factor * profile.seconds
    return Course(
        program.points, begin, run.end, profile.length, profile.enters, profile.leaves,
        profile.top, profile.rate, error.factor,
    )  # fmt: skip


def shape_of(head: Head) -> Shape:
    """Return the prisms of a head; its slices fill all above them."""
    parts = parts_of(head)
    polygons = [part.polygon for part in parts]
    low = np.array([part.low for part in parts], np.float64)
    high = np.array([TALL_MM if part.slice else part.high for part in parts], np.float64)
    offsets = np.cumsum([0, *map(len, polygons)]).astype(np.int64)
    corners = np.concatenate([np.zeros((0, 2)), *polygons])
    least = [*corners.min(axis=0, initial=np.inf), low.min(initial=np.inf)]
    most = [*corners.max(axis=0, initial=-np.inf), high.max(initial=-np.inf)]
    sides = np.array([[p.min(axis=0), p.max(axis=0)] for p in polygons]).reshape(-1, 2, 2)
    upright = [_is_upright(p, box) for p, box in zip(polygons, sides, strict=True)]
    return Shape(
        offsets, corners, low, high, sides, np.array(upright, np.bool_), np.array([least, most])
    )


def _is_upright(polygon: Floats, sides: Floats) -> bool:
    """Tell whether a convex polygon is the rectangle of its least and most x and y."""
    corners = {tuple(corner) for corner in polygon.tolist()}
    (x, y), (to_x, to_y) = sides.tolist()
    return corners == {(x, y), (to_x, y), (to_x, to_y), (x, to_y)}


def nearness(
    machine: Machine, heads: Sequence[Head], courses: Sequence[Course], begin_s: float, end_s: float
) -> tuple[Near, ...]:
    """Return how near each pair of heads comes from one time to another.

    `heads` are those of the courses, in their order.
    """
    shapes = [shape_of(head) for head in heads]
    fastest = [float((course.top / course.slow).max(initial=0.0)) for course in courses]
    limit, found = machine.head_clearance_mm - TOUCH_MM, []
    for a, b in combinations(range(len(courses)), 2):
        rails = rail_rows(machine, heads[a], heads[b])
        bins, least = np.full(BINS, np.inf), np.full(9, np.inf)
        met = np.zeros((MOST_CONTACTS, 10))
        n = _advance(
            courses[a], courses[b], shapes[a], shapes[b], rails, limit,
            max(fastest[a] + fastest[b], 1.0), begin_s, end_s, bins, least, met,
        )  # fmt: skip
        contacts = tuple(
            HeadContact((a, b), begin, end - begin, gap, _two(at), "rail" if rail else "bodies")
            for begin, end, gap, *at, rail in met[:n].tolist()
        )
        gap, time_s, rail, *at = least.tolist()
        found.append(Near((a, b), gap, time_s, _two(at), rail, bins, contacts))
    return tuple(found)


def rail_rows(machine: Machine, a: Head, b: Head) -> Floats:
    """Return axis, side of b as a sign and least separation of the rails of two heads, (r, 3)."""
    return np.array(separations_between(machine, a, b), np.float64).reshape(-1, 3)


def _two(six: Sequence[float]) -> tuple[Point, Point]:
    a, b, c, d, e, f = six
    return (a, b, c), (d, e, f)


@compiled
def _advance(
    a: Course, b: Course, a_shape: Shape, b_shape: Shape, rails: Floats, limit: float,
    fastest: float, begin: float, end: float, bins: Floats, least: Floats, found: Floats,
) -> int:  # fmt: skip
    """Go through the time in steps in which nothing can be missed; returns how many contacts."""
    p, q = np.zeros(3), np.zeros(3)
    i, j, n, inside = 0, 0, 0, False
    t = begin
    while t <= end:
        i, j = _follow(a, i, t, p), _follow(b, j, t, q)
        gap, slack = gap_between(a_shape, b_shape, p, q), slack_between(rails, p, q)
        if gap < least[0]:
            least[0], least[1] = gap, t
            least[3:6], least[6:9] = p, q
        least[2] = min(least[2], slack)
        over = min(gap - limit, slack + TOUCH_MM)
        if over < 0.0:
            if not inside and n < len(found):
                found[n, 0], found[n, 2], found[n, 9] = t, np.inf, 1.0 if slack < -TOUCH_MM else 0.0
                n += 1
            inside = True
            if n > 0 and min(gap, slack) < found[n - 1, 2]:
                found[n - 1, 2] = min(gap, slack)
                found[n - 1, 3:6], found[n - 1, 6:9] = p, q
            found[n - 1, 1] = t
        elif n == len(found):
            break
        else:
            inside = False
        k = min(int((t - begin) / max(end - begin, 1e-9) * len(bins)), len(bins) - 1)
        clear = INSIDE_MM
        if not inside:
            clear = min(max(gap - bins[k], CHART_MM), max(gap - least[0], CLOSEST_MM))
            clear = min(clear, max(over, CLOSEST_MM))
        bins[k] = min(bins[k], gap)
        t = _later(a, b, i, j, t, clear, fastest)
    return n


@compiled
def slack_between(rails: Floats, p: Floats, q: Floats) -> float:
    """Return the least of what lies between two heads on rails beyond their separation."""
    slack = np.inf
    for r in range(len(rails)):
        axis = int(rails[r, 0])
        slack = min(slack, rails[r, 1] * (q[axis] - p[axis]) - rails[r, 2])
    return slack


@compiled
def _later(a: Course, b: Course, i: int, j: int, t: float, clear: float, fastest: float) -> float:
    """Return the time to look at next: until then heads come nearer by `clear` mm at most.

    That is at the speeds of the moves they are in, up to the end of the first of these, or at the
    most they ever have. While both stand nothing changes; inf: nothing changes any more.
    """
    speed, change = 0.0, np.inf
    for course, k in ((a, i), (b, j)):
        if k < len(course.end):
            if t >= course.begin[k]:
                speed += course.top[k] / course.slow[k]
                change = min(change, course.end[k])
            else:
                change = min(change, course.begin[k])
    if speed > 0.0:
        change = min(change, t + clear / speed)
    return max(change, t + clear / fastest)


@compiled
def _follow(course: Course, i: int, t: float, point: Floats) -> int:
    """Write where a head is at a time, and return the move it is in or stands before."""
    m = len(course.end)
    while i < m and course.end[i] <= t:
        i += 1
    if i == m or t <= course.begin[i]:
        point[:] = course.points[i]
        return i
    share = _share(course, i, (t - course.begin[i]) / course.slow[i])
    for axis in range(3):
        point[axis] = course.points[i, axis] + share * (
            course.points[i + 1, axis] - course.points[i, axis]
        )
    return i


@compiled
def _share(course: Course, i: int, t: float) -> float:
    """Return what share of a move is done so many seconds after its begin."""
    enters, leaves, top, rate = course.enters[i], course.leaves[i], course.top[i], course.rate[i]
    length = course.length[i]
    up, down = (top - enters) / rate, (top - leaves) / rate
    risen = (top * top - enters * enters) / (2.0 * rate)
    fallen = (top * top - leaves * leaves) / (2.0 * rate)
    level = max(0.0, length - risen - fallen) / top
    if t < up:
        gone = enters * t + 0.5 * rate * t * t
    elif t < up + level:
        gone = risen + top * (t - up)
    else:
        left = max(0.0, up + level + down - t)
        gone = length - (leaves * left + 0.5 * rate * left * left)
    return float(min(1.0, max(0.0, gone / length)))


@compiled
def gap_between(a: Shape, b: Shape, p: Floats, q: Floats) -> float:
    """Return the distance of two heads whose tips are at p and q."""
    apart = 0.0
    for axis in range(3):
        d = max(q[axis] + b.box[0, axis] - p[axis] - a.box[1, axis],
                p[axis] + a.box[0, axis] - q[axis] - b.box[1, axis])  # fmt: skip
        apart = max(apart, d)
    if apart > 20.0:  # no less, and far enough for a long step
        return apart
    least = np.inf
    for k in range(len(a.low)):
        for n in range(len(b.low)):
            high = max(q[2] + b.low[n] - p[2] - a.high[k], p[2] + a.low[k] - q[2] - b.high[n])
            high = max(high, 0.0)
            if high >= least:
                continue
            dx, dy = q[0] - p[0], q[1] - p[1]
            flat = _boxes(a, k, b, n, dx, dy)
            if high * high + flat * flat >= least * least:
                continue  # not even their boxes are so near
            if not (a.upright[k] and b.upright[n]):
                flat = polygon_gap(
                    a.corners, a.offsets[k], a.offsets[k + 1],
                    b.corners, b.offsets[n], b.offsets[n + 1], dx, dy,
                )  # fmt: skip
            least = min(least, np.sqrt(high * high + flat * flat))
    return least


@compiled
def _boxes(a: Shape, k: int, b: Shape, n: int, dx: float, dy: float) -> float:
    """Return the distance of the boxes of two polygons, the second moved by (dx, dy)."""
    square = 0.0
    for axis, moved in enumerate((dx, dy)):
        apart = max(b.sides[n, 0, axis] + moved - a.sides[k, 1, axis],
                    a.sides[k, 0, axis] - b.sides[n, 1, axis] - moved)  # fmt: skip
        square += max(apart, 0.0) ** 2
    return float(np.sqrt(square))


@compiled
def positions(course: Course, times: Floats) -> Floats:
    """Return where a head is at ascending times, (k, 3)."""
    found, point, i = np.zeros((len(times), 3)), np.zeros(3), 0
    for k in range(len(times)):
        i = _follow(course, i, times[k], point)
        found[k] = point
    return found


@compiled
def parted(
    a: Floats, first: int, last: int, b: Floats, begin: int, end: int, dx: float, dy: float
) -> bool:
    """Tell whether an edge of the first convex polygon has all of the second outside it.

    The second is moved by (dx, dy).
    """
    for i in range(first, last):
        j = i + 1 if i + 1 < last else first
        ex, ey = a[j, 0] - a[i, 0], a[j, 1] - a[i, 1]
        outside = True
        for k in range(begin, end):
            if ex * (b[k, 1] + dy - a[i, 1]) - ey * (b[k, 0] + dx - a[i, 0]) >= 0.0:
                outside = False
                break
        if outside:
            return True
    return False


@compiled
def to_edge(c: Floats, begin: int, end: int, j: int, x: float, y: float) -> float:
    """Return the distance of a point to the edge that begins at corner j."""
    n = j + 1 if j + 1 < end else begin
    ex, ey = c[n, 0] - c[j, 0], c[n, 1] - c[j, 1]
    length = ex * ex + ey * ey
    share = 0.0
    if length > 0.0:
        share = min(1.0, max(0.0, ((x - c[j, 0]) * ex + (y - c[j, 1]) * ey) / length))
    return float(np.hypot(x - c[j, 0] - share * ex, y - c[j, 1] - share * ey))


@compiled
def polygon_gap(
    a: Floats, first: int, last: int, b: Floats, begin: int, end: int, dx: float, dy: float
) -> float:
    """Return the distance of two convex polygons, the second moved; 0: they overlap.

    The second may be a segment, two corners, or a point twice.
    """
    if not (
        parted(a, first, last, b, begin, end, dx, dy)
        or parted(b, begin, end, a, first, last, -dx, -dy)
    ):
        return 0.0
    least = np.inf
    for i in range(first, last):
        for j in range(begin, end):
            x, y = a[i, 0] - dx, a[i, 1] - dy
            least = min(least, to_edge(b, begin, end, j, x, y))
            x, y = b[j, 0] + dx, b[j, 1] + dy
            least = min(least, to_edge(a, first, last, i, x, y))
    return least
