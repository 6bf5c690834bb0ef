"""The report under fingers: the print and the chart of heads are moved, zoomed and tapped."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from decmcts.print.plan import ActionKind, PlanDocument
from tests.conftest import opened

pytestmark = pytest.mark.slow

Point = tuple[float, float]


@pytest.fixture(scope="module")
def touched(browser: Browser, cooling: tuple[PlanDocument, Path]) -> Iterator[Page]:
    """The page of two heads on a screen that is touched.

    By Chromium's own events of fingers; Firefox takes none from a test, and makes the same
    pointer events of them.
    """
    if browser.browser_type.name != "chromium":
        pytest.skip("only Chromium takes touches from a test")
    size = {"width": 800, "height": 900}
    with opened(browser, cooling[1], has_touch=True, viewport=size) as page:
        page.evaluate("D.view.ready")
        yield page


def box_of(page: Page, name: str) -> dict[str, float]:
    """Where an element is, once it is in sight."""
    found = page.locator(name)
    found.evaluate("(each) => each.scrollIntoView({block: 'center'})")
    box = found.bounding_box()
    assert box is not None
    return dict(box)


def fingers(page: Page, *frames: Sequence[Point]) -> None:
    """Put fingers down at the first places, move them through the others, lift them."""
    session = page.context.new_cdp_session(page)
    kinds = ["touchStart", *["touchMove"] * (len(frames) - 1), "touchEnd"]
    for kind, places in zip(kinds, [*frames, ()], strict=True):
        points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(places)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    session.detach()


def test_a_tap_selects_in_the_print_and_in_the_chart(
    touched: Page, cooling: tuple[PlanDocument, Path]
) -> None:
    """As a click does."""
    document, _ = cooling
    box = box_of(touched, "#view-canvas")
    touched.evaluate("D.state.set({selected: null, time: D.page.plans[1].end_s})")
    middle = document.contours.polyline(len(document.contours) - 1).mean(axis=0)
    x, y, _ = touched.evaluate("p => D.view.where(p)", middle.tolist())
    touched.touchscreen.tap(box["x"] + box["width"] / 2 + x, box["y"] + box["height"] / 2 + y)
    touched.wait_for_function("D.state.get().selected !== null")
    actions = document.plan.heads[0]
    action = int(np.flatnonzero(actions.kind == ActionKind.PRINT)[0])
    box = box_of(touched, "#heads canvas[tabindex]")
    at = touched.evaluate(
        "t => [D.ganttDrawing.xOf(D.gantt.view, t), D.ganttDrawing.BAND + D.ganttDrawing.BAR / 2]",
        float(actions.begin_s[action] + actions.end_s[action]) / 2,
    )
    touched.touchscreen.tap(box["x"] + at[0], box["y"] + at[1])
    touched.wait_for_function("k => D.state.get().selected.action === k", arg=action)
    assert touched.evaluate("D.state.get().selected") == {"plan": 1, "head": 0, "action": action}


def test_fingers_turn_move_and_zoom_the_print(touched: Page) -> None:
    """One turns; two zoom as they part and move it as they move; none of it selects."""
    box = box_of(touched, "#view-canvas")
    touched.click("#view-fit")
    touched.evaluate("D.state.set({selected: null})")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def camera() -> Any:
        return touched.evaluate("(({yaw, zoom, target}) => ({yaw, zoom, target}))(D.view.camera())")

    was = camera()
    fingers(touched, [(x, y)], [(x + 40, y)], [(x + 80, y + 10)])
    turned = camera()
    assert turned["yaw"] != was["yaw"] and turned["zoom"] == was["zoom"]
    fingers(touched, [(x - 40, y), (x + 40, y)], [(x - 80, y), (x + 80, y)])
    nearer = camera()
    assert nearer["zoom"] == pytest.approx(2.0 * turned["zoom"], rel=0.01)
    pair = [(x - 40, y), (x + 40, y)]
    fingers(touched, pair, [(a + 50, b + 30) for a, b in pair])
    moved = camera()
    assert moved["zoom"] == pytest.approx(nearer["zoom"])
    assert np.abs(np.subtract(moved["target"], nearer["target"])).max() > 0.1
    assert touched.evaluate("D.state.get().selected") is None


def test_fingers_move_and_zoom_the_chart_of_heads(touched: Page) -> None:
    """What was under both fingers stays under them; one finger moves the time."""
    box = box_of(touched, "#heads canvas[tabindex]")
    touched.evaluate("D.gantt.span(0, 1e9)")
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 50

    def span() -> Any:
        return touched.evaluate("[D.gantt.view.from, D.gantt.view.to]")

    whole = span()
    fingers(touched, [(x - 50, y), (x + 50, y)], [(x - 100, y), (x + 100, y)])
    nearer = span()
    assert nearer[1] - nearer[0] == pytest.approx((whole[1] - whole[0]) / 2.0, rel=0.02)
    fingers(touched, [(x, y)], [(x - 40, y)], [(x - 80, y)])
    later = span()
    assert later[0] > nearer[0] and later[1] - later[0] == pytest.approx(nearer[1] - nearer[0])
