"""The first screen, the charts and the graph: their numbers are the plan's."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from decmcts import Result
from decmcts.print.plan import PlanDocument
from sim.pictures.report.data import travel_lengths
from tests.conftest import opened

pytestmark = pytest.mark.slow


def test_the_parts_of_a_head_s_time_fill_it(page: Page, cooling: tuple[PlanDocument, Path]) -> None:
    """A part is never longer than the whole, and none is missing."""
    document, _ = cooling
    end = document.plan.makespan_s
    for actions, text in zip(
        document.plan.heads, page.locator("#facts .used li").all_inner_texts(), strict=True
    ):
        shares = [float(n) for n in re.findall(r"([\d.]+) %", text)]
        assert sum(shares) == pytest.approx(100.0, abs=1.1)
        printing = float((actions.end_s - actions.begin_s)[actions.kind == 0].sum())
        assert shares[0] == pytest.approx(100.0 * printing / end, abs=0.6)
    text = page.inner_text("#facts")
    assert f"{200.0 / end:.2f} times as fast" in text
    assert page.evaluate("D.format.duration", 57.0) in text  # the bound
    assert f"at most {round(100 * (1 - 57.0 / end))} % is left" in text


def test_the_verdict_says_what_was_checked_and_how_near_it_came(page: Page) -> None:
    """In the words of `verify -v`: the nearest at once, all else if asked."""
    card = page.locator("#facts .card").first
    assert card.inner_text().split("\n")[0].endswith("Proven safe")
    assert "nearest: heads left and right: 12.39 mm (5 mm required)" in card.inner_text()
    card.locator("summary").click()
    checked = card.locator(".checked li")
    checked.first.wait_for()
    where = "heads left and right: left prints beside right rests"
    assert checked.all_inner_texts() == [where, "a rule"]
    assert "third was lost" in page.inner_text("#facts .warned")


def test_a_kept_source_says_why(page: Page) -> None:
    """On the first screen, where one looks for the saving that is not there."""
    told = page.evaluate(
        """() => { const section = document.getElementById("facts"), was = [...section.children];
        D.facts.show({ ...D.page, facts: { ...D.page.facts, kept_source: "nothing to gain",
          time: { before_s: 51.4, after_s: 50.8, of: "plan" } } });
        const text = section.innerText;
        section.replaceChildren(...was);
        return text; }"""
    )
    assert "The source is kept as it is: nothing to gain." in told
    assert "0.6 s saved" in told  # though both are shown as 51 s


def test_charts_hold_the_plan_s_travel(browser: Browser, one_head: tuple[Result, Path]) -> None:
    """By layer and by length, before and after; in the tables behind them too."""
    result, path = one_head
    documents = (result.planned.before, result.planned.after)
    with opened(browser, path) as page:
        page.wait_for_function("D.charts.kept.every((each) => each.plot)")
        layers, lengths = page.evaluate(
            "D.charts.kept.slice(0, 2).map((each) => each.plot.data.map((row) => [...row]))"
        )
        n = int(documents[0].contours.layer.max()) + 1
        assert len(layers[0]) == n <= 120
        for which, document in enumerate(documents):
            mm = travel_lengths(document.plan.heads[0])
            assert sum(lengths[1 + which]) == pytest.approx(mm.sum(), rel=1e-3)
            home = mm[-1]
            assert sum(layers[1 + which]) == pytest.approx(mm.sum() - home, rel=1e-3)
        folded = page.locator("#search figure details")
        folded.nth(1).locator("summary").click()
        folded.nth(1).locator("tbody td").first.wait_for()
        cells = folded.nth(1).locator("tbody td").all_inner_texts()
        assert page.evaluate("D.format.number", lengths[2][-1]) == cells[-1]
        page.set_viewport_size({"width": 360, "height": 740})
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        page.evaluate("window.was = D.charts.kept.map((each) => each.plot)")
        page.click("#theme")
        assert page.evaluate("D.charts.kept.every((each, k) => each.plot !== was[k])")


def test_the_saving_by_layer_is_called_even_only_where_it_is(page: Page) -> None:
    """Where a tenth of the layers saves a quarter it is theirs, not that of all."""
    said = """(rows) => { const [was, now] = rows;
        const show = { ...D.page, graph: null, history: { s: [] }, saving: { ...D.page.saving,
          by_layer: { layer: was.map((_, k) => k), before: was, after: now } } };
        const section = document.getElementById("search"), kept = [...section.children];
        D.charts.show(show);
        const shown = [...section.querySelectorAll(".figures")].at(-1);
        const text = shown.querySelector("figcaption p").textContent;
        section.replaceChildren(...kept);
        D.charts.kept.splice(-2);
        return text; }"""
    even = [[100.0] * 40, [90.0] * 36 + [85.0] * 4]
    assert "spread over all layers: the 4 that save most have 60 mm" in page.evaluate(said, even)
    some = [[100.0] * 40, [90.0] * 36 + [70.0] * 4]
    assert "120 mm of it in layers 37–40" in page.evaluate(said, some)
    worse = [[100.0] * 40, [110.0] * 20 + [85.0] * 20]
    assert "60 mm of it in layers" in page.evaluate(said, worse)


def test_the_bound_is_drawn_below_the_search(
    page: Page, cooling: tuple[PlanDocument, Path]
) -> None:
    """A dashed line at its height, in a colour of its own; the curve ends at the best cost."""
    page.wait_for_function("D.charts.kept.every((each) => each.plot)")
    share = page.evaluate(
        """() => { const u = D.charts.kept.map((each) => each.plot).find((p) =>
          p.axes[1].label.includes('whole print'));
        const y = Math.round(u.valToPos(57, 'y', true)), { left, width } = u.bbox;
        const { data } = u.ctx.getImageData(left, y, width, 13), below = 12 * 4 * width;
        let n = 0;
        for (let i = 0; i < 4 * width; i += 4) n += data[i + 3] > 100 && !data[below + i + 3];
        return [n / width, u.data[1].at(-1)]; }"""
    )
    assert 0.4 < share[0] < 0.8 and share[1] == 130.0
    assert "found by right" in page.inner_text("#heads")
    entropy = page.evaluate(
        """D.charts.kept.map((each) => [each.plot.axes[1].label, each.plot.data])
        .find(([label]) => label.startsWith('entropy'))[1]"""
    )
    assert entropy == [[0.1, 0.5], [1.0, 0.4], [1.0, 0.0]]


def test_the_graph_shows_what_comes_first(page: Page, cooling: tuple[PlanDocument, Path]) -> None:
    """Line 2 lies on line 0: a rule from another layer, shown if asked."""
    page.click("#search summary:has-text('The graph')")
    graph = page.locator("#search details[open]").last
    graph.locator("canvas:not([aria-hidden])").wait_for()
    graph.locator("input[type=number]").fill(str(int(cooling[0].contours.layer[2]) + 1))
    told = graph.locator("p[aria-live]")
    assert "0 rules; 1 bead waits for none" in told.inner_text()
    graph.locator("input[type=checkbox]").check()
    assert "1 bead, 1 rule; 0 beads wait for none" in told.inner_text()
    graph.locator("summary:has-text('These rules')").click()
    graph.locator("tbody td").first.wait_for()
    cells = graph.locator("tbody td").all_inner_texts()
    assert cells[:2] == ["bead 0", "bead 2"] and cells[2].startswith("geometry")
