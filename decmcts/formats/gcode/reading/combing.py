"""Whether a source leaves travels inside the part bare, learned from what its file does.

Cura's combing shows in nothing else; PrusaSlicer's and Slic3r's settings name it
(`only_retract_when_crossing_perimeters`), and then a single such travel is enough.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.job import ProcessSettings
from decmcts.print.walls import bare_pairs, outer_walls
from decmcts.print.walls_kernels import SAME_Z_MM

HABIT_SHARE = 0.8  # of the long travels inside the part that must be bare
LEAST_SEEN = 5  # of them, where no setting names the habit; of changes to a next layer, always
LAYERS = 2.0  # layer heights a change to a next layer may climb
_SAID = re.compile(rb"^; *only_retract_when_crossing_perimeters *= *1", re.M)


def with_bare_travels(
    text: bytes, contours: Contours, settings: ProcessSettings, pulled: NDArray[np.bool_]
) -> ProcessSettings:
    """Return the settings with the travels inside the part that the source leaves bare.

    Their greatest length is learned, and their greatest climb to a next layer; 0 for no such habit.

    Parameters
    ----------
    pulled : (n - 1,)
        Whether the source retracts between a contour and the next.
    """
    if not pulled.any():
        return settings
    start, goal = contours.end[:-1], contours.start[1:]
    length = np.linalg.norm(goal - start, axis=1)
    long = np.flatnonzero(length >= settings.retract_min_travel_mm)
    most = LAYERS * float(np.median(contours.height))
    walls = outer_walls(contours)
    inside = long[bare_pairs(walls, np.inf, start[long], goal[long], climb_mm=most)]
    rise = goal[inside, 2] - start[inside, 2]
    climbs = rise > SAME_Z_MM
    least = 1 if _SAID.search(text) else LEAST_SEEN
    longest = _longest(inside[~climbs], length, pulled, least)
    if longest == 0.0:
        return settings
    bare = ~pulled[inside[climbs]]
    if bare.sum() < max(LEAST_SEEN, HABIT_SHARE * len(bare)):
        return replace(settings, bare_inside_mm=longest)
    return replace(
        settings,
        bare_inside_mm=max(longest, _longest(inside, length, pulled, least)),
        bare_climb_mm=float(np.ceil(1000.0 * rise[climbs][bare].max() - 1e-3) / 1000.0),
    )


def _longest(
    inside: NDArray[np.int64], length: NDArray[np.float64], pulled: NDArray[np.bool_], least: int
) -> float:
    """Return the longest bare one of these travels, 0 if too few of the long ones are bare."""
    order = inside[np.argsort(length[inside], kind="stable")]
    bare = ~pulled[order]
    # up to where the source most often does as the rule would: bare before, retracted beyond
    right = np.concatenate([[0], np.cumsum(np.where(bare, 1, -1))])
    kept = int(np.argmax(right))
    seen = int(bare[:kept].sum())
    if seen < least or seen < HABIT_SHARE * kept:
        return 0.0
    return float(np.ceil(1000.0 * length[order[:kept][bare[:kept]]].max()) / 1000.0)
