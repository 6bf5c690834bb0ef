"""Whether a source leaves travels inside the part bare, learned from what its file does.

Cura's combing shows in nothing else; PrusaSlicer's and Slic3r's settings name it
(`only_retract_when_crossing_perimeters`), and then a single such travel is enough.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.job import ProcessSettings
from decmcts.print.walls import bare_pairs, outer_walls

HABIT_SHARE = 0.8  # of the long travels inside the part that must be bare
LEAST_SEEN = 5  # of them, where no setting names the habit
_SAID = re.compile(rb"^; *only_retract_when_crossing_perimeters *= *1", re.M)


def longest_bare(
    text: bytes, contours: Contours, settings: ProcessSettings, pulled: NDArray[np.bool_]
) -> float:
    """Return the longest travel inside the part that the source leaves bare, 0 for no such habit.

    Parameters
    ----------
    pulled : (n - 1,)
        Whether the source retracts between a contour and the next.
    """
    if not pulled.any():
        return 0.0
    start, goal = contours.end[:-1], contours.start[1:]
    length = np.linalg.norm(goal - start, axis=1)
    long = np.flatnonzero(length >= settings.retract_min_travel_mm)
    inside = long[bare_pairs(outer_walls(contours), np.inf, start[long], goal[long])]
    order = inside[np.argsort(length[inside], kind="stable")]
    bare = ~pulled[order]
    # up to where the source most often does as the rule would: bare before, retracted beyond
    right = np.concatenate([[0], np.cumsum(np.where(bare, 1, -1))])
    kept = int(np.argmax(right))
    seen = int(bare[:kept].sum())
    least = 1 if _SAID.search(text) else LEAST_SEEN
    if seen < least or seen < HABIT_SHARE * kept:
        return 0.0
    return float(np.ceil(1000.0 * length[order[:kept][bare[:kept]]].max()) / 1000.0)
