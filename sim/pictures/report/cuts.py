"""Pieces and cuts for the page: which contour each piece is of, where cuts are, how old welds."""

from __future__ import annotations

from typing import Any

import numpy as np

from decmcts.print.cut import cut_metrics, weld_ages
from decmcts.print.plan import PlanDocument
from sim.pictures.report.blobs import Blobs

STEP_MM = 0.01
STEP_S = 0.001


def cuts_of_page(after: PlanDocument, blobs: Blobs) -> dict[str, Any] | None:
    """Return the cuts of a plan, by contour and along it; None where nothing is cut.

    `before` and `after` are the pieces that meet at each cut, `age` the seconds between the
    printing of its two ends.
    """
    pieces = after.contours
    if pieces.of is None:
        return None
    age, cuts = weld_ages(pieces, after.plan)
    at = pieces.points[cuts.before]
    owner = np.repeat(np.arange(len(pieces)), np.diff(pieces.offsets))
    return {
        "of": blobs.add(pieces.of, delta=True),
        "before": blobs.add(owner[cuts.before], delta=True),
        "after": blobs.add(owner[cuts.after], delta=True),
        "x": blobs.add(at[:, 0], step=STEP_MM, delta=True),
        "y": blobs.add(at[:, 1], step=STEP_MM, delta=True),
        "z": blobs.add(at[:, 2], step=STEP_MM, delta=True),
        "age": blobs.add(age, step=STEP_S),
    }


def cut_facts(after: PlanDocument) -> dict[str, Any] | None:
    """Return the figures of a plan's cuts, with how many are in what; None: nothing is cut."""
    pieces = after.contours
    if pieces.of is None:
        return None
    age, _ = weld_ages(pieces, after.plan)
    named = [[role.replace("_", " "), n] for role, n in cut_metrics(pieces)["roles"].items()]
    return {**after.metrics.get("cut", {}), "roles": named, "in_one_go": int((age == 0.0).sum())}
