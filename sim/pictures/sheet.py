"""Where everything stands on a picture of a plan, by the shape of the print."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.arrays import Floats

FigureBox = tuple[float, float, float, float]  # left, bottom, width, height in parts of the figure

VIEW_IN = 4.6  # of a view: the longer side, inches
SHAPES = 0.5, 1.35  # of a view: least and largest height over width
LEFT, RIGHT, GAP = 0.75, 0.3, 0.35
ROWS = 1.05  # left of the chart of heads
HEAD, TITLE, UNDER = 0.75, 0.5, 0.55  # above the views: title, own titles; below: axis
LEGEND, CHART, CHART_GAP = 0.4, 1.35, 0.5
ENTRIES, ENTRY_ROW = 7, 0.17  # of the legend in a row, and the height of a further row
ROW_IN, TIMES_HEAD = 0.42, 0.75  # of the chart of heads: a head, and what stands around them


@dataclass(frozen=True, slots=True)
class Sheet:
    """Sizes and places."""

    size: tuple[float, float]  # inches
    extent: Floats  # (2, 3) mm: the box that views show
    views: tuple[FigureBox, ...]
    chart: FigureBox
    side: FigureBox
    times: FigureBox
    legend: float  # its top, in parts of the height

    @property
    def left(self) -> float:
        """Where titles begin, in parts of the width."""
        return LEFT / self.size[0]

    @property
    def inch_a_mm(self) -> float:
        """The scale of the views."""
        across = float(self.extent[1, 0] - self.extent[0, 0])
        return self.views[0][2] * self.size[0] / across

    def top(self, below_in: float) -> float:
        """Return the height of what stands so far below the top, in parts."""
        return 1.0 - below_in / self.size[1]


def sheet_of(extent: Floats, heads: int) -> Sheet:
    """Return the sheet for a print in this box, for one head or several."""
    extent = _shaped(extent)
    across, up = (extent[1] - extent[0])[:2].tolist()
    scale = min(VIEW_IN / across, VIEW_IN / up)
    w, h = scale * across, scale * up
    columns = 3 if heads > 1 else 2
    width = LEFT + columns * w + (columns - 1) * GAP + RIGHT
    times = TIMES_HEAD + ROW_IN * heads + 0.1 if heads > 1 else 0.0
    rows = -(-(2 * heads + 3) // ENTRIES)
    below = LEGEND + ENTRY_ROW * (rows - 1) + CHART + CHART_GAP + times
    height = HEAD + TITLE + h + UNDER + below + 0.1
    size = (width, height)

    def place(x: float, y: float, wide: float, high: float) -> FigureBox:
        return x / width, y / height, wide / width, high / height

    foot = 0.1 + below + UNDER
    views = tuple(place(LEFT + k * (w + GAP), foot, w, h) for k in range(columns))
    chart_y = 0.1 + times + CHART_GAP
    third = LEFT + 2 * (w + GAP)
    return Sheet(
        size, extent, views,
        place(LEFT, chart_y, 2 * w + GAP - (0.25 if heads > 1 else 0.0), CHART - 0.25),
        place(third, chart_y, w, CHART - 0.25),
        place(ROWS, CHART_GAP, width - ROWS - RIGHT, ROW_IN * heads),
        (0.1 + below + 0.05) / height,
    )  # fmt: skip


def _shaped(extent: Floats) -> Floats:
    """Return a box that is neither too flat nor too high for a view."""
    made = extent.astype(np.float64)
    size = np.maximum(made[1] - made[0], 1e-6)
    least, most = SHAPES
    wanted = np.array([max(size[0], size[1] / most), max(size[1], least * size[0]), size[2]])
    middle = (made[0] + made[1]) / 2
    made[0, :2], made[1, :2] = (middle - wanted / 2)[:2], (middle + wanted / 2)[:2]
    return made
