"""Where each head's beads lie, as grids to draw: of any print, however large.

Only counting lives here; nothing is judged.
"""

from __future__ import annotations

import numpy as np
from matplotlib.colors import to_rgb
from scipy.ndimage import maximum_filter

from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.arrays import Floats, Ints

CELLS = 700  # along the longer side
STRIPES = 16  # cells, of all heads' stripes together
CHUNK = 2_000_000  # samples at a time
LEAST_MM = 1e-3  # of a segment: dots go nowhere, and are seen all the same


def bead_grids(
    document: PlanDocument, axes: tuple[int, int], extent: Floats, *, cells: int = CELLS
) -> Floats:
    """Return how much bead of each head lies in each cell, (heads, rows, columns) mm.

    `axes` are the coordinates across and up; `extent` is the box looked at, (2, 3). Each bead
    is as wide as it is, seen from above. From the side it fills the layer below the nozzle.
    """
    low, high = extent[:, list(axes)]
    size = (high - low) / cells if axes[1] == 2 else np.full(2, float((high - low).max() / cells))
    if axes[1] == 2:  # as many rows as layers can be told apart in
        size[1] = max(float(high[1] - low[1]) / 200.0, 1e-6)
    shape = np.maximum(1, np.ceil((high - low) / size)).astype(np.int64)
    wide = float(np.median(document.contours.width)) if len(document.contours) else 0.4
    tall = float(np.median(document.contours.height)) if len(document.contours) else 0.2
    reach = (wide, tall if axes[1] == 2 else wide)
    grids = []
    for actions in document.plan.heads:
        grid = _samples(actions, axes, low, size, shape, drop=tall / 2 if axes[1] == 2 else 0.0)
        around = [int(np.ceil(part / cell)) + 1 for part, cell in zip(reach, size, strict=True)]
        grids.append(maximum_filter(grid, size=(around[1], around[0]), mode="constant"))
    return np.array(grids).reshape(-1, shape[1], shape[0])


def _samples(
    actions: HeadActions,
    axes: tuple[int, int],
    low: Floats,
    size: Floats,
    shape: Ints,
    *,
    drop: float,
) -> Floats:
    """Return the length of a head's printing in each cell, (rows, columns) mm."""
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    rows = np.flatnonzero((owner[1:] == owner[:-1]) & (actions.kind[owner[1:]] == ActionKind.PRINT))
    flat = actions.path[:, list(axes)]
    a, b = flat[rows], flat[rows + 1]
    length = np.linalg.norm(actions.path[rows + 1] - actions.path[rows], axis=1)
    length = np.maximum(length, LEAST_MM)
    count = np.maximum(1, np.ceil(np.abs((b - a) / size).max(axis=1, initial=0.0))).astype(np.int64)
    grid = np.zeros(int(shape.prod()))
    ends = np.cumsum(count)
    cuts = np.searchsorted(ends, np.arange(CHUNK, int(ends[-1]) if len(ends) else 0, CHUNK))
    for part in np.split(np.arange(len(rows)), cuts):
        which = np.repeat(part, count[part])
        within = np.arange(len(which)) - np.repeat(
            np.cumsum(count[part]) - count[part], count[part]
        )
        share = (within + 0.5) / count[which]
        at = a[which] + share[:, None] * (b - a)[which]
        at[:, 1] -= drop
        cell = ((at - low) / size).astype(np.int64)
        sound = ((cell >= 0) & (cell < shape)).all(axis=1)
        number = cell[sound, 1] * shape[0] + cell[sound, 0]
        grid += np.bincount(number, (length / count)[which[sound]], len(grid))
    return grid.reshape(shape[1], shape[0])


def striped(grids: Floats, colours: list[str]) -> Floats:
    """Return the picture of grids, RGBA: cells of several heads are striped by their shares.

    So each colour in it is that of one head, however many heads have printed there.
    """
    total = grids.sum(axis=0)
    share = grids / np.maximum(total, 1e-12)
    rows, columns = np.indices(total.shape)
    phase = (rows + columns) % STRIPES / STRIPES + 0.5 / STRIPES
    head = (phase >= np.cumsum(share, axis=0)[:-1]).sum(axis=0)
    rgb = np.array([to_rgb(colour) for colour in colours])[head]
    return np.concatenate([rgb, (total > 0.0)[..., None].astype(np.float64)], axis=2)
