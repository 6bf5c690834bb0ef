"""Layouts put together layer by layer: each layer is as in the one chosen for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from decmcts.planning.problem.print_problem import load
from decmcts.print.motion import segment_times
from decmcts.team.cutting.layout import (
    Hops,
    cuttable,
    deeper,
    depth_by_layer,
    layer_by_layer,
    layout_of,
    may_be_cut,
)
from tests.prints import slab


def test_each_layer_is_as_in_the_layout_chosen_for_it(tmp_path: Path) -> None:
    """Steps, lines, windows and depths of one layer belong together."""
    problem = load(slab(tmp_path / "slab.gcode"), "dual-gantry")
    contours = problem.job.contours
    seconds = segment_times(contours, problem.machine.limits, problem.job.acceleration)
    spread = cuttable(
        contours, seconds, problem.graph.pairs(), may_be_cut(contours, "all"), 0,
        Hops(2.0, 0.04, 0.2),
    )  # fmt: skip
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
