"""One layer from above: its beads as a calm ground, and the travels that lead to it.

Of a cut print its pieces, and where the cuts are. A dot or a vertical bead goes nowhere across the
bed: it is a disc as wide as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from decmcts.print.contours import Contours
from decmcts.print.cut import cuts_of
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.arrays import Flags, Floats, Ints
from sim.pictures.canvas import TRAVEL, head_colour
from sim.pictures.layer_travels import Travels

GROUND, SHADOW, KEPT = "#d4d4d4", "#f3f3f3", "#555555"
DASHES = (0, (4, 2))
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
        return self.travels.of_layer(self.row)


def draw_layer(axis: Any, view: LayerView, *, gone: bool, inch_a_mm: float) -> None:
    """Draw a layer; travels that the other plan has not are `gone`, or new in the head's colour."""
    _draw_beads(axis, view, inch_a_mm)
    heads = len(view.document.plan.heads)
    rows = view.rows
    strength = float(np.clip(FULL / max(len(rows), 1), 0.35, 1.0))
    for k, actions in enumerate(view.document.plan.heads):
        own = rows[view.travels.head[rows] == k]
        for changed in (False, True):
            for inside in (True, False):
                chosen = own[
                    (view.new[own] == changed) & (view.travels.inside[own] == inside)
                ]  # fmt: skip
                first, last = view.travels.first[chosen], view.travels.last[chosen]
                paths = [
                    actions.path[a : b + 1, :2]
                    for a, b in zip(first.tolist(), last.tolist(), strict=True)
                ]
                colour = changed_colour(k, heads, gone=gone) if changed else KEPT
                axis.add_collection(
                    LineCollection(
                        paths,
                        colors=colour,
                        linewidths=(1.5 if changed else 0.9) * (0.5 + 0.5 * strength),
                        linestyles="-" if inside else DASHES,
                        alpha=0.5 + 0.5 * strength,
                        zorder=4 if changed else 3,
                    )
                )


def changed_colour(head: int, heads: int, *, gone: bool) -> str:
    """Return the colour of a travel that the other plan has not."""
    if gone:
        return TRAVEL
    return head_colour(head, heads) if heads > 1 else "#1f77b4"


def _draw_beads(axis: Any, view: LayerView, inch_a_mm: float) -> None:
    """Draw the beads of the layer as wide as they are, in light colours of who prints them."""
    contours, heads = view.document.contours, view.document.plan.heads
    for k, actions in enumerate(heads):
        mine = _printed_in(actions, contours, view.layer)
        colour = lighter(head_colour(k, len(heads))) if len(heads) > 1 else GROUND
        beads = _lines_of(actions, contours, mine, inch_a_mm)
        axis.add_collection(LineCollection(colors=colour, capstyle="round", **beads))


def draw_pieces(axis: Any, document: PlanDocument, layer: int, *, inch_a_mm: float) -> None:
    """Draw the pieces of a layer in shades of who prints them, and the cuts between them."""
    contours, heads = document.contours, document.plan.heads
    for k, actions in enumerate(heads):
        mine = _printed_in(actions, contours, layer)
        shades = [lighter(head_colour(k, len(heads)), share) for share in SHADES]
        colours = [shades[n % len(shades)] for n in range(len(mine))]
        beads = _lines_of(actions, contours, mine, inch_a_mm)
        axis.add_collection(LineCollection(colors=colours, **beads))
    at = cuts_of(contours).before
    owner = np.searchsorted(contours.offsets, at, side="right") - 1
    x, y = contours.points[at[contours.layer[owner] == layer], :2].T
    axis.plot(x, y, ".", color=MARK, ms=1.6, mew=0.0, zorder=3, rasterized=True)


def cut_handle() -> Any:
    """Return the legend's entry of cuts."""
    return Line2D([], [], color=MARK, marker=".", ls="", label="cut; shades: pieces")


def _printed_in(actions: HeadActions, contours: Contours, layer: int) -> Ints:
    printed = np.flatnonzero(actions.kind == ActionKind.PRINT)
    return np.asarray(printed[contours.layer[actions.contour[printed]] == layer])


def _lines_of(
    actions: HeadActions, contours: Contours, rows: Ints, inch_a_mm: float
) -> dict[str, Any]:
    """Return lines as wide as the beads of some actions, for a collection of them."""
    widths = contours.width[actions.contour[rows]] * inch_a_mm * 72.0
    return {
        "segments": [_from_above(actions.action_path(int(a))) for a in rows],
        "linewidths": list(np.maximum(widths, 0.4)),
        "joinstyle": "round", "rasterized": True, "zorder": 2,
    }  # fmt: skip


def _from_above(path: Floats) -> Floats:
    """Return a path across the bed, (n, 2) mm; of one that goes nowhere a stub, which is drawn."""
    path = path[:, :2]
    if np.ptp(path, axis=0).any():
        return path
    return np.array([path[0], path[0] + STUB_MM])  # aslant: others are snapped to one pixel


def lighter(colour: str, share: float = 0.62) -> str:
    """Return a colour mixed with white."""
    r, g, b = (1.0 - (1.0 - part) * (1.0 - share) for part in to_rgb(colour))
    return to_hex((r, g, b))


def legend_of(views: Sequence[LayerView]) -> list[Any]:
    """Return the legend of a layer before and after."""
    heads = views[1].document.plan.heads
    names = [f", {actions.head}" for actions in heads] if len(heads) > 1 else [""]
    handles: list[Any] = [
        Patch(color=lighter(head_colour(k, len(heads))) if len(heads) > 1 else GROUND,
              label=f"bead{name}")
        for k, name in enumerate(names)
    ]  # fmt: skip
    handles.append(Line2D([], [], color=TRAVEL, lw=1.8, label="travel gone"))
    handles += [
        Line2D([], [], color=changed_colour(k, len(heads), gone=False), lw=1.8,
               label=f"new{name}")
        for k, name in enumerate(names)
    ]  # fmt: skip
    handles.append(Line2D([], [], color=KEPT, lw=1.2, label="in both"))
    crossing = any(not view.travels.inside[view.rows].all() for view in views)
    if crossing:
        dashed = Line2D([], [], color=KEPT, lw=1.2, ls=DASHES, label="dashed: from another layer")
        handles.append(dashed)
    return handles
