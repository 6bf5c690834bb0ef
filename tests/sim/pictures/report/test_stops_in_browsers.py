"""What if a head stopped now: what others could still print of the plan, and what waits for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from decmcts.print.plan import ActionKind, HeadActions, PlanDocument
from sim.pictures.report import write_report, write_run_report
from tests.conftest import opened
from tests.planning.replanning.conftest import log_until
from tests.sim.conftest import stacked_plan

pytestmark = pytest.mark.slow


def left_of(document: PlanDocument, stopped: int, seconds: float) -> dict[str, int]:
    """The same by another way: actions are done one after the other, as long as any can be."""
    heads = document.plan.heads
    done = [int((head.end_s <= seconds + 0.001).sum()) for head in heads]
    now, count = list(done), done.copy()
    moved = True
    while moved:
        moved = False
        for h, head in enumerate(heads):
            while h != stopped and count[h] < len(head):
                if any(count[g] <= a for g, a in head.after(count[h])):
                    break
                count[h] += 1
                moved = True

    def beads(head: HeadActions, first: int, last: int) -> int:
        return int((head.kind[first:last] == ActionKind.PRINT).sum())

    others = [h for h in range(len(heads)) if h != stopped]
    return {
        "left": beads(heads[stopped], now[stopped], len(heads[stopped])),
        "free": sum(beads(heads[h], now[h], count[h]) for h in others),
        "waiting": sum(beads(heads[h], count[h], len(heads[h])) for h in others),
    }


def same_at_all_times(page: Page, document: PlanDocument) -> None:
    ends = np.concatenate([head.end_s for head in document.plan.heads])
    for seconds in [0.0, *(ends - 0.05).tolist(), float(ends.max())]:
        for h in range(len(document.plan.heads)):
            found = page.evaluate("([h, t]) => D.stops.at(h, t)", [h, seconds])
            alone = found.pop("alone")
            assert found == left_of(document, h, seconds) and 0 <= alone <= found["left"]


def test_what_waits_is_what_never_begins(page: Page, cooling: tuple[PlanDocument, Path]) -> None:
    """At every moment, against a plan carried out without that head."""
    document, _ = cooling
    same_at_all_times(page, document)
    right = [page.evaluate("([h, t]) => D.stops.at(h, t)", [0, t]) for t in (0.0, 1e6)]
    assert right[0]["waiting"] > 0 and right[1] == {"left": 0, "waiting": 0, "free": 0, "alone": 0}


def test_the_table_follows_the_time(page: Page, cooling: tuple[PlanDocument, Path]) -> None:
    """And says so in words."""
    table = page.locator("#stops table")
    assert "If a head stopped for good at 0:00:00" in table.inner_text()
    before = table.locator("tbody tr").first.inner_text()
    end = cooling[0].plan.makespan_s
    page.evaluate("(time) => D.state.set({ time })", end)
    page.wait_for_function("(was) => document.querySelector('#stops tbody tr').innerText !== was",
                           arg=before)  # fmt: skip
    cells = table.locator("tbody tr").first.locator("td").all_inner_texts()
    assert cells == ["left", "0", "0", "0", "0"]


def test_beads_that_no_other_head_reaches_are_counted(browser: Browser, tmp_path: Path) -> None:
    document: PlanDocument = stacked_plan((0, 1, -1, 0.0))
    short = replace(document.machine.heads[1], reach_max=(-1.0, 1e3, 1e3))
    machine = replace(document.machine, heads=(document.machine.heads[0], short))
    path = tmp_path / "short.html"
    write_report(path, before=document, after=replace(document, machine=machine))
    with opened(browser, path) as page:
        found = [page.evaluate("(h) => D.stops.at(h, 0)", h) for h in (0, 1)]
        assert found[0]["alone"] == found[0]["left"] > 0 and found[1]["alone"] == 0


def test_a_run_that_broke_off_has_the_plan_s_rest(browser: Browser, tmp_path: Path) -> None:
    """What was planned behind the last thing that happened counts too."""
    document: PlanDocument = stacked_plan((0, 1, -1, 0.0))
    log = log_until(document, 0.5 * document.plan.makespan_s)
    path = tmp_path / "run.html"
    write_run_report(path, document, log)
    with opened(browser, path) as page:
        late = page.evaluate("[0, 1].map((h) => D.stops.at(h, 1e6))")
        done = len({event.action for event in log.events if event.head == 1})
        assert sum(each["left"] for each in late) > 0 and done > 0
        assert late[0]["left"] + late[0]["free"] + late[0]["waiting"] == sum(
            each["left"] for each in late
        )
