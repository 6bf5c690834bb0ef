"""A toolpath as plain actions of one head, straight from end to start.

No lifts, no checks: for tests of what reads and writes files.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.loops import traversal
from decmcts.print.plan import NO_CONTOUR, ActionKind, HeadActions, end_edges
from decmcts.print.toolpath import Toolpath


def visit_points(
    contours: Contours, index: int, *, reversed_: bool = False, entry: int = 0
) -> NDArray[np.float64]:
    """Return the (k, 3) polyline of one contour in the chosen traversal.

    A reversed one runs the way back from where the traversal of its entry ends.
    """
    points = traversal(contours, index, entry).points if entry else contours.polyline(index)
    return points[::-1] if reversed_ else points


def direct_actions(job: PrintJob, toolpath: Toolpath) -> HeadActions:
    """Return travel and print actions with straight travels; the first starts in place."""
    kinds, contours, reverse, entries, paths = [], [], [], [], []
    at = None
    for c, is_reversed, entry in zip(
        toolpath.order.tolist(), toolpath.reversed.tolist(), toolpath.entry.tolist(), strict=True
    ):
        path = visit_points(job.contours, c, reversed_=is_reversed, entry=entry)
        if at is not None:
            kinds.append(ActionKind.TRAVEL)
            contours.append(NO_CONTOUR)
            reverse.append(False)
            entries.append(0)
            paths.append(np.stack([at, path[0]]))
        kinds.append(ActionKind.PRINT)
        contours.append(c)
        reverse.append(is_reversed)
        entries.append(entry)
        paths.append(path)
        at = path[-1]
    k = len(kinds)
    sizes = [len(p) for p in paths]
    return HeadActions(
        "head", np.array(kinds, np.int8), np.array(contours, np.int32), np.array(reverse, np.bool_),
        np.array(entries, np.int32), np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        np.concatenate(paths) if paths else np.zeros((0, 3)), np.zeros(k), np.zeros(k),
        np.zeros(k + 1, np.int64), np.zeros(0, np.int32), np.zeros(0, np.int32), *end_edges(0),
    )  # fmt: skip
