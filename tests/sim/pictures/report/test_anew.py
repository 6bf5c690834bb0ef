"""What a failure changed, as the report of a run has it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser

from decmcts.planning.options import TeamSearch
from decmcts.planning.problem.made_from import rules_of
from decmcts.planning.replanning.replan import replan, rest_of
from decmcts.planning.replanning.rest import LeftBeads
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.print_state import state_of_events
from sim.pictures.report import Anew, write_run_report
from sim.pictures.report.anew import changes_by
from sim.pictures.report.blobs import Blobs
from tests.conftest import opened
from tests.planning.replanning.conftest import Made, alone, log_until, made, within_print

__all__ = ["alone", "made"]
pytestmark = pytest.mark.slow
PARK, STANDS = {"right": (345.0, 150.0, 10.0)}, {"right": (150.0, 100.0, 0.6)}
BEGINS_S = 100.0  # of the new plan

Broken = tuple[Anew, Anew, float]


def broken_off(made: Made, agents: Any, fenced: dict[str, Any]) -> Broken:
    """Return a plan up to when head right fails, what is planned anew, and when that fails."""
    time_s, _ = within_print(made.document, 1, 12.0)
    log = log_until(made.document, time_s, failed=1)
    state = state_of_events(made.document, log)
    rest = rest_of(made.document, made.source, state, fenced, LeftBeads.FINISH)
    document = replan(rest, TeamSearch(0.2), rules_of(made.document), agents=agents).document
    after = log_until(document, document.plan.makespan_s)
    events = tuple(replace(each, time_s=each.time_s + BEGINS_S) for each in after.events)
    return Anew(made.document, log), Anew(document, replace(after, events=events)), time_s


def printed(document: PlanDocument, head: int) -> int:
    actions = document.plan.heads[head]
    return int((actions.kind == ActionKind.PRINT).sum())


def test_a_head_takes_over_what_another_should_have_printed(made: Made, alone: Any) -> None:
    """All that is left is its own, and what was the other's is told apart."""
    old, new, _ = broken_off(made, alone, PARK)
    (found,) = changes_by([old, new], Blobs())
    ended = [
        sum(e.head == h and e.kind == "ended" for e in old.log.events) for h in (0, 1)
    ]  # fmt: skip
    done = [
        int((actions.kind[:k] == ActionKind.PRINT).sum())
        for actions, k in zip(old.document.plan.heads, ended, strict=True)
    ]
    left = [printed(old.document, h) - done[h] for h in (0, 1)]
    assert [row["left"] for row in found["heads"]] == left and found["left"] == sum(left)
    beads = len(new.document.contours)
    assert [row["now"] for row in found["heads"]] == [beads, 0]
    (moved,) = found["moved"]
    assert (moved["was"], moved["now"]) == ("right", "left")
    was_left = beads - moved["beads"]
    assert moved["beads"] == left[1] and was_left in (left[0], left[0] - 1)  # one was left begun
    assert found["old_end_s"] == pytest.approx(old.document.plan.makespan_s)
    assert found["begin_s"] == pytest.approx(BEGINS_S)
    assert found["new_end_s"] == pytest.approx(BEGINS_S + new.document.plan.makespan_s)
    assert found["ended_s"] == pytest.approx(found["new_end_s"], abs=0.01)


def test_what_nobody_prints_is_nobodys(made: Made, alone: Any) -> None:
    """The living head keeps away from the dead one, and what is there is no one's."""
    old, new, _ = broken_off(made, alone, STANDS)
    (found,) = changes_by([old, new], Blobs())
    now = sum(row["now"] for row in found["heads"])
    assert now == len(new.document.contours) < found["left"] and not found["moved"]


def test_a_second_failure_is_held_against_the_second_plan(made: Made, alone: Any) -> None:
    """Its own times count from when it began."""
    old, new, _ = broken_off(made, alone, PARK)
    third = Anew(new.document, replace(new.log, events=tuple(
        replace(each, time_s=each.time_s + BEGINS_S) for each in new.log.events
    )))  # fmt: skip
    half = tuple(e for e in new.log.events if e.time_s < BEGINS_S + 10.0)
    found = changes_by([old, replace(new, log=replace(new.log, events=half)), third], Blobs())
    assert [each["begin_s"] for each in found] == pytest.approx([BEGINS_S, 2.0 * BEGINS_S])
    assert found[1]["old_end_s"] == pytest.approx(found[0]["new_end_s"])
    assert 0 < found[1]["left"] < len(new.document.contours)


def test_the_page_shows_it(browser: Browser, made: Made, alone: Any, tmp_path: Path) -> None:
    """In words, and on the time line: what heads did of the new plan stands behind the first."""
    old, new, failed_s = broken_off(made, alone, PARK)
    path, words = tmp_path / "run.html", "3 contours are not finished"
    write_run_report(
        path, old.document, old.log, anew=[new], in_the_end=len(old.document.contours),
        missing=[words],
    )  # fmt: skip
    with opened(browser, path) as page:
        facts = page.locator("#facts").inner_text()
        assert "What the failure changed: planned anew at 0:01:40" in facts and words in facts
        assert "that right should have printed are left's" in facts
        assert page.evaluate("D.page.run.failed[0].time_s") == pytest.approx(failed_s)
        actions = new.document.plan.heads[0]
        k = int(np.flatnonzero(actions.kind == ActionKind.PRINT)[3])
        middle = BEGINS_S + float(actions.begin_s[k] + actions.end_s[k]) / 2.0
        asked: Callable[[float], dict[str, Any]] = lambda t: page.evaluate(  # noqa: E731 - short
            "(t) => D.gantt.at(0, t)", t
        )
        assert asked(middle)["what"] == "prints" and asked(middle)["action"] == -1
        assert asked(float(old.document.plan.heads[0].end_s[2]) - 0.01)["action"] == 2
        assert page.evaluate("D.gantt.view.to") == pytest.approx(
            BEGINS_S + new.document.plan.makespan_s, abs=0.1
        )
        legend = page.locator("#heads .legend").first.inner_text()
        assert "a head failed" in legend and "planned anew" in legend
