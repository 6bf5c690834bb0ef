"""Reports, and the system's own browsers to open them in."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Playwright, sync_playwright

from decmcts import PlannerName, Result, Search, plan, read, sample_path

CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
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
