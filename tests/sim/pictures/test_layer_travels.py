"""Pictures say what changed: which travels are gone, which are new, and where they lead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from decmcts.print.plan import ActionKind, JointPlan
from sim.pictures.layer_travels import by_layer, in_no_place_of, layers_of, most_changed, travels_of


def naive(document):
    """Walk a plan action by action: (head, layer, length) of each way to a contour."""
    found = []
    for k, actions in enumerate(document.plan.heads):
        way = 0.0
        for action in range(len(actions)):
            path = actions.action_path(action)
            if actions.kind[action] == ActionKind.PRINT:
                layer = int(document.contours.layer[actions.contour[action]])
                found.append((k, layer, way))
                way = 0.0
            else:
                way += float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    return [(k, layer, pytest.approx(way)) for k, layer, way in found if way > 0.0]


@pytest.mark.parametrize("name", ["tower_plan", "two_head_plan"])
def test_each_travel_leads_to_the_layer_of_the_next_contour(make, name):
    """Their lengths add up to what is moved, but for the way to the park at the end."""
    document = getattr(make, name)()
    travels, (layers, _) = travels_of(document), layers_of(document)
    rows = zip(travels.head, layers[travels.layer], travels.length_mm, strict=True)
    assert [(int(h), int(n), float(x)) for h, n, x in rows] == naive(document)
    total = by_layer(travels, len(layers))
    assert float(total.sum()) == pytest.approx(float(travels.length_mm.sum()))


def test_a_plan_has_no_travel_that_is_not_its_own(make):
    """Nothing is lit up where nothing changed; a travel the other way round is the same."""
    document = make.tower_plan()
    own = travels_of(document)
    assert not in_no_place_of(own.ends, own.ends).any()
    turned = replace(own, ends=own.ends[:, ::-1])
    assert in_no_place_of(turned.ends, own.ends).any()  # unsorted ends are other places
    (actions,) = document.plan.heads
    moved = actions.path.copy()
    start = int(actions.path_offsets[np.flatnonzero(actions.kind == ActionKind.PRINT)[1]])
    moved[start] += [0.5, 0.0, 0.0]
    other = replace(document, plan=JointPlan((replace(actions, path=moved),)))
    assert in_no_place_of(travels_of(other).ends, own.ends).tolist().count(True) == 1
    assert in_no_place_of(own.ends, travels_of(other).ends).tolist().count(True) == 1


def test_the_layer_shown_is_where_travel_changed_most():
    """A plan that saves is shown by what it saves, one that travels more by what it adds."""
    before = np.array([5.0, 9.0, 2.0])
    assert most_changed(before, np.array([4.0, 1.0, 8.0])) == 1
    assert most_changed(before, np.array([4.0, 1.0, 80.0])) == 2
    assert most_changed(before, before) == 0


def test_a_head_that_prints_nothing_has_no_travels(make):
    """It is there, parked, all the same."""
    document = make.two_head_plan(meet=False)
    idle = make.from_rows("right", make.to_rows(document.plan.heads[1])[:1])
    if ActionKind.PRINT in idle.kind:
        idle = make.from_rows("right", [])
    plan = JointPlan((document.plan.heads[0], idle))
    assert set(travels_of(replace(document, plan=plan)).head.tolist()) == {0}
