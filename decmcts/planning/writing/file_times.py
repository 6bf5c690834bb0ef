"""Times of whole files, start and end G-code included, by one time model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from decmcts.formats.gcode.controller.duration import FileTime, print_time
from decmcts.formats.mesh import is_mesh
from decmcts.planning.options import AvoidWalls, Freedom, Seam
from decmcts.planning.problem.fewer_changes import LEAST_CHANGE_S
from decmcts.planning.problem.planned import Planned
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.print.metrics import Metrics
from decmcts.print.walls import outer_walls

# Writing a file anew rounds feeds and positions to the source's decimals, which moves its
# estimated time by a fraction of a second. So times are equal up to a share of the print time,
# but at least up to the first and at most up to the second of these seconds.
SAME_TIME_SHARE = 1e-3
SAME_TIME_S = 0.25, 1.0
ALWAYS_SHARE = 0.01  # of the source's time, that travels which are to go round walls may cost
SAME_OVER_MM = 0.05  # travel over walls that rounding may add
COUNTS_SHARE = 0.01  # of the source's travel or retractions; less of them is no gain by itself
COUNTS = {"emitted_travel_mm": 10.0, "retractions": 1, "travel_over_walls_mm": 10.0}  # at least


@dataclass(frozen=True, slots=True)
class FileTimes:
    """Estimated print times of whole files, start and end G-code included, in seconds."""

    before_s: float | None  # of the source; None: it is no G-code
    after_s: float
    refused_s: float | None = None  # of the new order, where the source was kept instead
    before: Metrics = field(default_factory=Metrics)  # of the source, see `whole_file`
    after: Metrics = field(default_factory=Metrics)  # of the result, likewise
    gained: bool = True  # whether the new order would have gained anything, be it longer or not
    over_walls_mm: float | None = None  # of the new order, where the source was kept for it

    @property
    def longer(self) -> bool:
        """Whether the result takes longer than its source."""
        return self.before_s is not None and is_longer(self.before_s, self.after_s)

    @property
    def shorter(self) -> bool:
        """Whether the result takes less time than its source."""
        return self.before_s is None or is_longer(self.after_s, self.before_s)

    @property
    def kept(self) -> bool:
        """Whether the result is the source as it was."""
        return self.refused_s is not None


def is_longer(before_s: float, after_s: float) -> bool:
    """Say whether the second time is longer, by more than writing a file anew can make it."""
    least, most = SAME_TIME_S
    return after_s > before_s + min(max(least, SAME_TIME_SHARE * before_s), most)


def gains(planned: Planned, times: FileTimes) -> bool:
    """Say whether a result is worth another file: less time, or less of what else counts.

    That is travel, retractions, or travel over outer walls, by `COUNTS_SHARE` of the source's at
    least; or fewer changes of tools. Where seams were asked to go to a place the result is what
    was asked for.
    """
    rules = planned.problem.rules
    if planned.problem.source.regrouped is not None:
        return True
    if times.shorter or (rules.freedom == Freedom.SEAM and rules.seam != Seam.NEAREST):
        return True
    was: dict[str, Any] = {**planned.before.metrics, **times.before}
    now: dict[str, Any] = {**planned.after.metrics, **times.after}
    return any(_falls(key, was, now) for key in COUNTS)


def _falls(key: str, was: Mapping[str, Any], now: Mapping[str, Any]) -> bool:
    """Say whether a figure of `COUNTS` falls by something that counts."""
    if was.get(key) is None or now.get(key) is None:
        return False
    return bool(was[key] - now[key] >= max(COUNTS[key], COUNTS_SHARE * was[key]))


def worth_longer(planned: Planned, times: FileTimes) -> bool:
    """Say whether a result may take longer, as travels were to go round walls and do.

    By up to `ALWAYS_SHARE` of the source's time, where less travel leads over outer walls by
    something that counts. Or by what fewer changes of tools take, which no file states.
    """
    made_of = planned.problem.source.regrouped
    spared_s = 0.0 if made_of is None else LEAST_CHANGE_S * made_of.fewer
    if spared_s and times.before_s is not None and times.after_s <= times.before_s + spared_s:
        return True
    if planned.problem.rules.avoid_walls != AvoidWalls.ALWAYS or times.before_s is None:
        return False
    short = times.after_s <= (1.0 + ALWAYS_SHARE) * times.before_s
    return short and _falls("travel_over_walls_mm", times.before, times.after)


def more_over_walls(planned: Planned, times: FileTimes) -> bool:
    """Say whether more of a result's travel leads over outer walls than of the source's.

    It may where travels are never to be led round them.
    """
    was, now = (each.get("travel_over_walls_mm") for each in (times.before, times.after))
    if was is None or now is None or planned.problem.rules.avoid_walls == AvoidWalls.NEVER:
        return False
    return bool(now > was + SAME_OVER_MM)


def compared_with(problem: PrintProblem) -> Path | None:
    """Return the G-code a result is compared with; None where there is none."""
    made_of = problem.source.regrouped
    document = problem.document if made_of is None else made_of.given.document
    source = Path(document.path)  # of a mesh: what its slicer made
    return None if is_mesh(source) else source


def source_time(problem: PrintProblem) -> FileTime | None:
    """Estimate the print time of the source; None where there is no G-code to compare with."""
    source, limits = compared_with(problem), problem.machine.limits
    if source is None:
        return None
    made_of = problem.source.regrouped
    given = problem.source if made_of is None else made_of.given
    own, plate = given.own_limits, given.plate
    walls = outer_walls(problem.job.contours)
    return print_time(source, limits, own_limits=own, walls=walls, plate=plate)


def file_times(planned: Planned, draft: Path) -> FileTimes:
    """Estimate the print times of the source and of the draft made from it."""
    problem = planned.problem
    walls, own = outer_walls(problem.job.contours), problem.source.own_limits
    after = print_time(draft, problem.machine.limits, own_limits=own, walls=walls)
    before = planned.sliced or source_time(problem)
    if before is None:
        return FileTimes(None, after.total_s, after=whole_file(after))
    return FileTimes(
        before.total_s, after.total_s, before=whole_file(before), after=whole_file(after)
    )


def whole_file(time: FileTime) -> Metrics:
    """Return a whole file's figures as metrics, for tables, `--json` and plan.json."""
    return {
        "file_time_s": time.total_s,
        "print_time_s": time.print_s,
        "retractions": time.retractions,
        "travel_over_walls_mm": time.over_walls_mm,
        "arcs": time.arcs,
    }


def with_whole_files(planned: Planned, times: FileTimes) -> Planned:
    """Return a result with the figures of its whole files among its metrics."""
    before = replace(planned.before, metrics={**planned.before.metrics, **times.before})
    after = replace(planned.after, metrics={**planned.after.metrics, **times.after})
    if times.before_s is None:  # of a mesh, only the plans can be compared
        after.metrics["print_time_s"] = planned.after.metrics["print_time_s"]
    return replace(planned, before=before, after=after)
