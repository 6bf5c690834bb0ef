"""The documentation: pages a forge shows, and the site made of them."""

from __future__ import annotations

import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*.md")]
)
ELSEWHERE = {"klippy/toolhead.py", "klippy/extras/output_pin.py"}  # files of Klipper
MOST_WORDS = {"README.md": 600, "ARCHITECTURE.md": 2500, "docs/team.md": 2000}  # tables counted


@pytest.fixture(scope="module")
def files() -> list[str]:
    folders = ("agents", "benchmarks", "decmcts", "docs", "examples", "sim", "tests")
    return [str(p.relative_to(ROOT)) for folder in folders for p in (ROOT / folder).rglob("*.py")]


def anchors(page: Path) -> set[str]:
    """What a forge calls the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", text).strip().lower().replace(" ", "-") for text in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    """A reader on a forge follows links between pages, headings and files."""
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"https?:", target):
            continue
        path, _, heading = target.partition("#")
        to = (page.parent / path).resolve() if path else page
        assert to.exists(), target
        assert not heading or heading in anchors(to), target


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if page.name != "CHANGELOG.md" and page.parent.name != "results"],
    ids=lambda page: str(page.relative_to(ROOT)),
)
def test_files_named_in_the_text_are_there(page, files):
    """A page that sends its reader to a module which has moved costs more than it gives."""
    text = page.read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w./-]+\.py)`", text)) - ELSEWHERE
    assert not {n for n in named if not any(f"/{file}".endswith(f"/{n}") for file in files)}
    for name in set(re.findall(r"`((?:decmcts|agents|sim)(?:\.\w+)+)", text)):
        pkgutil.resolve_name(name)


@pytest.mark.parametrize(("page", "most"), MOST_WORDS.items())
def test_what_is_read_first_is_short(page, most):
    """Whoever has a printer and five minutes, or a change to make, reads all of it."""
    assert len((ROOT / page).read_text(encoding="utf-8").split()) <= most


@pytest.mark.long
def test_site_is_built_without_warnings(tmp_path):
    """Broken links, headings, tables and docstrings show here, not to a reader."""
    options = ["-W", "--keep-going", "-q", "-c", "docs/site", "-d", str(tmp_path / "doctrees")]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, ".", str(tmp_path / "site")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    pages = {str(p.relative_to(tmp_path / "site")) for p in tmp_path.glob("site/**/*.html")}
    made = {str(p.relative_to(ROOT).with_suffix(".html")) for p in PAGES}
    assert made <= pages
    api = (tmp_path / "site/docs/site/api.html").read_text(encoding="utf-8")
    assert 'id="decmcts.search.planners.plan_order"' in api
    assert "NDArray[np.float64]" in api
