"""Pictures show every plan there can be, and thin only what is too much to see."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.image import imread

from decmcts.errors import InputError
from decmcts.print.plan import ActionKind, JointPlan
from sim.pictures import drawings as pictures
from sim.pictures.canvas import TRAVEL
from sim.pictures.charts import EXACT, activity, title_lines
from sim.pictures.drawings import draw_plan, sheet_of
from sim.pictures.layer_travels import in_no_place_of, layers_of, travels_of
from sim.pictures.layer_view import LayerView, changed_colour, draw_layer
from sim.pictures.machine_picture import draw_machine

RED = np.array([214, 39, 40]) / 255


def has_colour(path, colour, tolerance=0.12):
    pixels = imread(path)[:, :, :3]
    return bool((np.abs(pixels - colour).max(axis=2) < tolerance).any())


def reordered(document):
    """Return a plan whose first travel leads elsewhere; its ends are in no place of the other."""
    heads = list(document.plan.heads)
    path = heads[0].path.copy()
    first, last = np.flatnonzero(heads[0].kind == ActionKind.PRINT)[[0, -1]]
    for action in (first, last):
        a, b = heads[0].path_offsets[action : action + 2]
        path[a:b] += [0.4, 0.3, 0.0]
    heads[0] = replace(heads[0], path=path)
    return replace(document, plan=JointPlan(tuple(heads)))


def drawn(document, other, layer, *, gone):
    """Draw one layer; returns how many paths there are of each colour, and the axes."""
    axis = Figure().subplots()
    own, others = travels_of(document), travels_of(other)
    number = int(layers_of(document)[0][layer])
    view = LayerView(document, own, in_no_place_of(own.ends, others.ends), number, layer)
    draw_layer(axis, view, gone=gone, inch_a_mm=0.02)
    counts: dict[str, int] = {}
    for lines in axis.collections:
        if isinstance(lines, LineCollection) and len(lines.get_paths()):
            colour = to_hex(lines.get_color()[0])
            counts[colour] = counts.get(colour, 0) + len(lines.get_paths())
    return counts, axis


@pytest.mark.parametrize("name", ["tower_plan", "two_head_plan"])
def test_what_changed_is_lit_up_and_nothing_else(make, name):
    """Travels gone are red, new ones have the head's colour, and those of both are grey."""
    document = getattr(make, name)()
    other, heads = reordered(document), len(document.plan.heads)
    changed = changed_colour(0, heads, gone=False)
    assert {TRAVEL, changed} & drawn(document, document, 0, gone=True)[0].keys() == set()
    assert drawn(document, other, 0, gone=True)[0][TRAVEL] >= 1
    counts, _ = drawn(other, document, 0, gone=False)
    assert counts[changed] >= 1 and TRAVEL not in counts


def test_a_kept_source_is_said_to_be_one(make):
    """Equal figures stand once; that nothing was found is no change of 0 %."""
    metrics = {"file_time_s": 60.0, "emitted_travel_mm": 9.0}
    before = replace(make.tower_plan(), metrics=metrics)
    _, under = title_lines("a", before, replace(before, metrics={**metrics, "kept_source": True}))
    assert under.startswith("no better order was found, the source is kept; print time of the")
    assert "→" not in under and "0:01:00; travel 9 mm" in under


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tower_plan", "two_head_plan"])
def test_a_picture_says_what_it_shows(make, name, tmp_path):
    """File, machine, units, the layer and what colours mean, as text that can be searched."""
    document = getattr(make, name)()
    heads = len(document.plan.heads)
    draw_plan(tmp_path / "p.svg", document, document, name="cup<1>.gcode", layer=2)
    text = (tmp_path / "p.svg").read_text()
    ElementTree.fromstring(text)
    for said in (
        f"cup&lt;1&gt;.gcode on {document.machine.name}", "x, mm", "before: layer 2 of",
        "after: layer 2 of", "travel gone", "travel to each layer",
    ):  # fmt: skip
        assert said in text
    assert ("what each head does" in text) == ("who prints what" in text) == (heads > 1)
    again = tmp_path / "again.svg"
    draw_plan(again, document, document, name="cup<1>.gcode", layer=2)
    assert again.read_text() == text


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["png", "svg"])
def test_a_name_is_no_formula_and_no_command(make, tmp_path, ending):
    """Dollars, controls, bytes that are no text and letters the font has not: all are names."""
    document = make.tower_plan()
    path = tmp_path / f"p.{ending}"
    draw_plan(path, document, document, name="$\\frac{$ \x1b[2J \udc9b & \u4e2d.gcode")
    if ending == "svg":
        text = path.read_text()
        ElementTree.fromstring(text)
        assert "$\\frac{$ [2J &amp; \u4e2d.gcode on" in text


def test_a_layer_the_print_has_not_is_refused(make, tmp_path):
    """In one line that says which there are; nothing is written."""
    document = make.tower_plan(layers=3)
    for layer in (0, 4):
        with pytest.raises(InputError, match="layers 1 to 3"):
            draw_plan(tmp_path / "p.png", document, document, layer=layer)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("heads", [1, 2, 3, 16])
@pytest.mark.parametrize("size", [(200.0, 2.0), (2.0, 200.0), (60.0, 50.0)])
def test_nothing_on_a_sheet_overlaps_or_stands_outside(heads, size):
    """Long, deep and square prints, with any number of heads."""
    sheet = sheet_of(np.array([[0.0, 0.0, 0.0], [*size, 5.0]]), heads)
    places = [*sheet.views, sheet.chart]
    places += [sheet.side, sheet.times] if heads > 1 else []
    for k, (x, y, w, h) in enumerate(places):
        assert min(x, y, w, h) > 0.0 and x + w < 1.0 and y + h < 1.0
        for left, low, wide, high in places[k + 1 :]:
            assert x + w <= left or left + wide <= x or y + h <= low or low + high <= y
    view = sheet.extent[1] - sheet.extent[0]
    ratio = view[1] / view[0] * sheet.views[0][2] * sheet.size[0]
    assert ratio == pytest.approx(sheet.views[0][3] * sheet.size[1])  # one scale across and up


@pytest.mark.slow
def test_machines_with_and_without_bodies(make, tmp_path):
    """`decmcts machines --draw` draws whatever a machine file may hold."""
    for machine in (make.one_head_machine(), make.two_head_machine()):
        draw_machine(machine, tmp_path / "m.png")
        assert has_colour(tmp_path / "m.png", RED)
    head = replace(make.one_head_machine().heads[0], slices=())
    draw_machine(replace(make.one_head_machine(), heads=(head,)), tmp_path / "m.png")


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


def test_dots_and_vertical_beads_are_drawn(make):
    """Seen from above they are points, of which nothing is drawn; in their layer, and no other."""
    document, prints, contours = with_round(make)
    layers = contours.layer[document.plan.heads[0].contour[prints]].tolist()
    for row, number in enumerate(layers_of(document)[0].tolist()):
        _, axis = drawn(document, document, row, gone=False)
        paths = [path for part in axis.collections for path in part.get_paths()]
        sizes = [float(np.ptp(path.vertices, axis=0).max()) for path in paths]
        assert sum(0.0 < size < 0.01 for size in sizes) == layers.count(number)
