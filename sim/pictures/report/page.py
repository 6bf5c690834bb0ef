"""The report's page put together: one HTML file that needs nothing else."""

from __future__ import annotations

import html
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from decmcts.formats.files.atomic import write_whole
from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.print_events import EventKind, EventLog
from decmcts.print.print_state import happened
from sim.pictures.report.anew import Anew
from sim.pictures.report.data import History, page_data
from sim.pictures.report.facts import CarriedOut, ReportDetails

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
    details: ReportDetails | None = None,
) -> None:
    """Write the page.

    Parameters
    ----------
    path : file to write
    before, after : the source's own order and the plan
    history : rows of seconds, ..., cost: the search's best so far, drawn when there are any
    details : what else is known
    """
    page, blobs = page_data(before, after, history, details or ReportDetails())
    pieces = {
        "TITLE": html.escape(f"{page['title']}: report of decmcts"),
        "STYLE": "\n".join(map(_piece, STYLES)),
        "SCRIPT": "\n".join(map(_piece, (*LIBRARIES, *SCRIPTS))),
        "DATA": blobs.packed(page),
    }
    text = _piece("index.html")
    for name, piece in pieces.items():
        text = text.replace(f"<!--{name}-->", piece, 1)
    write_whole(path, text.encode(errors="replace"))  # names of files may be no text


def write_run_report(
    path: Path | str, document: PlanDocument, log: EventLog, *, file: str = "", contacts: int = 0,
    in_the_end: int | None = None, on_print: Sequence[str] = (), anew: Sequence[Anew] = (),
    missing: Sequence[str] = (),
) -> None:  # fmt: skip
    """Write the page of a print that was carried out: what was planned beside what happened.

    Parameters
    ----------
    document, log : the plan that was carried out, and what happened
    file : name of the source
    contacts, in_the_end, on_print, missing : as in `CarriedOut`
    anew : the plans that took its place, in turn; one of which nothing was begun does not count
    """
    after = happened(document, log)
    printed = sum(int((head.kind == ActionKind.PRINT).sum()) for head in after.plan.heads)
    failed = [
        (log.heads[event.head], event.time_s, event.what)
        for event in log.events
        if event.kind is EventKind.FAILED
    ]
    plans = [Anew(document, log), *(each for each in anew if each.log.events)]
    run = CarriedOut(
        printed, len(document.contours), failed, contacts, in_the_end, on_print, plans, missing
    )
    write_report(path, before=document, after=after, details=ReportDetails(file=file, run=run))


def _piece(name: str) -> str:
    return (PAGE / name).read_text(encoding="utf-8")
