"""The report of a run: what was planned beside what happened."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from decmcts.print.plan import PlanDocument
from decmcts.print.print_events import EventKind, PrintEvent
from sim.pictures.report import write_run_report
from tests.conftest import opened
from tests.planning.replanning.conftest import log_until
from tests.sim.conftest import stacked_plan

pytestmark = pytest.mark.slow


def test_planned_and_happened_stand_on_one_time_line(browser: Browser, tmp_path: Path) -> None:
    """A run that was late, and broken off: who failed, how far it came, and the plan below it."""
    document: PlanDocument = stacked_plan((0, 1, -1, 0.0))
    log = log_until(document, document.plan.heads[0].end_s[-1])
    late = [replace(event, time_s=2.0 * event.time_s) for event in log.events if event.head == 0]
    park = document.machine.heads[1].park
    failed = PrintEvent(EventKind.FAILED, 1, 1.0, -1, 0, park, what="clogged")
    events = tuple(sorted([*late, failed], key=lambda event: event.time_s))
    path = tmp_path / "run.html"
    write_run_report(path, document, replace(log, events=events), file="two.gcode")
    with opened(browser, path) as page:
        facts = page.locator("#facts").inner_text()
        assert "Broken off" in facts and "right failed at 0:00:01: clogged" in facts
        assert "planned" in facts and "happened" in facts and "ended after" in facts
        ends = page.evaluate("D.page.plans.map((plan) => plan.end_s)")
        assert page.evaluate("D.gantt.view.to") == pytest.approx(max(ends), abs=0.01)
        found = page.evaluate("(t) => D.gantt.at(0, t)", float(late[1].time_s) - 0.01)
        assert found["action"] == late[1].action
        before = page.locator("#heads .gantt canvas").first.bounding_box()
        page.get_by_role("button", name="Whole print").click()
        assert before is not None and before["height"] > 2 * (36 + 40 + 7 + 10 + 12)
        assert page.get_by_role("button", name="Planned").count()
        assert page.get_by_role("button", name="Happened").count()
        assert "Saving" not in page.locator("#search").inner_text()
        assert "a head printed nothing" in page.locator("#heads").inner_text()


def test_what_was_planned_anew_is_told(browser: Browser, tmp_path: Path) -> None:
    """The page is of the first plan, but the print is not broken off where others finished it."""
    document: PlanDocument = stacked_plan((0, 1, -1, 0.0))
    log = log_until(document, document.plan.heads[0].end_s[-1])
    left = replace(log, events=tuple(event for event in log.events if event.head == 0))
    path, beads = tmp_path / "run.html", len(document.contours)
    write_run_report(path, document, left, in_the_end=beads)
    with opened(browser, path) as page:
        facts = page.locator("#facts").inner_text()
        assert "Carried out, planned anew" in facts and f"{beads} of {beads} beads" in facts
        assert "of them by the first plan" in facts and "this plan ended after" in facts


def test_contacts_with_the_print_are_said(browser: Browser, tmp_path: Path) -> None:
    """All is printed, and yet it must not be run."""
    document: PlanDocument = stacked_plan((0, 1, -1, 0.0))
    log = log_until(document, document.plan.makespan_s)
    path, words = tmp_path / "run.html", "0:01:02: left travels, its slice goes into contour 3"
    write_run_report(path, document, log, on_print=[words])
    with opened(browser, path) as page:
        facts = page.locator("#facts").inner_text()
        assert "A head touched the print" in facts and words in facts
