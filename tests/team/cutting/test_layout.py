"""Layouts put together layer by layer: each layer is as in the one chosen for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from decmcts.planning.problem.print_problem import load
from decmcts.print.contours import Contours
from decmcts.print.motion import segment_times
from decmcts.team.cutting.layout import (
    Cuttable,
    Hops,
    cuttable,
    deeper,
    depth_by_layer,
    layer_by_layer,
    layout_of,
    may_be_cut,
)
from tests.prints import slab


def spread_of(path: Path, stagger_mm: float = 1.2) -> tuple[Contours, Cuttable]:
    """Return the contours of a slab, and how they are spread."""
    problem = load(slab(path / "slab.gcode"), "dual-gantry")
    contours = problem.job.contours
    seconds = segment_times(contours, problem.machine.limits, problem.job.acceleration)
    spread = cuttable(
        contours, seconds, problem.graph.pairs(), may_be_cut(contours, "all"), 0,
        Hops(2.0, 0.04, 0.2), stagger_mm,
    )  # fmt: skip
    return contours, spread


@pytest.mark.parametrize("stagger_mm", [1.2, 3.0])
def test_cuts_move_from_layer_to_layer(tmp_path: Path, stagger_mm: float) -> None:
    """One way, not at all, the other way, in turn; without it all lie above one another."""
    above, moved = (
        layout_of(spread_of(tmp_path, mm)[1], axis=0, heads=2, apart_mm=70.0)
        for mm in (0.0, stagger_mm)
    )
    for layer in range(4):
        lines = above.lines[layer]
        known = np.isfinite(lines)
        by = moved.lines[layer][known] - lines[known]
        assert known.any()
        assert by == pytest.approx(stagger_mm * (layer % 3 - 1))


def test_each_layer_is_as_in_the_layout_chosen_for_it(tmp_path: Path) -> None:
    """Steps, lines, windows and depths of one layer belong together."""
    contours, spread = spread_of(tmp_path)
    spreads = [spread, deeper(spread, contours, np.ones(len(contours), np.bool_))]
    layouts = [
        layout_of(each, axis=0, heads=2, apart_mm=apart)
        for each, apart in zip(spreads, (70.0, 60.0), strict=True)
    ]
    choice = np.array([1, 0, 0, 1])
    layout = layer_by_layer(layouts, choice)
    depths = depth_by_layer(contours, spreads, choice)
    for layer, k in enumerate(choice):
        assert layout.steps[layer] == layouts[k].steps[layer]
        for name in ("lines", "low", "high"):
            mine, chosen = getattr(layout, name)[layer], getattr(layouts[k], name)[layer]
            assert np.array_equal(mine, chosen)
        own = contours.layer == layer
        assert np.array_equal(depths.depth[own], spreads[k].depth[own])
        assert depths.deepest[layer] == spreads[k].deepest[layer]
    assert not np.array_equal(layouts[0].lines, layouts[1].lines)
