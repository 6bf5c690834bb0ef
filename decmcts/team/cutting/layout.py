"""Which head prints what of each layer, in which strip of its sweep, and where contours are cut.

On each layer every head has a territory of strips (`strips`), and between two territories lies a
*middle* that one of the two prints while others wait. Layers are swept there and back. A strip of
a territory is a *step* of the layer; heads do the same step at once. What lies at the end of a
step is not cut at one place: what touches something printed before it on the layer, such as
infill a wall, is cut earlier in the sweep, so that nothing waits for what a later step prints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.geometry.cutting import SNAP_MM
from decmcts.feasibility.touching import SHELLS
from decmcts.print.contours import Contours, Role
from decmcts.print.cut import LEAST_MM, OUTSIDE, Lines
from decmcts.print.loops import FLAT_MM
from decmcts.team.cutting.strips import BIN_MM, Strips, strips_of_layer
from decmcts.team.engine.space import contour_boxes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

STEPS = (1, 2, 3, 4, 5, 6)  # strips of a territory that are tried on each layer
DEPTHS = 3  # of contours that touch one another on a layer; deeper ones count as that deep
DEPTH_MM = 0.6  # between the places where contours of neighbouring depths are cut
LOOSE_MM = 2.0 * (LEAST_MM + SNAP_MM)  # by which cuts of both heads may miss their lines
OVER_MM = 6.0  # a contour that reaches no farther beyond its strip stays whole
STAGGER_MM = 1.2  # by which cuts move from layer to layer, in turn one way, not, the other way
SAMPLE_MM = 0.5  # along the axis, to find how printing time is spread

NEVER = (
    Role.UNKNOWN, Role.OVERHANG_PERIMETER, Role.BRIDGE_INFILL, Role.IRONING, Role.SKIRT_BRIM,
    Role.WIPE_TOWER, Role.CUSTOM,
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

    def head(self, layer: Ints, region: Ints) -> Ints:
        """Return who prints each region, (k,)."""
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
class Cuttable:
    """What may be cut, and how the printing time of it is spread."""

    may: Flags  # (n,) contours
    depth: Ints  # (n,) how many contours that touch one another come before it on its layer
    work: Floats  # (layers, bins) s of printing in each `BIN_MM` along the axis from `low_mm` on
    crossing: Floats  # (layers, bins) segments that cross the end of each bin
    low_mm: float


def may_be_cut(contours: Contours, cut: str) -> Flags:
    """Tell which contours may be cut by `cut`, which is "none", "inside" or "all", (n,)."""
    never = NEVER if cut == "all" else NEVER + OUTSIDE
    level = contours.top - contours.bottom <= FLAT_MM
    return np.asarray((cut != "none") & level & ~np.isin(contours.role, never))


def cuttable(
    contours: Contours, seconds: Floats, pairs: NDArray[np.int32], may: Flags, axis: int
) -> Cuttable:
    """Return how what may be cut is spread; where nothing may be, how all is.

    Parameters
    ----------
    seconds : (n_points,) of the segment ending at each point
    pairs : (m, 2) contours of which the first must come before the second
    """
    sizes = np.diff(contours.offsets)
    owner = np.repeat(np.arange(len(contours)), sizes)
    ends = contours.points[:, axis]
    begins = np.roll(ends, 1)
    used = may[owner] if may.any() else np.ones(len(owner), np.bool_)
    used[contours.offsets[:-1]] = False
    rows = np.flatnonzero(used)
    a, b, layer = begins[rows], ends[rows], contours.layer[owner[rows]]
    low = float(ends.min(initial=np.inf))
    bins = int(np.ptp(ends) / BIN_MM) + 2 if len(ends) else 1
    layers = int(contours.layer.max(initial=-1)) + 1
    count = np.maximum(1, np.ceil(np.abs(b - a) / SAMPLE_MM)).astype(np.int64)
    i = np.repeat(np.arange(len(rows)), count)
    share = (np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[i]
    cell = ((a[i] + share * (b[i] - a[i]) - low) / BIN_MM).astype(np.int64)
    work = np.bincount(
        layer[i] * bins + cell, weights=(seconds[rows] / count)[i], minlength=layers * bins
    ).reshape(layers, bins)
    first = ((np.minimum(a, b) - low) / BIN_MM).astype(np.int64)
    last = ((np.maximum(a, b) - low) / BIN_MM).astype(np.int64)
    opened = np.bincount(layer * bins + first, minlength=layers * bins).reshape(layers, bins)
    closed = np.bincount(layer * bins + last, minlength=layers * bins).reshape(layers, bins)
    crossing = np.cumsum((opened - closed).astype(np.float64), axis=1)
    return Cuttable(may, _depths(contours, pairs), work.astype(np.float64), crossing, low)


def _depths(contours: Contours, pairs: NDArray[np.int32]) -> Ints:
    """Return how many contours of its layer must come before each one after the other, (n,).

    What is filled in last counts as deepest: it touches walls of any depth.
    """
    depth = [0] * len(contours)
    same = contours.layer[pairs[:, 0]] == contours.layer[pairs[:, 1]]
    for a, b in pairs[same].tolist():  # ascending: b is final before it is an a
        depth[b] = max(depth[b], depth[a] + 1)
    inside = ~np.isin(contours.role, SHELLS)
    return np.where(inside, DEPTHS, np.minimum(np.array(depth, np.int64), DEPTHS))


def layout_of(spread: Cuttable, *, axis: int, heads: int, apart_mm: float, cut_s: float) -> Layout:
    """Return the regions in which the print takes least time, cuts counted at `cut_s` each."""
    layers, most = len(spread.work), heads * (max(STEPS) + 1) - 1
    steps = np.ones(layers, np.int64)
    forward = np.arange(layers) % 2 == 0
    lines = np.full((layers, DEPTHS + 1, most - 1), np.inf)
    low, high = np.full((layers, most), -np.inf), np.full((layers, most), np.inf)
    for layer, work in enumerate(spread.work):
        if not work.any():
            continue
        apart = [_apart(apart_mm, m, bool(forward[layer])) for m in STEPS]
        tried = [strips_of_layer(work, spread.low_mm, each, heads) for each in apart]
        costs = [strips.seconds + cut_s / heads * _cuts(spread, layer, strips) for strips in tried]
        best = int(np.argmin(costs))
        strips, m = tried[best], STEPS[best]
        steps[layer] = m
        edges = np.concatenate([strips.begin, strips.end[:, -1:]], axis=1).reshape(-1)[1:-1]
        lines[layer, :, : len(edges)] = _by_depth(edges, m, bool(forward[layer]), layer)
        _windows(strips, apart[best], low[layer], high[layer])
    return Layout(axis, heads, steps, forward, lines, low, high)


def _apart(apart_mm: float, m: int, forward: bool) -> Floats:
    """Return how far lines must lie apart at each strip for heads to be `apart_mm` apart, (m,)."""
    deep = np.full(m, 1.0)
    deep[0 if forward else m - 1] = 2.0  # where cuts of both territories reach towards each other
    return apart_mm + LOOSE_MM + deep * DEPTHS * DEPTH_MM


def _cuts(spread: Cuttable, layer: int, strips: Strips) -> float:
    """Return about how many cuts the strips of a layer make."""
    edges = np.unique(np.concatenate([strips.begin.ravel(), strips.end.ravel()]))[1:-1]
    cell = ((edges - spread.low_mm) / BIN_MM).astype(np.int64)
    return float(spread.crossing[layer, np.clip(cell, 0, spread.crossing.shape[1] - 1)].sum())


def _by_depth(edges: Floats, m: int, forward: bool, layer: int) -> Floats:
    """Return where contours of each depth are cut, (depths, lines).

    The shallow ones, printed first, reach into the side that is printed later. That is the side
    the sweep goes to; where a territory borders on the middle that its neighbour prints, the other.
    """
    towards = np.full(len(edges), 1.0 if forward else -1.0)
    foreign = np.arange(len(edges)) % (m + 1) == (m if forward else m - 1)
    towards[foreign] *= -1.0
    reach = DEPTH_MM * (DEPTHS - np.arange(DEPTHS + 1))[:, None] * towards
    moved = edges + reach + STAGGER_MM * (layer % 3 - 1)
    return np.asarray(np.maximum.accumulate(moved, axis=1))


def _windows(strips: Strips, apart_mm: Floats, low: Floats, high: Floats) -> None:
    """Write from where to where what is printed with each region may reach; mutates both.

    Heads that do the same step share what room is left between them.
    """
    heads, m = strips.begin.shape
    left = (strips.begin[1:] - strips.end[:-1] - apart_mm) / 2.0
    for head in range(heads):
        for step in range(m):
            region = head * (m + 1) + step
            if head + 1 < heads:
                high[region] = strips.end[head, step] + left[head, step]
            if head > 0:
                low[region] = strips.begin[head, step] - left[head - 1, step]
        if head + 1 < heads:
            middle = head * (m + 1) + m
            low[middle], high[middle] = strips.end[head, -1], strips.begin[head + 1, 0]


@dataclass(frozen=True, slots=True)
class Places:
    """Where each contour of the source is printed if it stays whole."""

    region: Ints  # (n,)
    fits: Flags  # (n,) it lies within what heads may share then


def places_of(contours: Contours, layout: Layout, spread: Cuttable) -> Places:
    """Return the region of each contour: walls go with the first step they touch.

    So nothing that touches a wall is printed before it. What is filled in goes with the last.
    """
    low, high = contour_boxes(contours)[:, 2 * layout.axis : 2 * layout.axis + 2].T
    layer, depth = contours.layer.astype(np.int64), spread.depth
    first = layout.region(layer, depth, low + 1e-6)
    last = np.maximum(first, layout.region(layer, depth, high - 1e-6))
    wall = depth < DEPTHS
    region, chosen = first.copy(), np.where(wall, np.iinfo(np.int64).max, -1)
    for k in range(int((last - first).max(initial=0)) + 1):
        candidate = np.minimum(first + k, last)
        step = layout.step(layer, candidate)
        better = np.where(wall, step < chosen, step > chosen)
        region, chosen = np.where(better, candidate, region), np.where(better, step, chosen)
    fits = (low >= layout.low[layer, region] - 1e-9) & (high <= layout.high[layer, region] + 1e-9)
    edges = layout.lines[layer, depth]
    padded = np.concatenate(
        [np.full((len(layer), 1), -np.inf), edges, np.full((len(layer), 1), np.inf)], axis=1
    )
    rows = np.arange(len(layer))
    over = np.maximum(padded[rows, region] - low, high - padded[rows, region + 1])
    return Places(region, fits & (~spread.may | (over <= OVER_MM)))


def lines_of(contours: Contours, layout: Layout, spread: Cuttable, places: Places) -> Lines:
    """Return where each contour is cut: nowhere if it may stay whole."""
    edges = layout.lines[contours.layer, spread.depth]
    cut = np.isfinite(edges) & (spread.may & ~places.fits)[:, None]
    offsets = np.concatenate([[0], np.cumsum(cut.sum(axis=1))]).astype(np.int64)
    return Lines(layout.axis, edges[cut], offsets)
