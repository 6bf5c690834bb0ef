"""Contours and plans as arrays of the page: what is printed where, and by whom when.

Contours are there once; a plan names them. Of what does not print only points are kept that do
not follow from the contours before and behind it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Flags, Floats, Ints
from decmcts.print.contours import Contours, Role
from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.pictures.report.blobs import STEP_MM, STEP_S, Blobs

MOST_POINTS = 1_000_000  # of contours; with more, points that lie nearly on a line are left out
TOLERANCE_MM = 0.02

ROLES = tuple(role.name.lower().replace("_", " ") for role in Role)


def contours_of(
    contours: Contours, blobs: Blobs
) -> tuple[dict[str, Any], dict[str, Any] | None, Ints]:
    """Return the contours for the page; of more than `MOST_POINTS` only essential ones.

    Returns
    -------
    contours : for the page
    thinned : how many points of how many are there; None: all
    rows : (n_points + 1,) how many points before each are there
    """
    points, offsets, thinned = contours.points, contours.offsets, None
    rows = np.arange(len(points) + 1)
    if len(points) > MOST_POINTS:
        kept = essential(points, offsets, TOLERANCE_MM)
        rows = np.concatenate([[0], np.cumsum(kept)])
        offsets = rows[offsets]
        thinned = {"points": int(kept.sum()), "of": len(points), "tolerance_mm": TOLERANCE_MM}
        points = points[kept]
    found = {
        "n": len(contours),
        "sizes": blobs.add(np.diff(offsets)),
        **blobs.places(points),
    }
    for name in ("role", "layer", "tool", "line", "closed"):
        found[name] = blobs.add(getattr(contours, name), delta=name == "line")
    for name in ("width", "height"):
        found[name] = blobs.add(getattr(contours, name), step=STEP_MM)
    return found, thinned, rows


def essential(points: Floats, offsets: Ints, tolerance_mm: float) -> Flags:
    """Tell which points of polylines must stay, (n,): ends, and every other that is no straight.

    A point goes if it stands nearer than the tolerance to the line of its neighbours, and its
    predecessor stays: so no line moves by more than the tolerance.
    """
    kept = np.ones(len(points), np.bool_)
    if len(points) < 3:
        return kept
    a, b, c = points[:-2], points[1:-1], points[2:]
    chord = c - a
    length = np.linalg.norm(chord, axis=1)
    away = np.linalg.norm(np.cross(b - a, chord), axis=1) / np.maximum(length, 1e-9)
    near = (away < tolerance_mm) & (length > 0.0)
    near &= np.einsum("ij,ij->i", b - a, c - b) > 0.0
    flat = np.concatenate([[False], near, [False]])
    flat[offsets[:-1]] = flat[offsets[1:] - 1] = False
    ordinal = np.arange(len(points))
    run = ordinal - np.maximum.accumulate(np.where(flat, -1, ordinal))  # place in a flat run
    kept[flat & (run % 2 == 1)] = False
    return kept


def plan_of(
    document: PlanDocument, rows: Ints, flags: tuple[NDArray[np.uint8], ...], label: str,
    blobs: Blobs,
) -> dict[str, Any]:  # fmt: skip
    """Return one plan for the page; `rows` as `contours_of`, `flags` as `flags_of` has them."""
    heads = [
        _head(document.contours, actions, rows, flag, blobs)
        for actions, flag in zip(document.plan.heads, flags, strict=True)
    ]
    return {"label": label, "end_s": document.plan.makespan_s, "heads": heads}


def _head(
    contours: Contours, actions: HeadActions, rows: Ints, flags: NDArray[np.uint8], blobs: Blobs
) -> dict[str, Any]:
    owner, kept, known = _kept(contours, actions)
    first = contours.offsets[np.maximum(actions.contour, 0)]
    return {
        "name": actions.head,
        "n": len(actions),
        "start": actions.path[0].tolist() if len(actions) else [0.0, 0.0, 0.0],
        "kind": blobs.add(actions.kind),
        "contour": blobs.add(actions.contour, delta=True),
        "reversed": blobs.add(actions.reversed),
        "entry": blobs.add(rows[first + actions.entry] - rows[first]),  # as the page numbers points
        **times_of(actions, blobs),
        "flags": blobs.add(flags),
        "kept": blobs.add(np.bincount(owner[kept], minlength=len(actions))),
        "known": blobs.add(known),
        **blobs.places(actions.path[kept]),
    }


def times_of(actions: HeadActions, blobs: Blobs) -> dict[str, Any]:
    """Return how long a head does nothing before each action, and how long each lasts."""
    begin, end = np.rint(actions.begin_s / STEP_S), np.rint(actions.end_s / STEP_S)
    idle = begin - np.concatenate([[0.0], end[:-1]])
    return {"idle": blobs.add(idle), "lasts": blobs.add(end - begin)}


def _kept(contours: Contours, actions: HeadActions) -> tuple[Ints, Flags, Ints]:
    """Return the action of each point of the paths, which of them are sent, and which are known.

    Of each action the page knows 1: its first point, 2: its last, 3: both, 0: none.
    Paths of prints are known from their contours. So is where a travel begins after one and ends
    before one, unless the contour is a loop entered elsewhere, whose gap moves with the seam.
    """
    owner = np.repeat(np.arange(len(actions)), np.diff(actions.path_offsets))
    rows = np.arange(len(owner))
    begins, ends = actions.path_offsets[:-1], actions.path_offsets[1:] - 1
    plain = (actions.kind == ActionKind.PRINT) & (actions.entry == 0)
    starts, stops = plain.copy(), plain.copy()  # where the contour does
    for ours, place, turned in ((starts, begins, False), (stops, ends, True)):
        c = actions.contour[plain]
        last = actions.reversed[plain] != turned
        due = contours.points[np.where(last, contours.offsets[c + 1] - 1, contours.offsets[c])]
        ours[plain] = (actions.path[place[plain]] == due).all(axis=1)
    moves = actions.kind != ActionKind.PRINT
    behind = moves & np.concatenate([[False], stops[:-1]])[: len(actions)]
    ahead = (
        moves
        & (actions.kind != ActionKind.WAIT)
        & np.concatenate([starts[1:], [False]])[: len(actions)]
    )
    first, last_row = rows == begins[owner], rows == ends[owner]
    sent = moves[owner] & ~(first & behind[owner]) & ~(last_row & ahead[owner])
    return owner, sent, behind + 2 * ahead.astype(np.int64)
