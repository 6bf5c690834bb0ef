"""Which head prints what of each layer, in which strip of its sweep, and where contours are cut.

On each layer every head has a territory of strips (`strips`), and between two territories lies a
*middle* that one of the two prints while others wait. Layers are swept there and back. A strip of
a territory is a *step* of the layer; heads do the same step at once. What lies at the end of a
step is not cut at one place: what touches something printed before it on the layer, such as
infill a wall, is cut earlier in the sweep, so that nothing waits for what a later step prints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Int32s, Ints
from decmcts.feasibility.build import SHELLS
from decmcts.print.contours import Contours, Role
from decmcts.print.cut import INFILL, INSIDE_HOP_MM, LEAST_MM, OUTSIDE, CutLines
from decmcts.print.cut_kernels import SNAP_MM
from decmcts.print.loops import FLAT_MM
from decmcts.print.walls import no_walls, outer_walls
from decmcts.print.walls_kernels import Walls
from decmcts.team.cutting.strips import BIN_MM, Strips, strips_of_layer
from decmcts.team.engine.space import contour_spaces

STEPS = (1, 2, 3, 4, 5, 6, 8, 10)  # strips of a territory that are tried on each layer
DEPTHS = 5  # of contours that touch one another on a layer; deeper ones count as that deep
DEPTH_MM = 0.6  # between the places where contours of neighbouring depths are cut
LOOSE_MM = 2.0 * (LEAST_MM + SNAP_MM)  # by which cuts of both heads may miss their lines
OVER_MM = 6.0  # a contour that reaches no farther beyond its strip stays whole
SAMPLE_MM = 0.5  # along the axis, to find how printing time is spread

NEVER = (
    Role.UNKNOWN, Role.OVERHANG_PERIMETER, Role.BRIDGE_INFILL, Role.IRONING, Role.SKIRT_BRIM,
    Role.WIPE_TOWER, Role.CUSTOM, Role.GAP_FILL,  # thin walls are read as gap fill
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Layout:
    """Regions of all layers: strips of territories and the middles between them.

    Lines part the regions of a layer. Region k of a layer lies between its lines k - 1 and k.
    """

    axis: int  # the heads stand along it: 0 is X, 1 is Y
    heads: int
    steps: Ints  # (layers,) strips of each territory
    forward: Flags  # (layers,) swept towards higher places
    lines: Floats  # (layers, depths, most lines) mm, where each depth is cut; inf: no line
    low: Floats  # (layers, most regions) mm, what is printed with a region may begin here
    high: Floats  # (layers, most regions) mm, and end here

    def region(self, layer: Ints, depth: Ints, at: Floats) -> Ints:
        """Return the region of each place for contours of a layer and depth, (k,)."""
        return np.asarray((self.lines[layer, depth] < at[:, None]).sum(axis=1))

    def nearest_middle(self, layer: Ints, region: Ints) -> Ints:
        """Return the region between two territories that is nearest to each region, (k,)."""
        width = self.steps[layer] + 1
        between = (2 * (region - self.steps[layer]) + width) // (2 * width)
        between = np.clip(between, 0, self.heads - 2)
        return np.asarray(between * width + self.steps[layer])

    def place(self, layer: Ints, region: Ints) -> Ints:
        """Return who prints each region, (k,): by place in the row of heads, the lowest is 0."""
        width = self.steps[layer] + 1
        own = region // width
        middle = region % width == self.steps[layer]
        return np.asarray(own + (middle & ~self.forward[layer]))

    def step(self, layer: Ints, region: Ints) -> Ints:
        """Return the step of the layer at which each region is printed, (k,)."""
        m = self.steps[layer]
        place = region % (m + 1)
        return np.asarray(np.where((place == m) | self.forward[layer], place, m - 1 - place))


@dataclass(frozen=True, slots=True)
class Hops:
    """What a cut costs: the hop or travel from one side of it to what is printed next there."""

    least_mm: float  # a shorter one is made without retracting
    acceleration: float  # mm/s2, of hops
    travel_s: float  # one that is retracted


@dataclass(frozen=True, slots=True)
class Cuttable:
    """What may be cut, and how the printing time of it is spread."""

    may: Flags  # (n,) contours
    depth: Ints  # (n,) how many contours that touch one another come before it on its layer
    deepest: Ints  # (layers,) largest depth on each layer
    work: Floats  # (layers, bins) s of printing in each `BIN_MM` along the axis from `low_mm` on
    price: Floats  # (layers, bins) s that a cut at the end of each bin costs either side of it
    low_mm: float
    stagger_mm: float  # by which cuts move from layer to layer: one way, not at all, the other way
    walls: Walls  # outer ones, that no hop of a piece leads over; none where nothing may be cut


def may_be_cut(contours: Contours, cut: str) -> Flags:
    """Tell which contours may be cut by `cut`, which is "none", "inside" or "all", (n,)."""
    never = NEVER if cut == "all" else NEVER + OUTSIDE
    level = contours.top - contours.bottom <= FLAT_MM
    return np.asarray((cut != "none") & level & ~np.isin(contours.role, never))


def cuttable(
    contours: Contours, seconds: Floats, pairs: Int32s, may: Flags, axis: int,
    hops: Hops, stagger_mm: float,
) -> Cuttable:  # fmt: skip
    """Return how what may be cut is spread; where nothing may be, how all is.

    Parameters
    ----------
    seconds : (n_points,) of the segment ending at each point
    pairs : (m, 2) contours of which the first must come before the second
    """
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    ends = contours.points[:, axis]
    used = may[owner] if may.any() else np.ones(len(owner), np.bool_)
    begun = contours.offsets[:-1][used[contours.offsets[:-1]]]
    used[contours.offsets[:-1]] = False
    rows = np.flatnonzero(used)
    low = float(ends.min(initial=np.inf))
    shape = int(contours.layer.max(initial=-1)) + 1, int(np.ptp(ends) / BIN_MM) + 2
    a, b, layer = (
        np.roll(ends, 1)[rows] - low,
        ends[rows] - low,
        contours.layer[owner[rows]].astype(np.int64),
    )
    work = _work(a, b, seconds[rows], layer, shape)
    place = ((ends[begun] - low) / BIN_MM).astype(np.int64)
    np.add.at(work, (contours.layer[owner[begun]], place), hops.travel_s)  # each is travelled to
    hop_s = 2.0 * np.sqrt(_zigzag(contours, hops.least_mm)[rows] / hops.acceleration)
    price = _price(a, b, np.minimum(hop_s, hops.travel_s) / 2.0, layer, shape)
    depth = _depths(contours, pairs)
    walls = outer_walls(contours) if may.any() else no_walls()
    return Cuttable(may, depth, _deepest(contours, depth), work, price, low, stagger_mm, walls)


def _work(a: Floats, b: Floats, seconds: Floats, layer: Ints, shape: tuple[int, int]) -> Floats:
    """Return the seconds of segments from a to b in each bin of each layer."""
    count = np.maximum(1, np.ceil(np.abs(b - a) / SAMPLE_MM)).astype(np.int64)
    i = np.repeat(np.arange(len(a)), count)
    share = (np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[i]
    cell = layer[i] * shape[1] + ((a[i] + share * (b[i] - a[i])) / BIN_MM).astype(np.int64)
    work = np.bincount(cell, weights=(seconds / count)[i], minlength=shape[0] * shape[1])
    return work.astype(np.float64).reshape(shape)


def _price(a: Floats, b: Floats, cut_s: Floats, layer: Ints, shape: tuple[int, int]) -> Floats:
    """Return the seconds that cutting segments from a to b costs at the end of each bin."""
    first = (np.minimum(a, b) / BIN_MM).astype(np.int64)
    last = (np.maximum(a, b) / BIN_MM).astype(np.int64)
    size = shape[0] * shape[1]
    opened = np.bincount(layer * shape[1] + first, weights=cut_s, minlength=size)
    closed = np.bincount(layer * shape[1] + last, weights=cut_s, minlength=size)
    price = np.cumsum((opened - closed).reshape(shape), axis=1)
    return np.asarray(np.maximum(price, 0.0))


def _zigzag(contours: Contours, least_mm: float) -> Floats:
    """Return how far each segment lies beside one of its contour that runs back, mm, (n_points,).

    Infinite where none does so near that the travel between their ends is not retracted.
    """
    step = np.diff(contours.points, axis=0, append=contours.points[-1:])
    step = np.roll(step, 1, axis=0)  # of the segment ending at each point
    step[contours.offsets[:-1]] = 0.0
    length = np.linalg.norm(step, axis=1)
    owner = np.repeat(np.arange(len(contours)), np.diff(contours.offsets))
    most = np.where(np.isin(contours.role, INFILL), max(INSIDE_HOP_MM, least_mm), least_mm)[owner]
    beside = np.full(len(step), np.inf)
    dot = (step[2:] * step[:-2]).sum(axis=1)
    near = (length[1:-1] > 0.0) & (length[1:-1] < most[1:-1])
    back = near & (dot < -0.7 * length[2:] * length[:-2])
    beside[2:] = np.where(back, length[1:-1], np.inf)
    beside[:-2] = np.minimum(beside[:-2], beside[2:])
    return beside


def deeper(spread: Cuttable, contours: Contours, late: Flags) -> Cuttable:
    """Return the same with those contours cut still earlier in the sweep that are `late`, (n,).

    Those that are cut as early as any may be stay as they are.
    """
    depth = np.minimum(spread.depth + late, DEPTHS)
    return replace(spread, depth=depth, deepest=_deepest(contours, depth))


def _deepest(contours: Contours, depth: Ints) -> Ints:
    """Return the largest depth on each layer, (layers,)."""
    deepest = np.zeros(int(contours.layer.max(initial=-1)) + 1, np.int64)
    np.maximum.at(deepest, contours.layer, depth)
    return deepest


def _depths(contours: Contours, pairs: Int32s) -> Ints:
    """Return how many contours of its layer must come before each one after the other, (n,)."""
    depth = [0] * len(contours)
    same = contours.layer[pairs[:, 0]] == contours.layer[pairs[:, 1]]
    for a, b in pairs[same].tolist():  # ascending: b is final before it is an a
        depth[b] = max(depth[b], depth[a] + 1)
    return np.minimum(np.array(depth, np.int64), DEPTHS)


def layout_of(spread: Cuttable, *, axis: int, heads: int, apart_mm: float) -> Layout:
    """Return the regions in which the print takes least time."""
    layers, most = len(spread.work), heads * (max(STEPS) + 1) - 1
    steps = np.ones(layers, np.int64)
    forward = np.arange(layers) % 2 == 0
    lines = np.full((layers, DEPTHS + 1, most - 1), np.inf)
    low, high = np.full((layers, most), -np.inf), np.full((layers, most), np.inf)
    for layer, work in enumerate(spread.work):
        if not work.any():
            continue
        deepest = int(spread.deepest[layer])
        apart = [_apart(apart_mm, m, bool(forward[layer]), deepest) for m in STEPS]
        tried = [
            strips_of_layer(work, spread.price[layer], spread.low_mm, each, heads) for each in apart
        ]
        best = int(np.argmin([strips.seconds for strips in tried]))
        strips, m = tried[best], STEPS[best]
        steps[layer] = m
        edges = np.concatenate([strips.begin, strips.end[:, -1:]], axis=1).reshape(-1)[1:-1]
        moved = edges + spread.stagger_mm * (layer % 3 - 1)
        lines[layer, :, : len(edges)] = _by_depth(moved, m, bool(forward[layer]), deepest)
        _windows(strips, apart[best], low[layer], high[layer])
    return Layout(axis, heads, steps, forward, lines, low, high)


def layer_by_layer(layouts: Sequence[Layout], choice: Ints) -> Layout:
    """Return the layout that is on each layer as the one of these that is chosen, (layers,)."""
    layer = np.arange(len(choice))

    def chosen(name: str) -> NDArray[Any]:
        return np.asarray(np.stack([getattr(each, name) for each in layouts])[choice, layer])

    return replace(
        layouts[0], steps=chosen("steps"), lines=chosen("lines"),
        low=chosen("low"), high=chosen("high"),
    )  # fmt: skip


def depth_by_layer(contours: Contours, spreads: Sequence[Cuttable], choice: Ints) -> Cuttable:
    """Return the same with depths, on each layer, of the one of these that is chosen."""
    depth = np.stack([each.depth for each in spreads])
    depth = depth[choice[contours.layer], np.arange(len(contours))]
    return replace(spreads[0], depth=depth, deepest=_deepest(contours, depth))


def _apart(apart_mm: float, m: int, forward: bool, deepest: int) -> Floats:
    """Return how far lines must lie apart at each strip for heads to be `apart_mm` apart, (m,)."""
    deep = np.full(m, 1.0)
    deep[0 if forward else m - 1] = 2.0  # where cuts of both territories reach towards each other
    return apart_mm + LOOSE_MM + deep * deepest * DEPTH_MM


def _by_depth(edges: Floats, m: int, forward: bool, deepest: int) -> Floats:
    """Return where contours of each depth are cut, (depths, lines).

    The shallow ones, printed first, reach into the side that is printed later. That is the side
    the sweep goes to; where a territory borders on the middle that its neighbour prints, the other.
    """
    towards = np.full(len(edges), 1.0 if forward else -1.0)
    foreign = np.arange(len(edges)) % (m + 1) == (m if forward else m - 1)
    towards[foreign] *= -1.0
    reach = DEPTH_MM * np.maximum(0, deepest - np.arange(DEPTHS + 1))[:, None] * towards
    moved = edges + reach
    for line in np.flatnonzero(foreign):  # no middle is left, or none to speak of
        other = line - 1 if forward else line + 1
        clamp = np.minimum if forward else np.maximum
        moved[:, other] = clamp(moved[:, other], moved[:, line])
    return np.asarray(np.maximum.accumulate(moved, axis=1))


def _windows(strips: Strips, apart_mm: Floats, low: Floats, high: Floats) -> None:
    """Write from where to where what is printed with each region may reach; mutates both.

    Heads that do the same step share what space is left between them.
    """
    heads, m = strips.begin.shape
    left = (strips.begin[1:] - strips.end[:-1] - apart_mm) / 2.0
    begin, end = np.full((heads, m + 1), -np.inf), np.full((heads, m + 1), np.inf)
    begin[1:, :m], end[:-1, :m] = strips.begin[1:] - left, strips.end[:-1] + left
    begin[:-1, m], end[:-1, m] = strips.end[:-1, -1], strips.begin[1:, 0]
    regions = heads * (m + 1) - 1  # behind the last territory there is no middle
    low[:regions], high[:regions] = begin.reshape(-1)[:-1], end.reshape(-1)[:-1]


@dataclass(frozen=True, slots=True)
class WholeContours:
    """Where each contour of the source is printed if it stays whole."""

    region: Ints  # (n,)
    fits: Flags  # (n,) it lies within what heads may share then


def places_of(contours: Contours, layout: Layout, spread: Cuttable) -> WholeContours:
    """Return the region of each contour: walls go with the first step they touch.

    So nothing that touches a wall is printed before it. What is filled in goes with the last.
    What may not be cut, and reaches too far for that, goes with the other if it fits there.
    """
    low, high = contour_spaces(contours)[:, 2 * layout.axis : 2 * layout.axis + 2].T
    layer, depth = contours.layer.astype(np.int64), spread.depth
    between = (
        layout.region(layer, depth, low + 1e-6), layout.region(layer, depth, high - 1e-6)
    )  # fmt: skip
    wall = np.isin(contours.role, SHELLS)
    region, other = (_by_step(layout, layer, *between, first) for first in (wall, ~wall))
    loose = LOOSE_MM / 2.0
    fits, fits_other = (
        (low >= layout.low[layer, at] - loose) & (high <= layout.high[layer, at] + loose)
        for at in (region, other)
    )
    moved = ~spread.may & ~fits & fits_other
    region, fits = np.where(moved, other, region), fits | moved
    edges = layout.lines[layer, depth]
    padded = np.concatenate(
        [np.full((len(layer), 1), -np.inf), edges, np.full((len(layer), 1), np.inf)], axis=1
    )
    rows = np.arange(len(layer))
    over = np.maximum(padded[rows, region] - low, high - padded[rows, region + 1])
    return WholeContours(region, fits & (~spread.may | (over <= OVER_MM)))


def _by_step(layout: Layout, layer: Ints, begin: Ints, end: Ints, first: Flags) -> Ints:
    """Return which of the regions from begin to end comes first of all, or last of all, (n,)."""
    region, chosen = begin.copy(), np.where(first, np.iinfo(np.int64).max, -1)
    for k in range(int((end - begin).max(initial=0)) + 1):
        candidate = np.minimum(begin + k, np.maximum(begin, end))
        step = layout.step(layer, candidate)
        better = np.where(first, step < chosen, step > chosen)
        region, chosen = np.where(better, candidate, region), np.where(better, step, chosen)
    return region


def lines_of(
    contours: Contours, layout: Layout, spread: Cuttable, places: WholeContours
) -> CutLines:
    """Return where each contour is cut: nowhere if it may stay whole."""
    edges = layout.lines[contours.layer, spread.depth]
    cut = np.isfinite(edges) & (spread.may & ~places.fits)[:, None]
    offsets = np.concatenate([[0], np.cumsum(cut.sum(axis=1))]).astype(np.int64)
    return CutLines(layout.axis, edges[cut], offsets)
