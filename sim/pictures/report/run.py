"""The report of a print that was carried out: what was planned beside what happened."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from decmcts.print.plan import ActionKind, PlanDocument
from decmcts.print.print_events import EventKind, EventLog
from decmcts.print.print_state import happened
from sim.pictures.report.facts import CarriedOut, Told
from sim.pictures.report.page import write_report


def write_run_report(
    path: Path | str, document: PlanDocument, log: EventLog, *, file: str = "", contacts: int = 0,
    in_the_end: int | None = None, on_print: Sequence[str] = (),
) -> None:  # fmt: skip
    """Write the page.

    Parameters
    ----------
    path : file to write
    document : the plan that was carried out
    log : what happened
    file : name of the source
    contacts : how often heads touched
    in_the_end : beads that were printed in all, where the rest was planned anew
    on_print : contacts of heads with the print, in words
    """
    after = happened(document, log)
    printed = sum(int((head.kind == ActionKind.PRINT).sum()) for head in after.plan.heads)
    failed = [
        (log.heads[event.head], event.time_s, event.what)
        for event in log.events
        if event.kind is EventKind.FAILED
    ]
    run = CarriedOut(printed, len(document.contours), failed, contacts, in_the_end, on_print)
    write_report(path, before=document, after=after, told=Told(file=file, run=run))
