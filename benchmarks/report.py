"""How large a report is, and how fast it is written, opens and moves in a browser.

    python benchmarks/report.py [--models four_nuts,plate,spiral_cup] [--repeats 3]

Each print is planned by the layered baseline, which is quick: a report is as large whatever the
order. The browser is the system's Chromium, without a screen, drawing in software. Writes
docs/results/report.csv (a row a repeat) and report.md. Needs Chromium and playwright.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from common import Rows, arguments, grouped, markdown, print_path, setting, spread

KEY = ("model", "repeat")
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader"]  # fmt: skip
WRITTEN_S, OPEN_S, PICTURES = 10.0, 5.0, 10.0
LARGEST_MB = {"four_nuts": 1.0, "plate": 1.5, "spiral_cup": 5.0}
MOVES = 60  # of the mouse, to turn the print


def measure(model: str, options: argparse.Namespace, rows: Rows) -> None:
    """Append a row for each repeat of a print."""
    from decmcts import PlannerName, Search, plan, read

    source = read(print_path(model), options.machine)
    result = plan(source, Search(1.0, planner=PlannerName.LAYERWISE, certificate=False))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "report.html"
        for repeat in range(options.repeats):
            if rows.has(model=model, repeat=repeat):
                continue
            started = time.perf_counter()
            result.write_report(path)
            wrote = time.perf_counter() - started
            found = {"mb": path.stat().st_size / 1e6, "written_s": wrote, **looked_at(path)}
            rounded = {name: round(value, 3) for name, value in found.items()}
            contours = len(result.document.contours)
            row = {"model": model, "repeat": repeat, "contours": contours, **rounded}
            rows.append({**row, "error": ""})
            print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)


def looked_at(path: Path) -> dict[str, float]:
    """Return how long a page takes to show the whole print, and pictures a second when turned."""
    from playwright.sync_api import sync_playwright  # noqa: TID251  # in a process of its own

    program = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if program is None:
        sys.exit("no Chromium on this machine: apt-get install chromium")
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=program, args=SOFTWARE)
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        began = time.perf_counter()
        page.goto(path.as_uri())
        page.evaluate("D.ready")
        first = time.perf_counter() - began
        page.evaluate("D.view.ready")
        whole = time.perf_counter() - began
        pictures = turned(page)
        browser.close()
    return {"first_s": first, "open_s": whole, "pictures_a_s": pictures}


def turned(page: Any) -> float:
    """Return the pictures a second that are drawn while the mouse turns the print."""
    canvas = page.locator("#view canvas").first
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    began, frames = time.perf_counter(), page.evaluate("D.view.stats().frames")
    for step in range(MOVES):
        page.mouse.move(x + 4 * step, y + step)
    drawn = page.evaluate("D.view.stats().frames") - frames
    return float(drawn / (time.perf_counter() - began))


def table(rows: list[dict[str, str]]) -> str:
    lines = []
    for (model,), mine in grouped(rows, "model").items():
        columns = {
            name: [float(row[name]) for row in mine]
            for name in ("mb", "written_s", "first_s", "open_s", "pictures_a_s")
        }
        kept = (
            median(columns["mb"]) <= LARGEST_MB.get(model, 5.0)
            and median(columns["written_s"]) <= WRITTEN_S
            and median(columns["open_s"]) <= OPEN_S
            and median(columns["pictures_a_s"]) >= PICTURES
        )
        lines.append([
            model, mine[0]["contours"], spread(columns["mb"], 2), spread(columns["written_s"], 1),
            spread(columns["first_s"], 1), spread(columns["open_s"], 1),
            spread(columns["pictures_a_s"], 0), "yes" if kept else "NO",
        ])  # fmt: skip
    head = ["print", "contours", "MB", "written, s", "first screen, s", "whole print, s",
            "pictures a second, turned", "within the limits"]  # fmt: skip
    return markdown(lines, head)


def main() -> None:
    parser = arguments(__doc__, time_limit=1.0, models="four_nuts,plate,spiral_cup")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--machine", default=None, help="name, if the file names none")
    options = parser.parse_args()
    rows = Rows(options.results / "report.csv", KEY)
    for model in [] if options.table_only else options.models:
        measure(model, options, rows)
    limits = (
        f"Limits: written in {WRITTEN_S:g} s, the whole print drawn in {OPEN_S:g} s, "
        f"{PICTURES:g} pictures a second; "
        + ", ".join(f"{name} {mb:g} MB" for name, mb in LARGEST_MB.items())
    )
    said = setting(note=options.note, browser="Chromium, drawing in software", machine="as named")
    text = f"# The report\n\n{said}\n\nRepeat: `python benchmarks/report.py`. {limits}. The page "
    text += "is opened without a screen, 1400 x 900; then the mouse turns the print. Of repeats "
    text += "the median and quartiles.\n\n" + table(rows.rows)
    (options.results / "report.md").write_text(text)


if __name__ == "__main__":
    main()
