"""Nothing is written that takes longer than its source, unless it is asked for.

Whole files are compared (start and end G-code, waits, retractions and lifts included), by one
time model. A search for `travel` that ended in a longer file is followed by a short one for
`time`; where that is longer too the source is kept, byte for byte. A mesh has no source file.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from decmcts.cli.console import clock_time
from decmcts.cli.outputs import (
    FileTimes,
    compared_with,
    draft_single,
    name_of,
    put,
    with_whole_files,
)
from decmcts.cli.pipeline import Announce, Planned, check, plan_single
from decmcts.formats.atomic import write_whole
from decmcts.formats.drafts import draft_folder
from decmcts.formats.gcode.source_text import load_text, packed_text

AGAIN_SHARE, AGAIN_MOST_S = 0.5, 10.0  # of the search time, for a search for time


def write_no_slower(
    planned: Planned,
    path: Path,
    announce: Announce,
    *,
    allow_slower: bool,
    stop: Callable[[], bool] = lambda: False,
) -> tuple[Planned, FileTimes]:
    """Write the G-code of one head to `path`; returns what was written and its times.

    Where the source is kept `path` becomes a copy of it, or stays as it is where it is the
    source; the plan returned is then the source's own order.

    Raises
    ------
    VerificationError
        When the text differs from the verified plan; what was at `path` is untouched.
    """
    with draft_folder() as folder:
        draft, started = folder / "draft.gcode", time.perf_counter()
        announce(f"writing {name_of(path)}, reading it back and judging it")
        times = draft_single(planned, draft, path)
        if times.longer and not allow_slower:
            planned, times = _again(planned, times, draft, path, announce, stop)
        if times.longer and not allow_slower:
            planned, times = _kept(planned, times, path, announce)
        else:
            put(packed_text(draft.read_bytes(), path, planned.loaded.path), path, packed=True)
        planned.seconds["write"] = time.perf_counter() - started
    return with_whole_files(planned, times), times


def _again(
    planned: Planned,
    times: FileTimes,
    draft: Path,
    path: Path,
    announce: Announce,
    stop: Callable[[], bool],
) -> tuple[Planned, FileTimes]:
    """Search for time what was searched for travel; the quicker of the two files is the draft."""
    said = planned.after.metrics
    if said["objective"] != "travel" or stop():
        return planned, times
    announce("the file would take longer than its source: searching for time")
    other = plan_single(
        planned.loaded, planner=said["planner"], freedom=said["freedom"],
        seam=said.get("seam", "nearest"), seed=said["seed"], objective="time",
        time_limit_s=min(AGAIN_SHARE * said["time_limit_s"], AGAIN_MOST_S),
        announce=announce, before=planned.before, stop=stop,
    )  # fmt: skip
    first = draft.read_bytes()
    found = draft_single(other, draft, path)
    if found.after_s < times.after_s:
        return other, found
    draft.write_bytes(first)
    return planned, times


def _kept(
    planned: Planned, times: FileTimes, path: Path, announce: Announce
) -> tuple[Planned, FileTimes]:
    """Leave the source as it is, or copy it to `path`; returns its own order and times."""
    source = compared_with(planned)
    assert source is not None and times.before_s is not None  # else nothing is longer
    before = planned.before
    after = replace(before, metrics={**before.metrics, "as_sliced": True, "kept_source": True})
    own = check(planned.loaded, before, after, planned.history, planned.seconds, announce)
    if not (path.exists() and path.samefile(source)):
        copy_source(source, path)
    return own, FileTimes(times.before_s, times.before_s, times.after_s, times.before, times.before)


def copy_source(source: Path, path: Path) -> None:
    """Write a file as it is; packed or unpacked only where the names say so."""
    if path.suffix == source.suffix:
        write_whole(path, source.read_bytes())
    else:
        put(packed_text(load_text(source), path, source), path, packed=True)


def kept_line(times: FileTimes) -> str:
    """Return why the source was kept."""
    assert times.refused_s is not None
    return (
        f"the new order would take {clock_time(times.refused_s)} and the source takes "
        f"{clock_time(times.after_s)}; --allow-slower writes it all the same"
    )
