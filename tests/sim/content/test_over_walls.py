"""Travel over outer walls, compared with each leg tried against the walls of its layers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from decmcts.print.contours import Role
from sim.content.over_walls import END_MM, SAME_Z_MM, _legs, over_walls_mm, wall_lines


@pytest.mark.parametrize("role", [Role.EXTERNAL_PERIMETER, Role.INFILL])
def test_a_leg_counts_by_the_walls_of_its_two_layers(make, role):
    """Layers lie above one another seen from above, and a travel is over those of its own only."""
    places = ((20.0, 20.0), (60.0, 20.0), (40.0, 21.0))
    plan = make.tower_plan(layers=6, towers=places)
    contours = replace(plan.contours, role=np.full(len(plan.contours), role, np.int8))
    lower = contours.layer < 3
    contours = replace(contours, role=np.where(lower, contours.role, Role.SOLID_INFILL))
    walls, height, _ = wall_lines(contours)
    due = 0.0
    for start, end, before, behind in zip(*_legs(contours, plan.plan.heads[0]), strict=True):
        length = float(np.hypot(*(end - start)))
        cut = (end - start) * END_MM / length
        own = np.minimum(np.abs(height - before), np.abs(height - behind)) <= SAME_Z_MM
        line = shapely.LineString([start + cut, end - cut])
        due += length * bool(line.intersects(shapely.MultiLineString(walls[own].tolist())))
    assert over_walls_mm(contours, plan.plan.heads[0]) == pytest.approx(due)
    assert (due > 0.0) == (role == Role.EXTERNAL_PERIMETER)
