"""Find a better order for one head."""

from __future__ import annotations

from decmcts.arguments import checked
from decmcts.errors import InputError
from decmcts.planning.compiling import compilation_reported, compiling_beside, parts_for
from decmcts.planning.events import Report, Stop, never, unheard
from decmcts.planning.one_head.pipeline import plan_one_head
from decmcts.planning.options import RULES, SEARCH, AvoidWalls, Rules, Search
from decmcts.planning.problem.fewer_changes import beside_given, with_fewer_changes
from decmcts.planning.problem.layer_by_layer import safe_problem
from decmcts.planning.problem.source import Source, first_head
from decmcts.planning.result import Result


@checked
def plan(
    source: Source,
    search: Search = SEARCH,
    rules: Rules = RULES,
    *,
    writes: bool = True,
    make_safe: bool = True,
    report: Report = unheard,
    stop: Stop = never,
) -> Result:
    """Find a better order for one head and have it judged.

    Parameters
    ----------
    source : Source
        What `read` returned. Of a machine with several heads the first one prints it.
    search : Search
        How long, with which planner, and what is minimised.
    rules : Rules
        What every order must keep.
    writes : bool
        Whether G-code will be written: then a print whose G-code could not be written is refused
        before the search.
    make_safe : bool
        Whether a print whose own order would hit the part is printed layer by layer instead.
    report : Report
        Told what is done and how the search goes.
    stop : Stop
        Asked many times a second; True ends the search with the best so far.

    Returns
    -------
    Result
        The plan that passed the judge. Where nothing better was found it is the source's own
        order.

    Raises
    ------
    InputError
        When the print cannot be planned for this machine.
    VerificationError
        When the judge refuses the plan.

    Examples
    --------
    >>> from decmcts import PlannerName, Search, plan, read, sample_path
    >>> source = read(sample_path("four_nuts.gcode.gz"), "mk4s")
    >>> result = plan(source, Search(time_limit_s=1.0, planner=PlannerName.GREEDY))
    >>> result.after.travel_mm < result.before.travel_mm
    True
    >>> result.verdict.ok
    True
    """
    if rules.without_tower:
        raise InputError(
            "one head changes its tools, so its wipe tower stays", path=source.path,
            advice="a tower is left out by `launch`, where each head has one tool",
        )  # fmt: skip
    one = first_head(source, report)
    parts = parts_for(search, rules.freedom, walls=rules.avoid_walls == AvoidWalls.ALWAYS)
    with compilation_reported(report) as reporting, compiling_beside(parts, reporting):
        one = with_fewer_changes(one, rules, reporting)
        problem = safe_problem(one, rules, reporting, make_safe=make_safe)
        planned = plan_one_head(problem, search, writes=writes, report=reporting, stop=stop)
        planned = beside_given(planned)
    return Result(planned, search)
