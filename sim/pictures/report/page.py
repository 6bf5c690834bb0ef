"""The report's page put together: one HTML file that needs nothing else."""

from __future__ import annotations

import html
from importlib.resources import files
from pathlib import Path

from decmcts.formats.files.atomic import write_whole
from decmcts.print.plan import PlanDocument
from sim.pictures.report.data import History, page_data
from sim.pictures.report.facts import Told

PAGE = files("sim.pictures.report") / "page"
LIBRARIES = ("vendor/regl.min.js", "vendor/uPlot.iife.min.js")
VIEW = (
    "camera.js", "beads.js", "colours.js", "changes.js", "layers.js", "segments.js", "travels.js",
    "bodies.js", "pick.js", "painter.js", "tints.js", "input.js", "selected.js", "controls.js",
    "view.js",
)  # fmt: skip
CHARTS = (
    "timeline.js", "gantt_drawing.js", "gantt.js", "gantt_controls.js", "waits.js", "stops.js",
    "charts.js", "order_graph.js", "facts.js",
)  # fmt: skip
SCRIPTS = (
    "data.js", "state.js", "format.js", "elements.js", "words.js", *VIEW, *CHARTS, "main.js",
)  # fmt: skip
STYLES = ("vendor/uPlot.min.css", "style.css", "view.css", "charts.css")


def write_report(
    path: Path | str,
    *,
    before: PlanDocument,
    after: PlanDocument,
    history: History = (),
    told: Told | None = None,
) -> None:
    """Write the page.

    Parameters
    ----------
    path : file to write
    before, after : the source's own order and the plan
    history : rows of seconds, ..., cost: the search's best so far, drawn when there are any
    told : what else is known
    """
    page, blobs = page_data(before, after, history, told or Told())
    pieces = {
        "TITLE": html.escape(f"{page['title']}: report of decmcts"),
        "STYLE": "\n".join(map(_piece, STYLES)),
        "SCRIPT": "\n".join(map(_piece, (*LIBRARIES, *SCRIPTS))),
        "DATA": blobs.packed(page),
    }
    text = _piece("index.html")
    for name, piece in pieces.items():
        text = text.replace(f"<!--{name}-->", piece, 1)
    write_whole(path, text.encode())


def _piece(name: str) -> str:
    return (PAGE / name).read_text(encoding="utf-8")
