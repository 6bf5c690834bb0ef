"""Nothing is written that takes longer than its source or gains nothing, unless asked for.

Whole files are compared (start and end G-code, waits, retractions and lifts included), by one
time model. A search for `travel` that ended in a longer file is followed by a short one for
`time`; where that is longer too the source is kept, byte for byte. So it is where the new order
gains nothing that counts (`file_times.gains`), or has more travel over outer walls. A mesh has
no source file. A source whose own order would hit the part is never kept.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from decmcts.formats.files.atomic import draft_folder, write_whole
from decmcts.formats.gcode.controller.duration import print_time
from decmcts.formats.gcode.text.source_text import load_text, packed_text
from decmcts.formats.mesh import is_mesh
from decmcts.planning.events import Report, Step, Stop, never, unheard
from decmcts.planning.one_head.pipeline import plan_judged
from decmcts.planning.options import Objective, Search
from decmcts.planning.problem.fewer_changes import of_given
from decmcts.planning.problem.planned import Planned, check
from decmcts.planning.writing.file_times import (
    FileTimes,
    compared_with,
    gains,
    more_over_walls,
    with_whole_files,
    worth_longer,
)
from decmcts.planning.writing.lines import kept_line
from decmcts.planning.writing.one_head import draft_single
from decmcts.planning.writing.places import STDOUT, put
from decmcts.print.metrics import Metrics

AGAIN_SHARE, AGAIN_MOST_S = 0.5, 10.0  # of the first search's time, and at most so many s
DraftOf = Callable[[Planned, Path, Path], FileTimes]
"""Writes a plan's G-code to the second argument, to be named as the third; returns its times."""


def write_no_slower(
    planned: Planned,
    search: Search,
    path: Path,
    *,
    allow_slower: bool,
    report: Report = unheard,
    stop: Stop = never,
    draft_of: DraftOf | None = None,
) -> tuple[Planned, FileTimes]:
    """Write the G-code of one head to `path`; returns what was written and its times.

    Where the source is kept `path` becomes a copy of it, unless it is the source.

    Raises
    ------
    VerificationError
        When the text differs from the verified plan; what was at `path` is untouched.
    """
    draft_of = draft_of or partial(draft_single, report=report)
    with draft_folder() as folder:
        draft, started = folder / "draft.gcode", time.perf_counter()
        times = draft_of(planned, draft, path)
        allowed = allow_slower or worth_longer(planned, times)
        if times.longer and not allowed and search.objective == Objective.TRAVEL and not stop():
            other, first = _for_time(planned, search, report, stop), draft.read_bytes()
            found = draft_of(other, draft, path)
            if found.after_s < times.after_s:
                planned, times, allowed = other, found, worth_longer(other, found)
            else:
                draft.write_bytes(first)
        unsafe = planned.problem.source.original is not None
        worse = not allowed and (times.longer or not gains(planned, times))
        if not unsafe and (worse or more_over_walls(planned, times)):
            planned, times = _kept(planned, times, path, report)
        else:
            put(_packed(draft.read_bytes(), path, planned, times), path, packed=True)
        planned.seconds["write"] = time.perf_counter() - started
    return with_whole_files(planned, times), times


def _for_time(planned: Planned, search: Search, report: Report, stop: Stop) -> Planned:
    """Search for time after a search for travel."""
    report(Step("the file would take longer than its source: searching for time"))
    limit_s = min(AGAIN_SHARE * search.time_limit_s, AGAIN_MOST_S)
    for_time = replace(
        search, objective=Objective.TIME, time_limit_s=limit_s, certificate=False,
    )  # fmt: skip
    return plan_judged(
        planned.problem, for_time, before=planned.before, sliced=planned.sliced, report=report,
        stop=stop,
    )  # fmt: skip


def _kept(
    planned: Planned, times: FileTimes, path: Path, report: Report
) -> tuple[Planned, FileTimes]:
    """Leave the source as it is, or copy it to `path`; returns its own order and times."""
    source = compared_with(planned.problem)
    assert source is not None and times.before_s is not None  # else all is gained
    over_mm = times.after["travel_over_walls_mm"] if more_over_walls(planned, times) else None
    kept = FileTimes(
        times.before_s, times.before_s, times.after_s, times.before, times.before,
        gains(planned, times), over_mm,
    )  # fmt: skip
    planned = of_given(planned)
    stated: Metrics = {"as_sliced": True, "kept_source": True, "kept_because": kept_line(kept)}
    before = planned.before
    after = replace(before, metrics={**before.metrics, **stated})
    own = check(planned.problem, before, after, planned.history, planned.seconds, report)
    if not (path.exists() and path.samefile(source)):
        copy_source(source, path, planned.problem.source.plate)
    return own, kept


def _packed(text: bytes, path: Path, planned: Planned, times: FileTimes) -> bytes:
    """Return the G-code of a result as a file of this name holds it."""
    source, was_s = planned.problem.source, times.before_s
    source = source if source.regrouped is None else source.regrouped.given
    if source.original is not None and not is_mesh(source.path):
        source = source.original  # which states the time of its own order
        limits, own = planned.problem.machine.limits, source.own_limits
        was_s = print_time(source.path, limits, own_limits=own, plate=source.plate).total_s
    ratio = times.after_s / was_s if was_s else 1.0
    return packed_text(text, path, source.path, source.plate, time_ratio=ratio)


def copy_source(source: Path, path: Path, plate: int | None = None) -> None:
    """Write a file as it is; packed or unpacked only where the names say so."""
    if path != STDOUT and path.suffix == source.suffix:
        write_whole(path, source.read_bytes())
    else:
        put(packed_text(load_text(source, plate), path, source, plate), path, packed=True)
