"""Prove how far from optimal a result is at most."""

from __future__ import annotations

from decmcts.arguments import checked
from decmcts.errors import InputError
from decmcts.planning.one_head.certificate import Certificate, certify
from decmcts.planning.options import Search
from decmcts.planning.result import Result
from decmcts.search.planners import toolpath_cost
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.schedule.metrics import head_toolpath


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
