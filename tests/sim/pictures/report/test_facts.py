"""The first screen's figures: each once, and no part longer than the whole."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim.faults import Gap, Nearest, Verdict
from sim.pictures.report.facts import ReportDetails, facts_of
from sim.verdict_lines import PLAN_RULES, checked_lines


def with_metrics(document, **metrics):
    return replace(document, metrics=metrics)


def test_the_time_is_of_the_whole_file_where_both_are_known(make):
    """Times of a plan and of a file are not the same thing."""
    document = make.timed(make.tower_plan())
    before = with_metrics(document, file_time_s=100.0)
    told = facts_of(before, with_metrics(document, file_time_s=60.0), ReportDetails())["time"]
    assert told == {"before_s": 100.0, "after_s": 60.0, "of": "whole file"}
    told = facts_of(before, document, ReportDetails())["time"]
    assert told["of"] == "plan" and told["before_s"] == document.plan.makespan_s


def test_a_figure_that_one_plan_lacks_is_not_compared(make):
    """A source without roles has no walls to cross."""
    document = make.tower_plan()
    before = with_metrics(document, emitted_travel_mm=9.0, travel_over_walls_mm=None)
    after = with_metrics(document, emitted_travel_mm=5.0, travel_over_walls_mm=None, retractions=3)
    (row,) = facts_of(before, after, ReportDetails())["rows"]
    assert row == {"key": "emitted_travel_mm", "label": "travel", "unit": "mm", "before": 9.0,
                   "after": 5.0}  # fmt: skip


def test_the_parts_of_a_head_fill_the_time_of_the_plan(make):
    """Printing, travelling, stepping aside and waiting are all there is."""
    document = make.timed(make.two_head_plan())
    for head in facts_of(document, document, ReportDetails())["heads"]:
        parts = [head[f"{part}_s"] for part in ("printing", "travelling", "aside", "waiting")]
        assert min(parts) >= 0.0
        assert sum(parts) == pytest.approx(document.plan.makespan_s)
        assert head["share"] == pytest.approx(head["printing_s"] / document.plan.makespan_s)


def test_several_heads_are_compared_with_one_and_with_the_bound(make):
    """One head has no such row."""
    metrics = {"one_head_s": 150.0, "bound": {"bound_s": 80.0}}
    document = make.timed(make.two_head_plan())
    found = facts_of(document, with_metrics(document, **metrics), ReportDetails())["speed_up"]
    assert found == {"one_head_s": 150.0, "makespan_s": document.plan.makespan_s, "bound_s": 80.0}
    assert facts_of(document, document, ReportDetails())["speed_up"] is None
    tower = make.tower_plan()
    assert facts_of(tower, with_metrics(tower, **metrics), ReportDetails())["speed_up"] is None


@pytest.mark.parametrize("unit", ["mm", "s"])
@pytest.mark.parametrize("gap", [25.0, 25.1, None])
def test_the_proof_is_told_where_it_tells_something(make, unit, gap):
    """A bound too far away does not tell a good order from a quick one."""
    value = "extrusionless_travel_mm" if unit == "mm" else "travel_s"
    document = make.tower_plan()
    after = with_metrics(document, **{f"bound_{unit}": 40.0, value: 50.0, "gap_percent": gap})
    proof = facts_of(document, after, ReportDetails())["proof"]
    assert proof == (
        {"unit": unit, "value": 50.0, "bound": 40.0, "gap_percent": 25.0} if gap == 25.0 else None
    )


def test_the_verdict_is_told_with_its_warnings(make):
    """What was checked, and what the source does as badly."""
    document = make.tower_plan()
    verdict = Verdict((), {}, ("order: keep",), ("line 3: the end code touches the print",))
    told = facts_of(document, document, ReportDetails("x.gcode", verdict, warnings=("slower",)))
    assert told["ok"] and told["judged"] and told["checked"] == [["asked", "order: keep", ""]]
    assert told["warnings"] == ["slower", "line 3: the end code touches the print"]
    assert not facts_of(document, document, ReportDetails())["judged"]


def test_what_was_checked_is_what_verify_prints(make):
    """One source of the words: two would part, and one of them be false."""
    counts = {"contours": 10, "actions": 21, "heads": 2, "moves": 90, "pairs": 4, "replays": 2}
    nearest = Nearest(heads=Gap(6.0, 5.0, ("left", "right"), ("left prints", "right rests")))
    verdict = Verdict((), counts, ("order: keep",), nearest=nearest)
    document = make.tower_plan()
    said = facts_of(document, document, ReportDetails(verdict=verdict))["checked"]
    lines = checked_lines(verdict, verbose=True)
    assert len(lines) == 12 and [about for about, *_ in said].count("rule") == len(PLAN_RULES)
    assert [line for about, text, where in said for line in printed(about, text, where)] == lines


def printed(about, text, where):
    """A sentence as it stands on the console."""
    said = text if about == "asked" else f"{about}: {text}"
    return [said, f"  {where}"] if where else [said]


def test_a_kept_source_says_why(make):
    """Who asked for a new order and sees none wants to know the reason."""
    document = make.tower_plan()
    after = with_metrics(document, kept_source=True, kept_because="nothing to gain: so and so")
    assert facts_of(document, after, ReportDetails())["kept_source"] == "nothing to gain: so and so"
    assert facts_of(document, document, ReportDetails())["kept_source"] is None


def test_where_heads_stand_idle_is_said(make):
    """In the words of the terminal; nothing where none does."""
    document = make.tower_plan()
    idle = {"waits": 3, "waits_s": 100.0, "pulled": 3, "primed": 2, "cooled": 1}
    after = with_metrics(document, idle=idle)
    assert facts_of(document, after, ReportDetails())["idle"] == (
        "3 long waits, 0:01:40 in all: pulled back further 3 times, cooled to standby 1 time, "
        "primed 2 times"
    )
    assert facts_of(document, document, ReportDetails())["idle"] == ""
