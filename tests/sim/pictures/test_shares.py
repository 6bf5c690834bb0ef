"""Grids of beads: all that is printed lies in them, by head."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.print.plan import ActionKind
from sim.pictures import drawings
from sim.pictures.drawings import bead_grids, striped


def box(document):
    points = document.contours.points
    return np.array([points.min(axis=0) - 1.0, points.max(axis=0) + 1.0])


@pytest.mark.parametrize("chunk", [7, 10**6])
def test_each_head_has_beads_where_it_prints_and_nowhere_else(make, monkeypatch, chunk):
    """However few samples are taken at a time."""
    monkeypatch.setattr(drawings, "CHUNK", chunk)
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


def test_cells_of_several_heads_are_striped_by_share():
    """Each colour is that of one head, also with three: a mixture would be nobody's."""
    colours = ["#ff0000", "#00ff00", "#0000ff"]
    grids = np.zeros((3, 32, 32))
    grids[:, :16] = np.array([1.0, 2.0, 1.0])[:, None, None]  # a quarter, half, a quarter
    grids[1, 20] = 5.0
    rgba = striped(grids, colours)
    several, alone, nobody = rgba[:16], rgba[20], rgba[24]
    shares = [(several == [*rgb, 1.0]).all(axis=2).mean() for rgb in np.eye(3)]
    assert shares == [0.25, 0.5, 0.25]
    assert (alone == [0.0, 1.0, 0.0, 1.0]).all()
    assert (nobody[:, 3] == 0.0).all()
