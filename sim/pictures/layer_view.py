"""One layer from above: its beads as a calm ground, and the travels that lead to it.

Of a cut print its pieces, and where the cuts are. A dot or a vertical bead goes nowhere across the
bed: it is a disc as wide as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.cut import cuts_of
from decmcts.print.plan import ActionKind, PlanDocument
from sim.pictures.canvas import TRAVEL, head_colour
from sim.pictures.layer_travels import Travels

GROUND, SHADOW, KEPT = "#d4d4d4", "#f3f3f3", "#555555"
DASHES = (0, (4, 2))
LIGHT = 0.62  # share of white in a calm ground
SHADES = (0.0, 0.35, 0.6)  # shares of white, in turn from piece to piece as a head prints them
MARK = "#111111"
STUB_MM = 1e-3
FULL = 300  # travels drawn with full strength; more are drawn thinner


@dataclass(frozen=True, slots=True)
class LayerView:
    """What is drawn of a layer of one plan."""

    document: PlanDocument
    travels: Travels
    new: Flags  # (travels,) in no place of the other plan
    layer: int  # as the contours number it
    row: int  # as the travels do

    @property
    def rows(self) -> Ints:
        """The travels that lead to the layer."""
        return np.flatnonzero(self.travels.layer == self.row)


def draw_layer(axis: Any, view: LayerView, *, gone: bool, inch_a_mm: float) -> None:
    """Draw a layer; travels that the other plan has not are `gone`, or new in the head's colour."""
    all_actions, travels, rows = view.document.plan.heads, view.travels, view.rows
    _draw_beads(axis, view.document, view.layer, inch_a_mm, (LIGHT,), capstyle="round")
    strength = float(np.clip(FULL / max(len(rows), 1), 0.35, 1.0))
    for k, actions in enumerate(all_actions):
        own = rows[travels.head[rows] == k]
        for changed, inside in product((False, True), (True, False)):
            chosen = own[(view.new[own] == changed) & (travels.inside[own] == inside)]
            spans = zip(travels.first[chosen].tolist(), travels.last[chosen].tolist(), strict=True)
            lines = LineCollection(
                [actions.path[first : last + 1, :2] for first, last in spans],
                colors=changed_colour(k, len(all_actions), gone=gone) if changed else KEPT,
                linewidths=(1.5 if changed else 0.9) * (0.5 + 0.5 * strength),
                linestyles="-" if inside else DASHES,
                alpha=0.5 + 0.5 * strength,
                zorder=4 if changed else 3,
            )
            axis.add_collection(lines)


def changed_colour(head: int, heads: int, *, gone: bool) -> str:
    """Return the colour of a travel that the other plan has not."""
    if gone:
        return TRAVEL
    return head_colour(head, heads) if heads > 1 else "#1f77b4"


def draw_pieces(axis: Any, document: PlanDocument, layer: int, *, inch_a_mm: float) -> Any:
    """Draw the pieces of a layer in shades of who prints them, and the cuts between them.

    Return the legend's entry of cuts.
    """
    contours = document.contours
    _draw_beads(axis, document, layer, inch_a_mm, SHADES)
    at = cuts_of(contours).before
    owner = np.searchsorted(contours.offsets, at, side="right") - 1
    x, y = contours.points[at[contours.layer[owner] == layer], :2].T
    axis.plot(x, y, ".", color=MARK, ms=1.6, mew=0.0, zorder=3, rasterized=True)
    return Line2D([], [], color=MARK, marker=".", ls="", label="cut; shades: pieces")


def _draw_beads(
    axis: Any, document: PlanDocument, layer: int, inch_a_mm: float, shares: Sequence[float],
    **style: str,
) -> None:  # fmt: skip
    """Draw a layer's beads as wide as they are, in the colours of who prints them.

    `shares` of white are mixed in, in turn from bead to bead as a head prints them.
    """
    contours, heads = document.contours, document.plan.heads
    for k, actions in enumerate(heads):
        printed = np.flatnonzero(actions.kind == ActionKind.PRINT)
        printed = printed[contours.layer[actions.contour[printed]] == layer]
        shades = [bead_colour(k, len(heads), share) for share in shares]
        widths = contours.width[actions.contour[printed]] * inch_a_mm * 72.0
        lines = LineCollection(
            [_from_above(actions.action_path(a)) for a in printed.tolist()],
            colors=[shades[n % len(shades)] for n in range(len(printed))],
            linewidths=list(np.maximum(widths, 0.4)),
            joinstyle="round", rasterized=True, zorder=2, **style,
        )  # fmt: skip
        axis.add_collection(lines)


def _from_above(path: Floats) -> Floats:
    """Return a path across the bed, (n, 2) mm; of one that goes nowhere a stub, which is drawn."""
    path = path[:, :2]
    if np.ptp(path, axis=0).any():
        return path
    return np.array([path[0], path[0] + STUB_MM])  # aslant: others are snapped to one pixel


def bead_colour(head: int, heads: int, share: float = LIGHT) -> str:
    """Return a head's colour with a share of white; grey when it is the only one."""
    if heads == 1:
        return GROUND
    r, g, b = (1.0 - (1.0 - part) * (1.0 - share) for part in to_rgb(head_colour(head, heads)))
    return to_hex((r, g, b))


def legend_of(views: Sequence[LayerView]) -> list[Any]:
    """Return the legend of a layer before and after."""
    heads = views[1].document.plan.heads
    names = [f", {actions.head}" for actions in heads] if len(heads) > 1 else [""]
    handles: list[Any] = [
        Patch(color=bead_colour(k, len(heads)), label=f"bead{name}") for k, name in enumerate(names)
    ]
    handles.append(Line2D([], [], color=TRAVEL, lw=1.8, label="travel gone"))
    handles += [
        Line2D([], [], color=changed_colour(k, len(heads), gone=False), lw=1.8,
               label=f"new{name}")
        for k, name in enumerate(names)
    ]  # fmt: skip
    handles.append(Line2D([], [], color=KEPT, lw=1.2, label="in both"))
    if not all(view.travels.inside[view.rows].all() for view in views):
        dashed = Line2D([], [], color=KEPT, lw=1.2, ls=DASHES, label="dashed: from another layer")
        handles.append(dashed)
    return handles
