"""Pictures show every plan there can be, and thin only what is too much to see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread

from decmcts.print.plan import ActionKind, JointPlan
from sim.pictures import drawings as pictures
from sim.pictures.activity import EXACT, activity
from sim.pictures.drawings import action_segments, draw_gantt, draw_plan
from sim.pictures.machine_picture import draw_machine
from sim.pictures.round_beads import round_beads_of, with_outlines

RED = np.array([214, 39, 40]) / 255


def has_colour(path, colour, tolerance=0.12):
    pixels = imread(path)[:, :, :3]
    return bool((np.abs(pixels - colour).max(axis=2) < tolerance).any())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tower_plan", "two_head_plan"])
def test_a_plan_is_drawn_with_travel_in_red(make, name, tmp_path):
    """The picture every result comes with; travel must be seen."""
    document = getattr(make, name)()
    draw_plan(tmp_path / "p.png", document, document)
    assert has_colour(tmp_path / "p.png", RED, 0.35)


@pytest.mark.slow
def test_gantt(make, tmp_path):
    """The chart of a two-head plan."""
    draw_gantt(tmp_path / "g.png", make.two_head_plan())
    assert has_colour(tmp_path / "g.png", RED)


@pytest.mark.slow
def test_machines_with_and_without_bodies(make, tmp_path):
    """`decmcts machines --draw` draws whatever a machine file may hold."""
    for machine in (make.one_head_machine(), make.two_head_machine()):
        draw_machine(machine, tmp_path / "m.png")
        assert has_colour(tmp_path / "m.png", RED)
    head = replace(make.one_head_machine().heads[0], slices=())
    draw_machine(replace(make.one_head_machine(), heads=(head,)), tmp_path / "m.png")


def test_segments_of_actions(make):
    """Every printed millimetre and no other is in the grey lines."""
    document = make.tower_plan()
    actions = document.plan.heads[0]
    printed = action_segments(actions, printing=True)
    assert len(printed) == 4 * len(document.contours)
    assert np.abs(np.diff(printed, axis=1)).sum() == pytest.approx(16.0 * len(document.contours))
    assert len(action_segments(actions, printing=False)) == 3 * (len(actions) // 2 + 1)


def test_thinning_leaves_out_whole_paths(make):
    """Half a contour would look like a gap in the print."""
    actions = make.tower_plan(layers=20).plan.heads[0]
    some = action_segments(actions, printing=True, most=40)
    assert 0 < len(some) <= 44
    assert len(some) % 4 == 0


def test_shares_add_up_to_the_time_spent(make):
    """Many actions are drawn as shares of intervals; no second may get lost."""
    for layers in (4, EXACT):
        actions = make.tower_plan(layers=layers).plan.heads[0]
        edges, shares = activity(actions, float(actions.end_s[-1]) + 10.0)
        spent = (shares * np.diff(edges)[:, None]).sum(axis=0)
        printing = actions.kind == 0
        length = actions.end_s - actions.begin_s
        np.testing.assert_allclose(spent, [length[printing].sum(), length[~printing].sum()])
        assert len(shares) <= max(2 * EXACT, 801)


def test_an_idle_head_is_drawn_idle(make, tmp_path):
    """A head that prints nothing still has its row."""
    document = make.two_head_plan(meet=False)
    idle = make.from_rows("right", make.to_rows(document.plan.heads[1])[:1])
    plan = JointPlan((document.plan.heads[0], idle))
    edges, shares = activity(idle, plan.makespan_s)
    assert shares.shape == (len(edges) - 1, 2)
    assert pictures.head_colour(0, 1) != pictures.head_colour(0, 2)


def with_round(make):
    """A plan whose first contours are a dot and a vertical bead."""
    document = make.tower_plan()
    (actions,) = document.plan.heads
    path, contours = actions.path.copy(), document.contours
    prints = np.flatnonzero(actions.kind == ActionKind.PRINT)[:2]
    for k, rise in zip(prints.tolist(), (0.0, 3.0), strict=True):
        a, b = actions.path_offsets[k : k + 2]
        path[a:b] = path[a]
        path[b - 1, 2] += rise
    return replace(document, plan=JointPlan((replace(actions, path=path),))), prints, contours


def test_dots_and_vertical_beads_have_their_width(make):
    """Their paths are points seen from above: nothing of them was drawn."""
    document, prints, contours = with_round(make)
    (actions,) = document.plan.heads
    beads = round_beads_of(actions, contours)
    assert beads.action.tolist() == prints.tolist()
    assert beads.is_dot.tolist() == [True, False]
    assert (beads.high - beads.low).tolist() == pytest.approx([0.0, 3.0])
    outlined = with_outlines(actions, contours)
    for k in range(len(actions)):
        path, now = actions.action_path(k), outlined.action_path(k)
        if k not in prints:
            assert (path == now).all()
            continue
        wide = contours.width[actions.contour[k]]
        assert np.ptp(now, axis=0)[:2] == pytest.approx(wide)
        assert (now[:, 2].min(), now[:, 2].max()) == (path[:, 2].min(), path[:, 2].max())


@pytest.mark.slow
def test_dots_and_vertical_beads_are_drawn(make, tmp_path):
    """From above, as discs and rings, and from the side; the legend names them."""
    document, _, _ = with_round(make)
    contours = replace(document.contours, width=np.full(len(document.contours), 3.0))
    plain, wide = tmp_path / "plain.png", tmp_path / "wide.png"
    draw_plan(plain, document, document)
    draw_plan(wide, document, replace(document, contours=contours))
    grey = [(np.abs(imread(p)[:, :, :3] - 0.56).max(axis=2) < 0.15).sum() for p in (plain, wide)]
    assert grey[1] > grey[0] + 500
