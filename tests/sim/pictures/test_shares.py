"""Grids of beads: all that is printed lies in them, by head."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.print.plan import ActionKind
from sim.pictures import shares
from sim.pictures.shares import bead_grids, mixed


def box(document):
    points = document.contours.points
    return np.array([points.min(axis=0) - 1.0, points.max(axis=0) + 1.0])


@pytest.mark.parametrize("chunk", [7, 10**6])
def test_each_head_has_beads_where_it_prints_and_nowhere_else(make, monkeypatch, chunk):
    """However few samples are taken at a time."""
    monkeypatch.setattr(shares, "CHUNK", chunk)
    document = make.two_head_plan()
    extent = box(document)
    grids = bead_grids(document, (0, 1), extent, cells=60)
    size = float((extent[1] - extent[0])[:2].max()) / 60
    for actions, grid in zip(document.plan.heads, grids, strict=True):
        printed = np.concatenate([
            actions.action_path(k) for k in np.flatnonzero(actions.kind == ActionKind.PRINT)
        ])  # fmt: skip
        there = ((printed[:, :2] - extent[0, :2]) / size).astype(int)
        assert (grid[there[:, 1], there[:, 0]] > 0.0).all()
        filled = np.argwhere(grid > 0.0)[:, ::-1] * size + extent[0, :2]
        far = np.abs(filled[:, None] - printed[None, :, :2]).max(axis=2).min(axis=1)
        assert far.max() < np.ptp(printed[:, :2], axis=0).max()  # within its own part


def test_a_dot_is_seen(make):
    """It goes nowhere, so its length is none."""
    document = make.tower_plan()
    (actions,) = document.plan.heads
    first = int(np.flatnonzero(actions.kind == ActionKind.PRINT)[0])
    a, b = actions.path_offsets[first : first + 2]
    actions.path.flags.writeable = True
    actions.path[a:b] = [50.0, 50.0, 0.2]
    extent = np.array([[49.0, 49.0, 0.0], [51.0, 51.0, 1.0]])
    assert (bead_grids(document, (0, 1), extent, cells=20)[0] > 0.0).any()


def test_cells_are_coloured_by_share_and_clear_where_nothing_is():
    """Half and half is the colour in between."""
    grids = np.array([[[1.0, 2.0, 0.0]], [[1.0, 0.0, 0.0]]])
    rgba = mixed(grids, ["#ff0000", "#0000ff"])
    assert rgba[0].tolist() == [[0.5, 0.0, 0.5, 1.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]]
