"""The print in three dimensions as people use it: turned, clicked, cut, played."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from decmcts import Result
from decmcts.print.plan import ActionKind
from sim.pictures.report.data import OTHER, OVER_WALL, flags_of
from tests.conftest import opened

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def kept(browser: Browser, one_head: tuple[Result, Path]) -> Iterator[Page]:
    """The page of four nuts, opened once."""
    with opened(browser, one_head[1]) as page:
        page.evaluate("D.view.ready")
        yield page


@pytest.fixture
def view(kept: Page) -> Page:
    """The same page: the whole plan from above, nothing selected, the canvas in focus."""
    kept.evaluate(
        """() => D.state.set({ selected: null, playing: false, plans: "after", colour: "role",
        changed: false, travels: false, layers: [0, Math.max(...D.page.contours.layer)],
        time: Math.max(...D.page.plans.map(p => p.end_s)) })"""
    )
    kept.locator("#view-canvas").scroll_into_view_if_needed()
    kept.click("#view-to-top")
    kept.click("#view-fit")
    kept.focus("#view-canvas")
    return kept


def state(page: Page) -> dict[str, Any]:
    found: dict[str, Any] = page.evaluate("D.state.get()")
    return found


def drawn(page: Page) -> int:
    """Lines in the whole still picture."""
    page.evaluate("D.view.settled()")
    return int(page.evaluate("D.view.stats().drawn"))


def test_a_click_selects_the_bead_under_it(view: Page, one_head: tuple[Result, Path]) -> None:
    """Its role, line, time and head are those of plan.json."""
    contours = one_head[0].document.contours
    actions = one_head[0].document.plan.heads[0]
    box = view.locator("#view-canvas").bounding_box()
    assert box is not None
    top = contours.layer == contours.layer.max()
    longest = np.flatnonzero(top)[np.argsort(np.diff(contours.offsets)[top])[-4:]]
    for contour in longest.tolist():
        layer = int(contours.layer[contour])
        view.evaluate("([k]) => D.state.set({layers: [k, k], selected: null})", [layer])
        line = contours.polyline(contour)
        x, y, _ = view.evaluate("p => D.view.where(p)", line[:2].mean(axis=0).tolist())
        view.mouse.click(box["x"] + box["width"] / 2 + x, box["y"] + box["height"] / 2 + y)
        found = state(view)["selected"]
        assert found is not None
        got = int(actions.contour[found["action"]])
        text = view.inner_text("#selected")
        assert f"Bead {got}" in text and f"{contours.line[got]} of the source" in text
        assert view.evaluate("D.format.clock", float(actions.begin_s[found["action"]])) in text
        near = np.abs(contours.polyline(got) - line[:2].mean(axis=0))[:, :2]
        assert near.max(axis=1).min() < 8.0  # another bead may lie over it, none far away


def test_layers_and_time_cut_the_print(view: Page) -> None:
    """By the sliders; what is printed later is not there yet."""
    whole = drawn(view)
    for slider, key in (("#view-layer-to", "layers"), ("#view-time", "time")):
        was = state(view)[key]
        view.focus(slider)
        for _ in range(3):
            view.press(slider, "PageDown")
        assert state(view)[key] != was
    assert 0 < drawn(view) < whole


def test_what_changed_is_counted(view: Page, one_head: tuple[Result, Path]) -> None:
    """Travels gone and new, by the flags of the plans; of a dense print one layer at first."""
    view.click("#view-changed")
    assert state(view)["layers"][0] == state(view)["layers"][1]
    assert state(view)["plans"] == "both"
    view.evaluate("D.state.set({layers: [0, Math.max(...D.page.contours.layer)]})")
    planned = one_head[0].planned
    legend = view.inner_text("#view-legend")
    for document, flags in zip(
        (planned.before, planned.after), flags_of(planned.before, planned.after), strict=True
    ):
        actions = document.plan.heads[0]
        travels = (actions.kind != ActionKind.PRINT) & (flags[0] & OTHER > 0)
        travels[np.flatnonzero(actions.kind == ActionKind.PRINT)[-1] :] = False  # to the park
        over = travels & (flags[0] & OVER_WALL > 0)
        for count in (int((travels & ~over).sum()), int(over.sum())):
            assert count == 0 or f"{count:,}" in legend
    view.click("#view-changed")
    assert not state(view)["changed"]


@pytest.mark.parametrize(
    "mode", ["role", "head", "tool", "layer", "time", "speed", "change", "cluster"]
)
def test_every_colour_has_a_legend(view: Page, mode: str) -> None:
    """Names or a scale; an entry dims what it names."""
    view.select_option("#view-colour", mode)
    assert state(view)["colour"] == mode
    assert view.inner_text("#view-legend").strip()
    entries = view.locator("#view-legend button")
    if entries.count():
        was = entries.first.get_attribute("aria-pressed")
        entries.first.click()
        assert view.locator("#view-legend button").first.get_attribute("aria-pressed") != was
        view.locator("#view-legend button").first.click()


def test_what_is_selected_has_a_legend(view: Page) -> None:
    """Colours of what had to come first, and of what waits for it; one bead is no beads."""
    view.evaluate("D.selected.go({plan: 1, head: 0, action: D.page.plans[1].heads[0].n >> 1})")
    if view.evaluate("D.page.plans[1].heads[0].kind[D.state.get().selected.action]") != 0:
        view.press("#view-canvas", "n")
    near = view.evaluate(
        "[...document.querySelectorAll('#selected h3')].slice(1).map(each => each.innerText)"
    )
    legend = view.inner_text("#view-legend")
    for heading, name in zip(near, ("had to come first", "waits for it"), strict=True):
        count = int(heading.rsplit("(")[1].rstrip(")"))
        assert (name in legend) == (count > 0)
        assert count < 2 or f"{name}: {count} beads" in legend
    assert "selected" in legend and "1 beads" not in legend
    view.press("#view-canvas", "Escape")
    assert "selected" not in view.inner_text("#view-legend")


def test_a_picture_is_whole_after_it_moved(view: Page) -> None:
    """A moving view learns how much it can draw at a time: whole lines, else all is drawn wrong."""
    budget = view.evaluate(
        """() => { const painter = { coarse: true, budget: 20001 };
        for (const ms of [71.3, 40.1]) D.painter.Painter.prototype.learn.call(painter, ms);
        return painter.budget; }"""
    )
    assert budget == int(budget) and budget != 20001


def test_the_clock_says_whose_time_it_shows(view: Page, one_head: tuple[Result, Path]) -> None:
    """The first screen has estimates of whole files; the view plays the plan."""
    planned = one_head[0].planned
    note = view.inner_text("#view-clock")
    for document in (planned.before, planned.after):
        assert view.evaluate("D.format.clock", document.plan.makespan_s) in note


def test_keys_turn_zoom_and_step(view: Page) -> None:
    """Whoever has no mouse sees the same."""

    def camera() -> Any:
        return view.evaluate("JSON.stringify(D.view.camera())")

    for key in ("f", "ArrowLeft", "Shift+ArrowUp", "+", "r", "i", "-", "t"):
        was = camera()
        view.press("#view-canvas", key)
        assert camera() != was, key
    view.press("#view-canvas", "n")
    first = state(view)["selected"]
    view.press("#view-canvas", "n")
    second = state(view)["selected"]
    assert first is not None and second["action"] == first["action"] + 1
    view.press("#view-canvas", "p")
    assert state(view)["selected"] == first
    view.press("#view-canvas", "Escape")
    assert state(view)["selected"] is None
    view.press("#view-canvas", "v")
    assert state(view)["travels"]
    view.press("#view-canvas", "PageDown")
    assert state(view)["layers"][1] < view.evaluate("Math.max(...D.page.contours.layer)")
    view.press("#view-canvas", "b")
    assert state(view)["plans"] == "both"


def test_the_mouse_turns_and_zooms(view: Page) -> None:
    """A drag is no click."""
    box = view.locator("#view-canvas").bounding_box()
    assert box is not None
    was = view.evaluate("JSON.stringify(D.view.camera())")
    view.mouse.move(box["x"] + 300, box["y"] + 200)
    view.mouse.down()
    view.mouse.move(box["x"] + 360, box["y"] + 240, steps=3)
    view.mouse.up()
    turned = view.evaluate("JSON.stringify(D.view.camera())")
    assert turned != was and state(view)["selected"] is None
    view.mouse.wheel(0, -200)
    view.wait_for_function("was => JSON.stringify(D.view.camera()) !== was", arg=turned)


def test_heads_and_the_space_they_need_are_drawn(view: Page, one_head: tuple[Result, Path]) -> None:
    """A frame round what the head's slices pass over in what it does."""
    actions = one_head[0].document.plan.heads[0]
    middle = len(actions) // 2
    view.evaluate("t => D.state.set({time: t})", float(actions.begin_s[middle : middle + 2].mean()))
    assert drawn(view) > 0
    frame = np.array(
        view.evaluate(f"D.bodies.reservedBy(D.page, D.page.plans[1].heads[0], {middle})")
    )
    slices = one_head[0].document.machine.heads[0].slices
    corners = np.concatenate([np.concatenate(piece.polygons) for piece in slices])
    path = actions.action_path(middle)
    assert frame[:, :2].min(axis=0) == pytest.approx(
        path.min(axis=0)[:2] + corners.min(axis=0), abs=0.05
    )
    assert frame[:, :2].max(axis=0) == pytest.approx(
        path.max(axis=0)[:2] + corners.max(axis=0), abs=0.05
    )


def test_it_plays_to_the_end(view: Page) -> None:
    """From the begin, as fast as was chosen; and stops there."""
    view.select_option("#view-speed", "3000")
    view.click("#view-play")
    view.wait_for_function("() => { const s = D.state.get(); return !s.playing && s.time > 0; }")
    end = view.evaluate("Math.max(...D.page.plans.map(p => p.end_s))")
    assert state(view)["time"] == pytest.approx(end)
    view.select_option("#view-speed", index=0)  # however slow the clicks are, it is not at the end
    view.click("#view-play")
    view.click("#view-play")
    assert not state(view)["playing"] and state(view)["time"] < end
