"""Reports to be opened in browsers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from decmcts import PlannerName, Result, Search, plan, read, sample_path
from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.print.plan import PlanDocument
from sim.faults import Gap, Nearest, Verdict
from sim.pictures.report import ReportDetails, write_report
from tests.conftest import opened
from tests.sim.conftest import stacked_plan

NEAREST = Nearest(heads=Gap(12.39, 5.0, ("left", "right"), ("left prints", "right rests")))


@pytest.fixture(scope="session")
def one_head(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    """A planned print, and its report."""
    folder = tmp_path_factory.mktemp("report")
    source = read(sample_path("four_nuts.gcode.gz"), "mk4s")
    result = plan(source, Search(1.0, planner=PlannerName.GREEDY))
    written = result.write_gcode(folder / "better.gcode")
    written.result.write_report(folder / "report.html")
    return written.result, folder / "report.html"


@pytest.fixture(scope="session")
def cooling(tmp_path_factory: pytest.TempPathFactory) -> tuple[PlanDocument, Path]:
    """A plan and its report: the right head waits for the left one to pass, then for 60 s."""
    document = stacked_plan((0, 1, -1, 60.0))
    document = replace(
        document,
        precedence=np.array([(0, 2)], np.int32),
        metrics={"one_head_s": 200.0, "bound": {"bound_s": 57.0}, "agents": [{"head": "left"}],
                 "found_by": "right", "team": {"lost": {"third": "no answer"}},
                 "decided": [[0.1, 1.0, 1.0], [0.5, 0.4, 0.0]]},
    )  # fmt: skip
    graph = DependencyGraph.from_pairs(
        3, document.precedence, np.array([EdgeKind.GEOMETRY], np.uint8)
    )
    path = tmp_path_factory.mktemp("report") / "heads.html"
    write_report(
        path, before=document, after=document, history=[(0.5, 150.0), (2.0, 130.0)],
        details=ReportDetails(
            "two.gcode", Verdict((), checked=("a rule",), nearest=NEAREST), graph
        ),
    )  # fmt: skip
    return document, path


@pytest.fixture(scope="session")
def shared_page(browser: Browser, cooling: tuple[PlanDocument, Path]) -> Iterator[Page]:
    """The page of that report, opened once: it takes longer than most of what is tried in it."""
    with opened(browser, cooling[1]) as page:
        yield page


@pytest.fixture
def page(shared_page: Page) -> Page:
    """The same page, showing the whole print with nothing selected."""
    shared_page.evaluate(
        """() => { document.activeElement.blur(); D.gantt.span(0, 1e9); D.gantt.leave();
        D.state.set({ selected: null, time: 0 }); }"""
    )
    return shared_page
