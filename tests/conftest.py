"""What tests of many rooms share: agents in this process, and the system's own browsers.

Browsers are started once for all tests of a process.

Firefox draws in software at twice Chromium's cost: in it the README's command uses every
control, and CI does all the rest (`long`).
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, Playwright, sync_playwright  # noqa: TID251

from tests.makers.agents import Agents, planned_here

CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
FIREFOX = ("firefox-esr", "firefox")
SOFTWARE = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader")  # fmt: skip


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Function]) -> None:
    """Mark what is done in Firefox after Chromium did it."""
    for item in items:
        chosen = getattr(item, "callspec", None)
        in_firefox = chosen is not None and chosen.params.get("browser") == "firefox"
        if in_firefox:
            item.add_marker(pytest.mark.long)


@pytest.fixture
def agents() -> Agents:
    return Agents()


@pytest.fixture
def agents_here(agents: Agents) -> Iterator[None]:
    """Let `launch` plan in this process."""
    with planned_here(agents):
        yield


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
