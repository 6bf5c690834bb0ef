"""Reports, and the system's own browsers to open them in."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, Playwright, sync_playwright

from decmcts import PlannerName, Result, Search, plan, read, sample_path
from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.print.plan import PlanDocument
from sim.faults import Gap, Nearest, Verdict
from sim.pictures.report import Told, write_report
from tests.sim.conftest import stacked_plan

CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
NEAREST = Nearest(heads=Gap(12.39, 5.0, ("left", "right"), ("left prints", "right rests")))
FIREFOX = ("firefox-esr", "firefox")
SOFTWARE = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader")  # fmt: skip


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
def playwright() -> Iterator[Playwright]:
    with sync_playwright() as started:
        yield started


@pytest.fixture(scope="session")
def screen() -> Iterator[str | None]:
    """A display; without one Firefox has no WebGL."""
    if "DISPLAY" in os.environ:
        yield os.environ["DISPLAY"]
        return
    if (server := shutil.which("Xvfb")) is None:
        yield None
        return
    reader, writer = os.pipe()
    command = [server, "-displayfd", str(writer), "-screen", "0", "1400x1000x24"]
    with subprocess.Popen(command, pass_fds=[writer], stderr=subprocess.DEVNULL) as process:
        os.close(writer)
        with os.fdopen(reader) as told:
            yield f":{told.readline().strip()}"
        process.terminate()


def found(names: tuple[str, ...]) -> str:
    for name in names:
        if (path := shutil.which(name)) is not None:
            return path
    pytest.skip(f"no {names[0]} on this machine: apt-get install {names[0]}")


@pytest.fixture(scope="session", params=["chromium", "firefox"])
def browser(
    request: pytest.FixtureRequest, playwright: Playwright, screen: str | None
) -> Iterator[Browser]:
    """Chromium and Firefox as the system has them, drawing in software."""
    if request.param == "chromium":
        opened = playwright.chromium.launch(executable_path=found(CHROMIUM), args=list(SOFTWARE))
    else:
        shown = {} if screen is None else {"DISPLAY": screen}
        opened = playwright.firefox.launch(
            channel="moz-firefox",
            executable_path=found(FIREFOX),
            env={**os.environ, **shown},
            firefox_user_prefs={"webgl.force-enabled": True},
        )
    yield opened
    opened.close()


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
        told=Told("two.gcode", Verdict((), checked=("a rule",), nearest=NEAREST), graph),
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


@contextmanager
def opened(browser: Browser, path: Path, **how: Any) -> Iterator[Page]:
    """Yield the page once it is ready; nothing may be asked for, warned of or fail."""
    page = browser.new_page(**how)
    said: list[str] = []
    page.on("console", lambda line: said.append(f"{line.type}: {line.text}"))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: said.append(request.url))
    page.goto(path.as_uri())
    page.evaluate("D.ready")
    yield page
    asked = [line for line in said if not line.startswith(("file:", "data:", "blob:"))]
    page.close()
    assert not [line for line in asked if "GPU stall" not in line and "WebGL" not in line]
