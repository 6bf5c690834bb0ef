"""The G-code of one head, as a draft that the judge reads back."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from decmcts.formats.gcode import write_gcode
from decmcts.formats.gcode.dialects.stated_times import restated
from decmcts.formats.gcode.writing.own_header import as_sliced, with_time
from decmcts.planning.events import Report, Step, unheard
from decmcts.planning.problem.planned import Planned
from decmcts.planning.writing.file_times import FileTimes, file_times
from decmcts.planning.writing.lines import header_lines
from decmcts.planning.writing.places import name_of, require_sound
from sim.content.seams import seams_of_plan
from sim.files.written import verify_written

STEPS = 3  # of a draft: written, timed, judged


GcodeWriter = Callable[..., None]
"""Writes the plan of one head; `write_gcode`, or in a test one that fails."""


def draft_single(
    planned: Planned,
    draft: Path,
    path: Path,
    *,
    write: GcodeWriter = write_gcode,
    report: Report = unheard,
) -> FileTimes:
    """`write` the reordered G-code of a one-head plan to a draft and read it back.

    Raises
    ------
    VerificationError
        When the text differs from the verified plan; it names `path`, where it was to go.
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
