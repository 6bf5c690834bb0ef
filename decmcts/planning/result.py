"""A plan that passed the judge, and what can be written of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from decmcts.arguments import checked
from decmcts.arrays import Floats, Int32s
from decmcts.errors import InputError
from decmcts.formats.plans.plan_json import write_plan
from decmcts.planning.events import Report, Stop, never, unheard
from decmcts.planning.one_head.certificate import Certificate, certify
from decmcts.planning.one_head.no_slower import write_no_slower
from decmcts.planning.options import Search, TeamSearch
from decmcts.planning.problem.planned import History, Planned, before_by_pieces
from decmcts.planning.problem.source import Source
from decmcts.planning.writing.file_times import FileTimes
from decmcts.planning.writing.heads import stem_of, write_heads
from decmcts.planning.writing.lines import source_lines
from decmcts.planning.writing.places import refuse_other_suffixes, refuse_unwritable
from decmcts.print.brief import brief
from decmcts.print.plan import PlanDocument
from decmcts.search.planners import toolpath_cost
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.schedule.metrics import head_toolpath
from sim.faults import Verdict


@dataclass(frozen=True, slots=True)
class Figures:
    """What an order costs."""

    travel_mm: float  # extrusionless, from the end of each contour to the next one's start
    emitted_travel_mm: float  # as moved, lifts and detours included
    print_time_s: float  # the plan's makespan; of a written file from its first bead to its last

    __repr__ = brief("travel_mm", "emitted_travel_mm", "print_time_s")

    @staticmethod
    def of(document: PlanDocument) -> Figures:
        """Return the figures of a plan."""
        stated = document.metrics
        return Figures(
            stated["extrusionless_travel_mm"], stated["emitted_travel_mm"], stated["print_time_s"]
        )


@dataclass(frozen=True, slots=True)
class Result:
    """A plan that passed the judge, for one head or several; `plan` and `launch` return it.

    Parameters
    ----------
    planned : Planned
        The plan, the source's own order and the verdict.
    search : Search | TeamSearch
        What was asked.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from decmcts import PlannerName, Search, plan, read, sample_path
    >>> source = read(sample_path("four_nuts.gcode.gz"), "mk4s")
    >>> result = plan(source, Search(1.0, planner=PlannerName.GREEDY))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = result.write_gcode(Path(folder) / "better.gcode")
    >>> [path.name for path in written.paths], written.times.longer
    (['better.gcode'], False)
    """

    planned: Planned
    search: Search | TeamSearch

    __repr__ = brief(
        "source.name", "source.machine.name", "before", "after", "bound", "bound_s", "verdict.ok"
    )

    @property
    def source(self) -> Source:
        """What was planned."""
        return self.planned.problem.source

    @property
    def document(self) -> PlanDocument:
        """The plan with all that is needed to check or draw it, as plan.json has it."""
        return self.planned.after

    @property
    def order(self) -> NDArray[np.intp]:
        """Contours of `document` in the order in which they begin, (n,)."""
        return self.document.plan.order

    @property
    def assignments(self) -> Int32s:
        """Place of the head that prints each contour among the plan's heads, (n,)."""
        return self.document.plan.assignments

    @property
    def schedule(self) -> Floats:
        """When each contour begins and ends by the plan, (n, 2) s."""
        return self.document.plan.schedule

    @property
    def before(self) -> Figures:
        """What the source's own order costs, with one head."""
        return Figures.of(self.planned.before)

    @property
    def after(self) -> Figures:
        """What the plan costs."""
        return Figures.of(self.planned.after)

    @property
    def verdict(self) -> Verdict:
        """What the judge says of the plan."""
        return self.planned.verdict

    @property
    def bound(self) -> Certificate | None:
        """How far from optimal the travels of one head are at most; None if not asked for."""
        return Certificate.of(self.document.metrics)

    @property
    def bound_s(self) -> float | None:
        """The makespan no joint plan can beat, s; None for one head."""
        found = self.document.metrics.get("bound")
        return None if found is None else found["bound_s"]

    @property
    def history(self) -> History:
        """The best so far over time: rows of seconds, ..., cost."""
        return self.planned.history

    @checked
    def write_gcode(
        self,
        path: str | Path,
        *,
        allow_slower: bool = False,
        report: Report = unheard,
        stop: Stop = never,
    ) -> Written:
        """Write the plan as G-code, once its draft was read back and judged.

        For one head, a file that would take longer than its source is not written: a short
        search for time follows, and if that is no faster the source is kept. So it is where
        neither time, travel, retractions nor travel over outer walls fall. For several
        heads `path` is a stem: one file ``STEM_HEAD.gcode`` is written for each.

        Parameters
        ----------
        path : str | Path
            The file, replaced as a whole or not at all; it may be the source itself.
        allow_slower : bool
            Write it even if the whole file takes longer than its source, or gains nothing. With
            several heads it always is.
        report, stop
            As in `plan`; `stop` for one head alone.

        Returns
        -------
        Written
            What was written, and its times.

        Raises
        ------
        InputError
            When nothing can be written there.
        VerificationError
            When the text, read back, is not the plan; what was there is untouched.
        """
        out, search = Path(path), self.search
        if isinstance(search, TeamSearch):
            return Written(self, tuple(write_heads(self.planned, stem_of(out), report=report)))
        planned, times = write_no_slower(
            self.planned, search, out, allow_slower=allow_slower, report=report, stop=stop
        )
        return Written(replace(self, planned=planned), (out,), times)

    @checked
    def write_plan(self, path: str | Path) -> None:
        """Write plan.json, or plan.json.gz.

        Raises
        ------
        InputError
            When nothing can be written there, or the name ends otherwise.
        """
        out = Path(path)
        refuse_unwritable([out], self.source.path)
        refuse_other_suffixes(out, None, None)
        write_plan(self.document, out)

    @checked
    def write_report(self, path: str | Path) -> None:
        """Write an HTML report with the paths before and after.

        Raises
        ------
        InputError
            As `write_plan`.
        """
        from sim.pictures.report import (  # shapely loads for those who ask
            ReportDetails,
            write_report,
        )

        out, planned = Path(path), self.planned
        refuse_unwritable([out], self.source.path)
        refuse_other_suffixes(None, out, None)
        details = ReportDetails(
            self.source.name, planned.verdict, planned.problem.graph,
            source_lines(planned.problem.job),
        )  # fmt: skip
        write_report(
            out,
            before=before_by_pieces(planned.before, planned.after),
            after=planned.after,
            history=planned.history,
            details=details,
        )

    @checked
    def write_picture(self, path: str | Path, *, layer: int | None = None) -> None:
        """Write a picture of what changed, for papers and chats: a PNG, or an SVG.

        Parameters
        ----------
        path : str | Path
            The file; its name ends in .png or .svg.
        layer : int | None
            The layer whose travels are drawn, from 1; None: where travel changed most.

        Raises
        ------
        InputError
            As `write_plan`, and for a layer the print has not.
        """
        from sim.pictures.drawings import draw_plan  # and so does matplotlib

        out = Path(path)
        refuse_unwritable([out], self.source.path)
        refuse_other_suffixes(None, None, out)
        name, planned = self.source.name, self.planned
        before = before_by_pieces(planned.before, planned.after)
        draw_plan(out, before, planned.after, name=name, layer=layer)


@dataclass(frozen=True, slots=True)
class Written:
    """G-code that was written."""

    result: Result  # of the plan in the file, which may be that of another search, or the source's
    paths: tuple[Path, ...]
    times: FileTimes | None = None  # of whole files; None for several heads

    __repr__ = brief("paths", "times")


@checked
def bound(result: Result, *, time_limit_s: float = 10.0) -> Certificate:
    """Prove how far from optimal the travels of a result for one head are at most.

    `plan` does so itself, unless its `Search` says `certificate=False`: this is for more time.

    Parameters
    ----------
    result : Result
        What `plan` returned.
    time_limit_s : float
        Seconds of proving; `plan` takes ten at most.

    Returns
    -------
    Certificate
        The bound and the gap, in the unit of what was minimised. The bound is no lower than
        what `plan` has proven.

    Raises
    ------
    InputError
        If the limit is negative or infinite; for the result of several heads, whose bound is
        on the makespan (`result.bound_s`); and where the source was kept that enters loops where
        the seam policy does not.

    Examples
    --------
    >>> from decmcts import PlannerName, Search, bound, plan, read, sample_path
    >>> source = read(sample_path("four_nuts.gcode.gz"), "mk4s")
    >>> quick = Search(time_limit_s=1.0, planner=PlannerName.GREEDY, certificate=False)
    >>> found = bound(plan(source, quick), time_limit_s=1.0)
    >>> 0.0 < found.bound <= found.travel
    True
    """
    search = result.search
    if not isinstance(search, Search):
        raise InputError("a plan for several heads has no bound on travel", advice="see bound_s")
    problem = result.planned.problem.for_one_head(search.objective)
    actions = result.document.plan.heads[0]
    try:
        travel = toolpath_cost(problem, head_toolpath(actions))
    except ValueError as error:  # no order of the problem enters loops as the source does
        raise InputError(
            "the source was kept, which enters loops where the seam policy does not",
            path=result.source.path,
        ) from error
    found = certify(problem, travel, stopping=Stopping(time_limit_s), most_s=time_limit_s)
    proven = result.bound
    return proven if proven is not None and (proven.bound or 0.0) > (found.bound or 0.0) else found
