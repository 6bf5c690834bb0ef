"""Plan for several heads, each its own process."""

from __future__ import annotations

from decmcts.planning.compiling.child import compilation_told, compiling_beside
from decmcts.planning.compiling.parts import TEAM
from decmcts.planning.events import Report, Stop, never, unheard
from decmcts.planning.options import RULES, TEAM_SEARCH, Rules, TeamSearch
from decmcts.planning.problem.layer_by_layer import safe_problem
from decmcts.planning.problem.source import Source
from decmcts.planning.result import Result
from decmcts.planning.team.pipeline import plan_team


def launch(
    source: Source,
    search: TeamSearch = TEAM_SEARCH,
    rules: Rules = RULES,
    *,
    writes: bool = True,
    report: Report = unheard,
    stop: Stop = never,
) -> Result:
    """Plan for all heads of a machine: one process each, agreeing on one joint plan.

    Parameters
    ----------
    source : Source
        What `read` returned, for a machine with several heads.
    search : TeamSearch
        How long to search, and which parameters of the heads' search to change.
    rules : Rules
        What every order must keep.
    writes : bool
        Whether G-code will be written: then a print whose G-code could not be written is refused
        before the search.
    report : Report
        Told what is done and where the heads stand.
    stop : Stop
        Asked ten times a second; True has the heads agree on the best so far.

    Returns
    -------
    Result
        The joint plan that passed the judge. Should all processes fail, or none of their plans
        be faster, one head prints alone.

    Raises
    ------
    InputError
        When the print cannot be planned for this machine.
    VerificationError
        When the judge refuses the plan.

    Examples
    --------
    >>> from decmcts import TeamSearch, launch, read, sample_path
    >>> source = read(sample_path("plate.gcode.gz"), "dual-gantry")
    >>> result = launch(source, TeamSearch(time_limit_s=2.0))
    >>> result.after.print_time_s < result.before.print_time_s
    True
    >>> [head.head for head in result.document.plan.heads]
    ['left', 'right']
    """
    with compilation_told(report) as told, compiling_beside([TEAM], told):
        problem = safe_problem(source, rules, told)
        return Result(plan_team(problem, search, writes=writes, report=told, stop=stop), search)
