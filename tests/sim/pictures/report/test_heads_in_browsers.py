"""The heads over time as people use them: pointed at, clicked, zoomed, moved by keys."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from decmcts.print.plan import PlanDocument
from sim.pictures.report import write_report
from sim.pictures.report.waits import waits_of
from tests.conftest import opened

pytestmark = pytest.mark.slow


def span(page: Page) -> list[float]:
    shown: list[float] = page.evaluate("[D.gantt.view.from, D.gantt.view.to]")
    return shown


def chart_of(page: Page) -> Any:
    chart = page.locator("#heads canvas[tabindex]")
    chart.scroll_into_view_if_needed()
    return chart


def test_every_moment_is_what_the_plan_says(page: Page, cooling: tuple[PlanDocument, Path]) -> None:
    """Actions, and the waits between them; any span is filled to its last second."""
    document, _ = cooling
    for head, actions in enumerate(document.plan.heads):
        middles = ((actions.begin_s + actions.end_s) / 2).tolist()
        found = page.evaluate("([h, ts]) => ts.map((t) => D.gantt.at(h, t))", [head, middles])
        assert [f["action"] for f in found] == list(range(len(actions)))
        assert [f["contour"] for f in found] == actions.contour.tolist()
        assert [f["end_s"] for f in found] == pytest.approx(actions.end_s.tolist(), abs=0.01)
        edges = np.linspace(0.0, document.plan.makespan_s, 38).tolist()
        shares = page.evaluate(
            """([h, edges]) => edges.slice(1).map((to, k) => { const out = new Float64Array(5);
            D.gantt.rows()[h].shares(edges[k], to, out); return [...out]; })""",
            [head, edges],
        )
        assert np.sum(shares, axis=1) == pytest.approx(1.0, abs=0.01)
        lasts = actions.end_s - actions.begin_s
        printed = np.array(shares)[:, 0] @ np.diff(edges)
        assert printed == pytest.approx(lasts[actions.kind == 0].sum(), abs=0.05)
    for wait in waits_of(document, None):
        middle = (wait.begin_s + wait.end_s) / 2
        found = page.evaluate("([h, t]) => D.gantt.at(h, t)", [wait.head, middle])
        assert found["wait"]["begin_s"] == pytest.approx(wait.begin_s, abs=0.002)
        assert found["wait"]["cause"] == wait.cause


def test_waits_are_labelled_and_a_click_goes_there(
    page: Page, cooling: tuple[PlanDocument, Path]
) -> None:
    """The longest wait stands first; its button selects what it waited for."""
    document, _ = cooling
    waits = [w for w in waits_of(document, None) if w.cause in ("space", "cooling")]
    longest = max(waits, key=lambda w: w.end_s - w.begin_s)
    lasts = page.evaluate("D.format.duration", longest.end_s - longest.begin_s)
    labels = page.evaluate("D.gantt.labels()")
    (label,) = [one for one in labels if abs(one["begin_s"] - longest.begin_s) < 0.01]
    assert label["head"] == 1 and label["text"].startswith(f"waits {lasts} for left")
    page.click("#heads .waits button >> nth=0")
    state = page.evaluate("D.state.get()")
    assert state["time"] == pytest.approx(longest.begin_s, abs=0.002)
    chosen = {"plan": 1, "head": longest.other_head, "action": longest.other_action}
    assert state["selected"] == chosen
    low, high = span(page)
    assert low <= longest.begin_s and longest.end_s <= high
    assert lasts in page.inner_text("#gantt-now")
    page.locator(".nows >> text=right waits").wait_for()
    sums = page.inner_text("#heads .sums")
    assert page.evaluate("D.words.long", "cooling") in sums


def test_keys_move_the_chart(page: Page, cooling: tuple[PlanDocument, Path]) -> None:
    """All that a mouse can do."""
    document, _ = cooling
    end = document.plan.makespan_s
    chart_of(page).focus()
    for key, low, high in (("+", None, end / 2), ("+", None, end / 4), ("0", 0.0, end)):
        page.keyboard.press(key)
        first, last = span(page)
        assert last - first == pytest.approx(high if low is None else end, rel=1e-3)
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    here = page.evaluate("D.gantt.focus()")
    assert here["head"] == 0 and here["begin_s"] > 0.0
    page.keyboard.press("ArrowDown")
    assert page.evaluate("D.gantt.focus().head") == 1
    first, second = (w for w in waits_of(document, None) if w.cause != "end")
    page.evaluate("D.gantt.point(0, 0)")
    for key, wait in (("w", first), ("w", second), ("W", first)):
        page.keyboard.press(key)
        begin = page.evaluate("D.gantt.focus().begin_s")
        assert begin == pytest.approx(wait.begin_s, abs=0.01)
        assert "right waits" in page.inner_text("#gantt-now")
    page.keyboard.press("Enter")
    assert page.evaluate("D.state.get().selected.head") == 0
    page.keyboard.press("+")
    was = span(page)
    page.keyboard.press("PageDown")
    assert span(page)[0] > was[0]
    page.keyboard.press("End")
    assert span(page)[1] == pytest.approx(end, rel=1e-3)


def test_the_mouse_moves_the_chart(page: Page, cooling: tuple[PlanDocument, Path]) -> None:
    """The wheel scrolls the page until the chart was clicked; then it zooms, and a drag moves."""
    document, _ = cooling
    chart = chart_of(page)
    box = chart.bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 50
    page.mouse.move(x, y)
    whole = span(page)
    page.mouse.wheel(0, -1)
    assert span(page) == whole
    page.mouse.click(x, y)
    seconds = page.evaluate("D.state.get().time")
    chosen = page.evaluate("D.state.get().selected")
    actions = document.plan.heads[0]
    inside = np.flatnonzero((actions.begin_s <= seconds) & (seconds < actions.end_s))
    assert (chosen or {"action": None})["action"] in [*inside.tolist(), None]
    page.mouse.wheel(0, -240)
    page.wait_for_function("D.gantt.view.from > 0")
    was = span(page)
    page.mouse.down()
    page.mouse.move(x - 60, y, steps=3)
    page.mouse.up()
    assert span(page)[0] > was[0]
    for name in ("zoom in", "zoom out", "earlier", "later", "show the whole print"):
        page.click(f"#heads [aria-label='{name}']")
    assert span(page) == whole
    page.click("#heads button:has-text('Next wait')")
    assert "waits" in page.inner_text("#gantt-now")
    page.click("#heads [aria-label^='Now']")
    page.click("#heads [aria-label^='See it']")


def test_it_says_what_each_head_does_now(page: Page, cooling: tuple[PlanDocument, Path]) -> None:
    """At the time that the view shows too."""
    right = cooling[0].plan.heads[1]
    (wait,) = [w for w in waits_of(cooling[0], None) if w.cause == "cooling"]
    page.evaluate("(time) => D.state.set({ time })", (wait.begin_s + wait.end_s) / 2)
    page.locator(".nows >> text=right waits").wait_for()
    printing = int(np.flatnonzero(right.kind == 0)[0])
    page.evaluate("(time) => D.state.set({ time })", float(right.begin_s[printing]) + 0.5)
    page.locator(f".nows >> text=right prints bead {right.contour[printing]}").wait_for()
    page.evaluate("(time) => D.state.set({ time })", cooling[0].plan.makespan_s + 1.0)
    page.locator(".nows >> text=Done at").wait_for()


def count(page: Page, colour: str) -> int:
    """Pixels of a colour in the chart."""
    found: int = page.evaluate(
        """async (name) => { await new Promise(requestAnimationFrame);
        await new Promise(requestAnimationFrame);
        const canvas = document.querySelector('#heads .gantt canvas');
        const hex = D.colour(name).slice(1), n = parseInt(hex, 16);
        const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        let found = 0;
        for (let i = 0; i < data.length; i += 4)
          found += (data[i] << 16 | data[i + 1] << 8 | data[i + 2]) === n && data[i + 3] === 255;
        return found; }""",
        colour,
    )
    return found


def test_the_critical_path_is_drawn_if_asked(
    page: Page, cooling: tuple[PlanDocument, Path]
) -> None:
    """A strip in a colour of its own; each head's printing in that of the head; anew by theme."""
    chart_of(page)
    assert count(page, "--bad") > 200
    page.click("#heads button:has-text('Critical path')")
    assert count(page, "--bad") == 0
    for theme in ("dark", "light"):
        page.evaluate(
            """(theme) => { document.documentElement.dataset.theme = theme;
            D.state.set({ theme }); }""",
            theme,
        )
        assert min(count(page, "--head0"), count(page, "--head1")) > 200
    assert page.get_attribute("#heads button:has-text('Critical path')", "aria-pressed") == (
        "false"
    )


def test_one_head_that_never_waits_has_no_chart(
    browser: Browser, make: SimpleNamespace, tmp_path: Path
) -> None:
    """One bar of one colour tells nothing."""
    document = make.timed(make.tower_plan())
    write_report(tmp_path / "one.html", before=document, after=document)
    with opened(browser, tmp_path / "one.html") as page:
        assert page.locator("#heads").is_hidden()
