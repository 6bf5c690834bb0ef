"""One layer of a cut print from above: who prints which piece of what, and where the cuts are."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from decmcts.print.cut import cuts_of
from decmcts.print.plan import ActionKind, PlanDocument
from sim.pictures.canvas import head_colour
from sim.pictures.layer_view import lighter

SHADES = (0.0, 0.35, 0.6)  # shares of white, in turn from piece to piece as a head prints them
MARK = "#111111"


def draw_pieces(axis: Any, document: PlanDocument, layer: int, *, inch_a_mm: float) -> None:
    """Draw the pieces of a layer in shades of who prints them, and the cuts between them."""
    contours, heads = document.contours, document.plan.heads
    for k, actions in enumerate(heads):
        printed = np.flatnonzero(actions.kind == ActionKind.PRINT)
        mine = printed[contours.layer[actions.contour[printed]] == layer]
        shades = [lighter(head_colour(k, len(heads)), share) for share in SHADES]
        axis.add_collection(
            LineCollection(
                [actions.action_path(int(a))[:, :2] for a in mine],
                colors=[shades[n % len(shades)] for n in range(len(mine))],
                linewidths=list(
                    np.maximum(contours.width[actions.contour[mine]] * inch_a_mm * 72.0, 0.4)
                ),
                joinstyle="round",
                rasterized=True,
                zorder=2,
            )
        )
    at = cuts_of(contours).before
    owner = np.searchsorted(contours.offsets, at, side="right") - 1
    x, y = contours.points[at[contours.layer[owner] == layer], :2].T
    axis.plot(x, y, ".", color=MARK, ms=1.6, mew=0.0, zorder=3, rasterized=True)


def cut_handle() -> Any:
    """Return the legend's entry of cuts."""
    return Line2D([], [], color=MARK, marker=".", ls="", label="cut; shades: pieces")
