"""A plan of whole contours told in the pieces of a cut print, to be drawn beside its plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.print.contours import Contours
from decmcts.print.plan import ActionKind, HeadActions, JointPlan, PlanDocument


def before_by_pieces(before: PlanDocument, after: PlanDocument) -> PlanDocument:
    """Return the source's own order in the pieces of a cut print.

    Each contour that is cut is printed piece by piece, in the time it takes whole: what lies of it
    in one strip at once, though the source comes back to the strip.
    """
    pieces = after.contours
    if pieces.of is None or before.contours.of is not None:
        return before
    heads = tuple(_by_pieces(head, pieces) for head in before.plan.heads)
    return replace(before, contours=pieces, plan=JointPlan(heads), acceleration=None)


def _by_pieces(actions: HeadActions, pieces: Contours) -> HeadActions:
    """Return the actions of a head that waits for no other, with a print for each piece."""
    count, share = np.bincount(pieces.sources), _shares(pieces)
    first = np.cumsum(count) - count
    prints = actions.kind == ActionKind.PRINT
    parts = np.where(prints, count[np.where(prints, actions.contour, 0)], 1)
    row = np.repeat(np.arange(len(actions)), parts)
    within = np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)
    piece = np.where(prints[row], first[actions.contour[row]] + within, -1)
    begin_s, end_s = actions.begin_s[row], actions.end_s[row]
    cut = parts[row] > 1
    takes = (end_s - begin_s)[cut]
    end_s[cut] = begin_s[cut] + takes * share[piece[cut], 1]
    begin_s[cut] += takes * share[piece[cut], 0]
    paths = [
        pieces.polyline(int(p)) if of_cut else actions.action_path(int(k))
        for k, p, of_cut in zip(row, piece, cut, strict=True)
    ]
    offsets = np.concatenate([[0], np.cumsum([len(path) for path in paths])]).astype(np.int64)
    return replace(
        actions, kind=actions.kind[row], contour=piece.astype(np.int32),
        reversed=actions.reversed[row], entry=actions.entry[row], path_offsets=offsets,
        path=np.concatenate([np.empty((0, 3)), *paths]), begin_s=begin_s, end_s=end_s,
        after_offsets=np.zeros(len(row) + 1, np.int64), after_head=actions.after_head[:0],
        after_action=actions.after_action[:0], after_point=actions.after_point[:0],
        after_lag_s=actions.after_lag_s[:0],
    )  # fmt: skip


def _shares(pieces: Contours) -> NDArray[np.float64]:
    """Return from which to which share of its contour's printing each piece is printed, (n, 2)."""
    step = np.linalg.norm(np.diff(pieces.points, axis=0, prepend=pieces.points[:1]), axis=1)
    step[pieces.extrusion == 0.0] = 0.0
    length = np.add.reduceat(step, pieces.offsets[:-1])
    begins = np.unique(pieces.sources, return_index=True)[1]
    done = np.cumsum(length)
    before = np.repeat((done - length)[begins], np.diff(np.append(begins, len(pieces))))
    whole = np.repeat(np.add.reduceat(length, begins), np.diff(np.append(begins, len(pieces))))
    whole = np.maximum(whole, 1e-12)[:, None]
    return np.asarray(np.column_stack([done - length - before, done - before]) / whole)
