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
from decmcts.formats.gcode import write_gcode
from decmcts.formats.gcode.controller.duration import print_time
from decmcts.formats.gcode.dialects.stated_times import restated
from decmcts.formats.gcode.text.source_text import load_text, packed_text
from decmcts.formats.gcode.writing.own_header import as_sliced, with_time
from decmcts.formats.mesh import is_mesh
from decmcts.planning.events import Report, Step, Stop, never, unheard
from decmcts.planning.one_head.pipeline import plan_judged
from decmcts.planning.options import Objective, Search
from decmcts.planning.problem.fewer_changes import of_given
from decmcts.planning.problem.planned import Planned, check
from decmcts.planning.writing.file_times import (
    FileTimes,
    compared_with,
    file_times,
    gains,
    more_over_walls,
    with_whole_files,
    worth_longer,
)
from decmcts.planning.writing.lines import header_lines, kept_line
from decmcts.planning.writing.places import STDOUT, name_of, put, require_sound
from decmcts.print.metrics import Metrics
from sim.content.seams import seams_of_plan
from sim.files.written import verify_written

STEPS = 3  # of a draft: written, timed, judged
AGAIN_SHARE, AGAIN_MOST_S = 0.5, 10.0  # of the first search's time, and at most so many s


def draft_single(
    planned: Planned,
    draft: Path,
    path: Path,
    *,
    write: Callable[..., None] = write_gcode,
    report: Report = unheard,
) -> FileTimes:
    """`write` the reordered G-code of a one-head plan to a draft and read it back.

    Raises VerificationError when the text differs from the verified plan; it names `path`, where it
    was to go.
    """
    problem, actions, name = planned.problem, planned.after.plan.heads[0], name_of(path)
    report(Step(f"writing {name}", 1, STEPS))
    write(problem.document, problem.job, actions, draft, header_lines=header_lines(planned))
    report(Step(f"print time of {name}", 2, STEPS))
    times = file_times(planned, draft)
    if times.before_s:
        text = restated(draft.read_bytes(), times.after_s / times.before_s)
        was = as_sliced(problem.document.preamble)
        sliced_s = times.before_s if was is None or was.time_s is None else was.time_s
        draft.write_bytes(with_time(text, sliced_s, times.after_s))
    report(Step(f"reading {name} back and judging it", 3, STEPS))
    seams = list(seams_of_plan(actions))
    verdict = verify_written(
        draft, problem.job, problem.document, problem.machine, seams=seams, actions=actions
    )
    require_sound(verdict, path)
    made_of = problem.source.regrouped
    given = problem.source.original if made_of is None else made_of.given
    if given is not None:  # another order was made of it: judged by what was given too
        require_sound(verify_written(draft, given.job, given.document, problem.machine), path)
    return times


def write_no_slower(
    planned: Planned,
    search: Search,
    path: Path,
    *,
    allow_slower: bool,
    report: Report = unheard,
    stop: Stop = never,
    draft_of: Callable[[Planned, Path, Path], FileTimes] | None = None,
) -> tuple[Planned, FileTimes]:
    """Write the G-code of one head to `path`; returns what was written and its times.

    Where the source is kept `path` becomes a copy of it, unless it is the source. Raises
    VerificationError when the text differs from the verified plan; what was at `path` is untouched.
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
        plate = planned.problem.source.plate
        if path != STDOUT and path.suffix == source.suffix:
            write_whole(path, source.read_bytes())
        else:  # packed or unpacked only where the names say so
            put(packed_text(load_text(source, plate), path, source, plate), path, packed=True)
    return own, kept


def _packed(text: bytes, path: Path, planned: Planned, times: FileTimes) -> bytes:
    source, was_s = planned.problem.source, times.before_s
    source = source if source.regrouped is None else source.regrouped.given
    if source.original is not None and not is_mesh(source.path):
        source = source.original  # which states the time of its own order
        limits, own = planned.problem.machine.limits, source.own_limits
        was_s = print_time(source.path, limits, own_limits=own, plate=source.plate).total_s
    ratio = times.after_s / was_s if was_s else 1.0
    return packed_text(text, path, source.path, source.plate, time_ratio=ratio)
