"""What lies in a loop's gap once its seam has moved: the graph and travels must know it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decmcts.feasibility.build import build_graph
from decmcts.print.contours import Role
from decmcts.print.loops import close_gaps
from decmcts.print.machine import Head, Slice
from decmcts.print.toolpath import Toolpath
from tests.feasibility.travels import toolpath_heights
from tests.print.test_toolpath import contours_of

TIP = np.array([[-0.02, -0.02], [0.02, -0.02], [0.02, 0.02], [-0.02, 0.02]])
NEEDLE = Head("needle", (Slice(0.0, (TIP,)),))


def below_a_gap():
    """A short bead, and above it a loop whose seam's gap lies right over it."""
    loop = [(0.2, 0, 0.4), (8, 0, 0.4), (8, 8, 0.4), (-8, 8, 0.4), (-8, 0, 0.4), (-0.2, 0, 0.4)]
    contours = contours_of([(0, -0.01, 0.2), (0, 0.01, 0.2)], loop)
    return replace(
        contours,
        closed=np.array([False, True]),
        role=np.full(2, Role.PERIMETER, np.int8),
        layer=np.array([0, 1], np.int32),
    )


def test_a_closed_gap_makes_an_edge_the_open_one_does_not() -> None:
    """Entered elsewhere the loop blocks what as sliced stays free."""
    contours = below_a_gap()
    options = {"clearance_mm": 0.0, "bead_width": False}
    assert build_graph(contours, [NEEDLE], **options).n_edges == 0
    closed = build_graph(close_gaps(contours), [NEEDLE], **options)
    assert closed.pairs().tolist() == [[0, 1]]


def test_travels_lift_over_a_gap_that_is_closed() -> None:
    """The way through an open gap is barred once the seam has moved."""
    contours = contours_of(
        [(0.9, 0, 1), (8, 0, 1), (8, 8, 1), (-8, 8, 1), (-8, 0, 1), (-0.9, 0, 1)],
        [(0, -3, 0.2), (0, -2.5, 0.2)],
        [(0, 2.5, 0.2), (0, 3, 0.2)],
    )
    contours = replace(
        contours,
        closed=np.array([True, False, False]),
        role=np.full(3, Role.PERIMETER, np.int8),
        width=np.array([1.8, 0.4, 0.4]),
    )
    thin = replace(contours, width=np.full(3, 0.1))
    order = np.arange(3, dtype=np.int32)
    as_sliced = Toolpath.of(order, np.zeros(3, np.bool_))
    moved = replace(as_sliced, entry=np.array([2, 0, 0], np.int32))
    heights = [
        toolpath_heights(thin, path, NEEDLE, clearance_mm=0.0, cell_mm=0.1)[1]
        for path in (as_sliced, moved)
    ]
    assert heights == [0.2, 1.0]
