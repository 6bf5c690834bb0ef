"""The page is self-contained and shows what the plan holds."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from sim.pictures.report import action_polyline, gained, plot_convergence, scene_of, write_report


@pytest.mark.slow
def test_the_page_needs_no_network(make, tmp_path):
    """A report opened on a print farm without internet must work."""
    document = make.two_head_plan()
    write_report(
        tmp_path / "r.html", before=document, after=document, history=[(0, 9, 2.0), (1, 99, 1.0)]
    )
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", page)
    for title in ("What was gained", "Toolpath", "Heads over time", "Search"):
        assert f"<h2>{title}</h2>" in page


@pytest.mark.slow
@pytest.mark.parametrize("rule_s", [0.0, 4.0])
def test_the_page_says_why_a_cooled_plan_travels_more_than_its_search(make, tmp_path, rule_s):
    """A curve that ends below the table's travel looks like a mistake."""
    document = replace(make.tower_plan(), min_layer_time_s=rule_s)
    history = [(0, 9, 2.0), (1, 99, 1.0)]
    write_report(tmp_path / "r.html", before=document, after=document, history=history)
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert ("may travel more than" in page) == (rule_s > 0.0)


@pytest.mark.slow
def test_names_cannot_break_the_page(make, tmp_path):
    """Head names come from files; they are text, not markup."""
    document = make.tower_plan()
    evil = "</script><script>alert(1)</script>"
    actions = replace(document.plan.heads[0], head=evil)
    document = replace(document, plan=replace(document.plan, heads=(actions,)))
    write_report(tmp_path / "r.html", before=document, after=document)
    assert evil not in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_curves_hold_the_paths_in_time_order(make):
    """The slider cuts a curve by time, so its times must ascend."""
    document = make.two_head_plan()
    for actions in document.plan.heads:
        for printing in (True, False):
            rows = action_polyline(actions, printing=printing, step=1)
            assert (np.diff(rows[:, 3]) >= 0).all()
            paths = int((np.isin(actions.kind, 0) == printing).sum())
            assert np.isnan(rows[:, 0]).sum() == paths - 1


def test_thinning_keeps_the_ends_and_says_so(make):
    """A thinned picture is honest about it, and its travels still connect."""
    document = make.tower_plan()
    page, notes = scene_of(document, document, most=40)
    assert len(notes) == 2
    actions = document.plan.heads[0]
    drawn = np.frombuffer(base64.b64decode(page["curves"][0]["x"]), "<f4")
    ends = actions.path[actions.path_offsets[1:] - 1, 0][actions.kind == 0]
    assert set(ends.astype("f4")) <= set(drawn)
    assert len(drawn) < len(actions.path)


def test_the_scene_is_plain_json(make):
    """NaN and numpy numbers would stop the page's script."""
    page, _ = scene_of(make.tower_plan(), make.two_head_plan())
    json.dumps(page, allow_nan=False)


def test_the_table_shows_change(make):
    """The first thing a user looks for."""
    document = make.tower_plan()
    before = replace(document, metrics={"extrusionless_travel_mm": 200.0})
    after = replace(
        document, metrics={"extrusionless_travel_mm": 50.0, "planner": "local", "seed": 3}
    )
    rows = {row[0]: row[1:] for row in gained(before, after)}
    assert rows["travel between contours (the paper's metric), mm"] == ("200", "50", "-75.0 %")
    assert rows["planner"] == ("", "local", "")


@pytest.mark.parametrize(("unit", "text"), [("mm", "least travel"), ("s", "shortest travel time")])
def test_the_table_says_what_is_proven(make, unit, text):
    """The bound stands beside what it bounds, where it tells a good order from a quick one."""
    document = make.tower_plan()
    metrics = {f"bound_{unit}": 40.0, f"travel_{unit}": 50.0}
    shown = ("", "40.0", "at most 25.0 % above")
    for gap, said in ((25.0, shown), (25.1, None), (None, None)):
        after = replace(document, metrics={**metrics, "gap_percent": gap})
        rows = {row[0]: row[1:] for row in gained(document, after)}
        assert rows.get(f"{text} any order can have (proven), {unit}") == said
        times = rows.get("time of travels, as the search prices it, s")
        assert times == (("", "50.0", "") if unit == "s" else None)


def test_the_table_says_what_several_heads_gain(make):
    """Against one head alone, and against the proven bound; not without these figures."""
    document = make.two_head_plan()
    metrics = {"makespan_s": 100.0, "one_head_s": 150.0, "bound": {"bound_s": 80.0}}
    rows = {row[0]: row[1:] for row in gained(document, replace(document, metrics=metrics))}
    assert rows["one head alone, s"] == ("", "150", "1.50 times as fast")
    assert rows["makespan bound (proven), s"] == ("", "80", "at most 25 % above")
    bare = {row[0] for row in gained(document, replace(document, metrics={"makespan_s": 100.0}))}
    assert not bare & {"one head alone, s", "makespan bound (proven), s"}


def test_the_search_is_drawn_above_the_bound():
    """A gain of a few per cent is seen, and how far the bound is."""
    figure = plot_convergence([(1.0, 110.0), (2.0, 100.0)], "makespan, s", 80.0)
    low, high = figure.layout.yaxis.range
    assert 70.0 < low < 80.0 and 110.0 < high < 120.0
    assert "80" in figure.layout.annotations[0].text
    assert plot_convergence([(1.0, 110.0)], "travel, mm").layout.yaxis.rangemode == "tozero"
