"""One layer from above: its beads as a calm ground, and the travels that lead to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from decmcts.print.plan import ActionKind, PlanDocument
from sim.arrays import Flags, Ints
from sim.pictures.canvas import TRAVEL, head_colour
from sim.pictures.layer_travels import Travels
from sim.pictures.round_beads import RoundBeads, draw_from_above, round_beads_of

GROUND, SHADOW, KEPT = "#d4d4d4", "#f3f3f3", "#555555"
DASHES = (0, (4, 2))
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
        printed = np.flatnonzero(actions.kind == ActionKind.PRINT)
        mine = printed[contours.layer[actions.contour[printed]] == view.layer]
        paths = [actions.action_path(int(a))[:, :2] for a in mine]
        widths = contours.width[actions.contour[mine]] * inch_a_mm * 72.0
        colour = lighter(head_colour(k, len(heads))) if len(heads) > 1 else GROUND
        axis.add_collection(
            LineCollection(
                paths,
                colors=colour,
                linewidths=list(np.maximum(widths, 0.4)),
                capstyle="round",
                joinstyle="round",
                rasterized=True,
                zorder=2,
            )
        )
        draw_from_above(axis, _of(round_beads_of(actions, contours), mine), colour)


def _of(beads: RoundBeads, actions: Ints) -> RoundBeads:
    """Return the dots and vertical beads of some actions."""
    kept = np.isin(beads.action, actions)
    return RoundBeads(
        beads.action[kept], beads.centre[kept], beads.low[kept], beads.high[kept],
        beads.width[kept], beads.height[kept],
    )  # fmt: skip


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
