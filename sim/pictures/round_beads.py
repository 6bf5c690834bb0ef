"""Dots and vertical beads in pictures: contours that go nowhere across the bed.

Their paths are points, seen from above, so they are drawn by their width: a dot as a disc, a
vertical bead as a ring around a point, from the side as columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection

from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions
from sim.arrays import Flags, Floats, Ints


@dataclass(frozen=True, slots=True)
class RoundBeads:
    """Dots and vertical beads that a head prints."""

    action: Ints  # (k,)
    centre: Floats  # (k, 2) mm
    low: Floats  # (k,) lowest z of the nozzle, mm
    high: Floats  # (k,) highest
    width: Floats  # (k,) mm
    height: Floats  # (k,) of the bead, mm

    @property
    def is_dot(self) -> Flags:
        """Tell which are dots, (k,)."""
        return np.asarray(self.high - self.low <= 0.0)


def round_beads_of(actions: HeadActions, contours: Contours) -> RoundBeads:
    """Return the dots and vertical beads of a head; linear in its points."""
    printed = np.flatnonzero(actions.kind == ActionKind.PRINT)
    first = actions.path_offsets[printed]
    none = len(printed) == 0
    ends = np.stack([first, actions.path_offsets[printed + 1]], axis=1).ravel()
    padded = np.vstack([actions.path, np.zeros((1, 3))])
    low = np.zeros((0, 3)) if none else np.minimum.reduceat(padded, ends)[::2]
    high = np.zeros((0, 3)) if none else np.maximum.reduceat(padded, ends)[::2]
    kept = (low[:, :2] == high[:, :2]).all(axis=1)
    contour = actions.contour[printed[kept]]
    return RoundBeads(
        printed[kept], low[kept, :2], low[kept, 2], high[kept, 2], contours.width[contour],
        contours.height[contour],
    )  # fmt: skip


def draw_from_above(axis: Any, beads: RoundBeads, colour: str) -> None:
    """Draw discs for dots, and rings around a point for vertical beads."""
    for size, rows, filled in (
        (1.0, beads.is_dot, True), (1.0, ~beads.is_dot, False), (0.3, ~beads.is_dot, True),
    ):  # fmt: skip
        width = size * beads.width[rows]
        axis.add_collection(
            EllipseCollection(
                width,
                width,
                np.zeros(len(width)),
                units="xy",
                offsets=beads.centre[rows],
                transOffset=axis.transData,
                facecolors=colour if filled else "none",
                edgecolors="none" if filled else colour,
                linewidths=1.0,
                alpha=0.8,
            )
        )
