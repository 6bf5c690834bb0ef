"""Plan for several heads: a process each, or a planner of one's own."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from functools import partial

from agents.launch import LaunchResult
from agents.launch import launch as launch_agents
from agents.launching.spawn import Agreement, Crew
from agents.launching.status import AgentStatus, LaunchError, OnProgress
from decmcts.arguments import checked
from decmcts.feasibility.graph import DependencyGraph
from decmcts.planning.compiling import TEAM, compilation_reported, compiling_beside, is_compiled
from decmcts.planning.events import Report, Stop, never, unheard
from decmcts.planning.options import RULES, TEAM_SEARCH, Rules, TeamSearch
from decmcts.planning.problem.own_tools import team_problem
from decmcts.planning.problem.print_problem import PrintProblem
from decmcts.planning.problem.source import Source
from decmcts.planning.result import Result
from decmcts.planning.team.pipeline import Launch, plan_team
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.incumbent import Budget, TeamIncumbent
from decmcts.team.planner import TeamPlanner


@checked
def launch(
    source: Source,
    search: TeamSearch = TEAM_SEARCH,
    rules: Rules = RULES,
    *,
    writes: bool = True,
    report: Report = unheard,
    stop: Stop = never,
    crew: Crew | None = None,
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
        before the search, and the heads' files are made and judged beside the judging of the
        plan, so that `Result.write_gcode` but puts them in place.
    report : Report
        Told what is done and where the heads stand.
    stop : Stop
        Asked ten times a second; True has the heads agree on the best so far.
    crew : Crew | None
        Processes that `crew_started` started before the print was read; None: they are
        started here.

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
    own = None if search.planner is None else partial(planned_by, search.planner)
    return launched(
        partial(team_problem, source, rules), len(source.machine.heads), search, writes=writes,
        report=report, stop=stop, agents=own, crew=crew,
    )  # fmt: skip


def launched(
    problem_of: Callable[[Report], PrintProblem], heads: int, search: TeamSearch, *,
    writes: bool, report: Report, stop: Stop, agents: Launch | None, crew: Crew | None = None,
) -> Result:  # fmt: skip
    """Plan a problem that is found while the heads' processes load.

    `agents` stands for these processes: a planner of one's own, or what a test has.
    """
    waiting = nullcontext(crew) if agents or crew else crew_started(heads)
    with (
        compilation_reported(report) as reporting, compiling_beside([TEAM], reporting),
        waiting as ready,
    ):  # fmt: skip
        planned = plan_team(
            problem_of(reporting), search, writes=writes, report=reporting, stop=stop,
            agents=agents or partial(launch_agents, crew=ready),
        )  # fmt: skip
        return Result(planned, search)


@contextmanager
def crew_started(heads: int) -> Iterator[Crew | None]:
    """Start the heads' processes, so that they load while the print is read and judged.

    None while their kernels are still being compiled: each would compile them for itself.
    """
    if not is_compiled(TEAM):
        yield None
        return
    with Crew(heads) as crew:
        yield crew


def planned_by(
    planner: TeamPlanner,
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    *,
    stopping: Stopping,
    seed: int,
    lags: Lags | None,
    start: StatedOrder | None,
    parameters: Mapping[str, float] | None,
    on_progress: OnProgress | None,
) -> LaunchResult:
    """Return what the planner finds, as if agents had agreed on it.

    Raises LaunchError if it offers no order that keeps all rules.
    """
    problem = build_team_problem(job, machine, graph, lags, start)
    best = TeamIncumbent(problem, Budget(stopping, time.monotonic))
    planner.plan(best, seed=seed)
    found, live = best.found, tuple(range(len(machine.heads)))
    if not found.toolpaths:
        raise LaunchError("the planner offered no order that keeps all rules")
    agents = tuple(
        AgentStatus(
            head, name, "released", live, found.orders, found.makespan_s, best.seconds,
            history=found.history,
        )
        for head, name in enumerate(problem.head_names)
    )  # fmt: skip
    if on_progress is not None:
        on_progress(agents)
    return LaunchResult(Agreement({}, found.makespan_s, "", live, agents), found.toolpaths)
