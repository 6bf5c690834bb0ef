"""The page as people use it: opened, clicked and typed in real browsers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, ElementHandle, Page

from decmcts import Result
from decmcts.print.plan import ActionKind, JointPlan, PlanDocument
from sim.pictures.report import ReportDetails, write_report
from tests.conftest import opened

pytestmark = pytest.mark.slow
HARD = ("critical", "serious")  # of axe's findings


@pytest.fixture
def two_heads(make: SimpleNamespace, tmp_path: Path) -> Path:
    """The report of a plan in which the right head waits for the left one."""
    document = make.timed(make.two_head_plan())
    contours, left = document.contours, document.machine.heads[0]
    paths = [contours.polyline(c) for c in range(len(contours))]
    visits = [(c, False) for c in np.argsort(contours.layer, kind="stable").tolist()]
    alone = make.head_actions(left, visits, paths, 0, clearance_z=1.0)
    before = replace(
        document, machine=replace(document.machine, heads=(left,), rails=()),
        plan=JointPlan((alone,)),
    )  # fmt: skip
    metrics: Any = {"one_head_s": 90.0, "bound": {"bound_s": 20.0}}
    write_report(
        tmp_path / "two.html", before=make.timed(before), after=replace(document, metrics=metrics),
        history=[(0.0, 60.0), (2.0, 50.0)], details=ReportDetails("two.gcode"),
    )  # fmt: skip
    return tmp_path / "two.html"


def test_the_first_screen_has_the_plan_s_figures(
    browser: Browser, one_head: tuple[Result, Path]
) -> None:
    """What people read is what plan.json has."""
    result, path = one_head
    was, now = result.planned.before.metrics, result.planned.after.metrics
    with opened(browser, path) as page:
        text = page.inner_text("#facts")
        for metrics in (was, now):
            clock = page.evaluate("D.format.clock", metrics["file_time_s"])
            shown = page.evaluate("D.format.duration", metrics["file_time_s"])
            assert clock in text or shown in text
            assert f"{metrics['retractions']:,}" in text
            travel = metrics["emitted_travel_mm"]
            forms = [page.evaluate(f"D.format.{form}", travel) for form in ("mm", "number")]
            assert any(form in text for form in forms)
        (head,) = result.document.plan.heads
        lasts = head.end_s - head.begin_s
        share = float(lasts[head.kind == ActionKind.PRINT].sum() / head.end_s[-1])
        assert f"The head prints {100 * share:.1f} %, travels" in text
        assert "four_nuts" in page.inner_text("#head")
        assert result.document.machine.name in text


def test_the_page_has_the_paths_of_the_plan(
    browser: Browser, one_head: tuple[Result, Path]
) -> None:
    """Every point of every action, put together from contours and the rest."""
    result, path = one_head
    with opened(browser, path) as page:
        for which, document in enumerate((result.planned.before, result.planned.after)):
            (actions,) = document.plan.heads
            told = page.evaluate(
                """which => { const head = D.page.plans[which].heads[0];
                const paths = Array.from(head.kind, (_, k) => D.path(D.page, head, k));
                return JSON.stringify([paths.map(p => p.x.length),
                  ...["x", "y", "z"].map(axis => paths.flatMap(p => Array.from(p[axis])))]); }""",
                which,
            )
            sizes, *drawn = json.loads(told)
            assert sizes == np.diff(actions.path_offsets).tolist()
            assert np.abs(np.array(drawn).T - actions.path).max() < 0.02


@pytest.mark.parametrize("dark", [False, True])
def test_people_with_poor_eyes_and_screen_readers_can_use_it(
    browser: Browser, two_heads: Path, dark: bool
) -> None:
    """Contrast, names and roles, by axe, in light and in dark."""
    with opened(browser, two_heads) as page:
        if dark:
            page.evaluate(
                "document.documentElement.dataset.theme = 'dark'; D.state.set({theme: 'dark'})"
            )
        found = Axe().run(page).response["violations"]
        assert [
            (f["id"], [n["html"] for n in f["nodes"]]) for f in found if f["impact"] in HARD
        ] == []


def test_the_theme_changes(browser: Browser, two_heads: Path) -> None:
    """By its button, and everything is drawn anew without an error."""
    with opened(browser, two_heads) as page:
        was = page.evaluate("D.state.get().theme")
        page.click("#theme")
        assert page.evaluate("D.state.get().theme") != was
        assert page.evaluate("document.documentElement.dataset.theme") != was


@pytest.mark.parametrize("width", [360, 900, 1200, 1400])
def test_nothing_sticks_out_of_its_card(
    browser: Browser, one_head: tuple[Result, Path], width: int
) -> None:
    """Figures that are cut off are the ones people look for."""
    with opened(browser, one_head[1], viewport={"width": width, "height": 800}) as page:
        out = page.evaluate(
            """() => [...document.querySelectorAll(".card, .panel")].flatMap(card =>
            [...card.querySelectorAll("td, th, p, li, canvas, button, table")].filter(each =>
              each.getClientRects().length &&
              each.getBoundingClientRect().right > card.getBoundingClientRect().right + 1)
            .map(each => each.outerHTML.slice(0, 80)))"""
        )
        assert out == []


def test_it_fits_a_telephone(browser: Browser, cooling: tuple[PlanDocument, Path]) -> None:
    """Nothing sticks out sideways at 360 pixels, however long names are."""
    long = {"left": "left-" * 12, "right": "right_" * 12}
    document, _ = cooling
    machine = document.machine
    heads = tuple(replace(head, name=long[head.name]) for head in machine.heads)
    actions = tuple(replace(head, head=long[head.head]) for head in document.plan.heads)
    named = replace(document, machine=replace(machine, heads=heads, rails=()),
                    plan=JointPlan(actions))  # fmt: skip
    path = cooling[1].with_name("long.html")
    notes = ["nothing moves across line 12: A_MACRO_" + "OF_MANY_WORDS_" * 6]
    write_report(
        path, before=named, after=named, details=ReportDetails("long_" * 12 + ".gcode", notes=notes)
    )
    with opened(browser, path, viewport={"width": 360, "height": 740}) as page:
        page.evaluate("D.gantt.goto(D.gantt.longest()[0])")
        assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_a_wait_says_for_whom(browser: Browser, two_heads: Path) -> None:
    """The right head waits for the left one to park; a click goes there."""
    with opened(browser, two_heads) as page:
        text = page.inner_text("#heads")
        assert "left" in text and "right" in text
        (wait,) = [w for w in page.evaluate("D.page.waits") if w["other_head"] is not None]
        assert wait["head"] == 1 and wait["other_head"] == 0


CONTROLS = "button:visible, select:visible, input:visible, summary:visible, [tabindex='0']:visible"
MAY_REST = ("Now: show the current time",)  # it is in sight already
STILL = """() => {
  const small = Object.assign(document.createElement("canvas"), {width: 200, height: 40});
  const drawn = small.getContext("2d", {willReadFrequently: true});
  const canvases = document.querySelectorAll("#heads canvas, #search canvas");
  const pictures = [...canvases].map(canvas => {
    drawn.clearRect(0, 0, 200, 40);
    drawn.drawImage(canvas, 0, 0, 200, 40);
    return drawn.getImageData(0, 0, 200, 40).data.join();
  });
  const shown = JSON.stringify([D.state.get(), scrollY, D.view.stats().frames, pictures])
    + document.body.innerHTML;
  let hash = 0;
  for (let i = 0; i < shown.length; i++) hash = (31 * hash + shown.charCodeAt(i)) | 0;
  return hash;
}"""


@pytest.mark.long
def test_every_control_does_something(browser: Browser, two_heads: Path) -> None:
    """Each is reached by the keyboard, has a name, changes what is shown, and nothing fails."""
    with opened(browser, two_heads) as page:
        page.evaluate("D.view.ready")
        for name in ("zoom in", "zoom in"):  # so that all others have something to do
            page.get_by_role("button", name=name).click()
        page.evaluate("D.state.set({time: 0.5 * D.page.plans[1].end_s})")
        controls = page.locator(CONTROLS).element_handles()
        assert len(controls) > 20
        idle = []
        for control in controls:
            if not control.is_visible() or not control.is_enabled():
                continue
            control.scroll_into_view_if_needed()
            control.focus()
            assert control.evaluate("c => c === document.activeElement")
            name = control.evaluate(
                "c => c.ariaLabel || c.textContent || c.labels?.[0]?.textContent"
            )
            assert name and name.strip()
            was = page.evaluate(STILL)
            used(page, control)
            page.wait_for_timeout(60)
            if page.evaluate(STILL) == was and control.get_attribute("aria-pressed") != "true":
                idle += [name.strip()] if name.strip() not in MAY_REST else []
        page.evaluate("D.state.set({playing: false})")
        assert idle == [], "; ".join(idle)


def used(page: Page, control: ElementHandle) -> None:
    """Use a control by keys: what it is says which."""
    kind = control.evaluate("c => c.tagName + (c.type || '')")
    if kind.startswith("SELECT"):
        options = control.evaluate("c => [...c.options].map(o => o.value)")
        chosen = control.evaluate("c => c.value")
        control.select_option(next(o for o in options if o != chosen))
    elif kind == "INPUTrange":
        low = control.evaluate("c => c.value === c.min")
        control.press("ArrowRight" if low else "ArrowLeft")
    elif kind.startswith("INPUT"):
        control.fill("1")
        control.press("Enter")
    elif kind.startswith(("BUTTON", "SUMMARY")):
        control.press("Enter")
    else:
        control.press("ArrowRight")
