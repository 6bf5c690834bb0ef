"""Starts one process per head, watches them and collects the plan they agree on.

`launch` is what `decmcts launch` calls. Reading, verifying and writing are done by
`decmcts.planning`, which stands above this package.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from agents.launching.spawn import Agreement, Crew, OnStart, run_agents
from agents.launching.status import LaunchError, OnProgress
from agents.messages.kinds import apart
from agents.planners.pack import Pack, write_pack
from agents.planners.serial import joint_order
from decmcts.feasibility.digest import code_digest, team_digest
from decmcts.feasibility.graph import DependencyGraph
from decmcts.formats.files.atomic import draft_folder
from decmcts.print.job import PrintJob
from decmcts.print.lags_kernels import Lags
from decmcts.print.machine import Machine
from decmcts.print.toolpath import Toolpath
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.parameters import Parameters, changed
from decmcts.team.engine.plans import StatedOrder
from decmcts.team.engine.problem import build_team_problem


@dataclass(frozen=True, slots=True, eq=False)
class LaunchResult:
    """An agreement turned into what each head prints."""

    agreement: Agreement
    toolpaths: tuple[Toolpath, ...]  # one a head, in the machine's order; empty for lost heads


def launch(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    *,
    stopping: Stopping,
    seed: int,
    lags: Lags | None = None,
    start: StatedOrder | None = None,
    parameters: Mapping[str, float] | None = None,
    on_progress: OnProgress | None = None,
    on_start: OnStart | None = None,
    crew: Crew | None = None,
) -> LaunchResult:
    """Plan a print by one process per head of the machine.

    The print goes to the agents in a temporary folder; callbacks, what ends planning and
    the `crew` are those of `run_agents`. A crew of another number of heads is not used.
    `lags` say how long what is printed over must cool, `start` is an order to begin with,
    `parameters` set some of `decmcts.team.dec_mcts.parameters`.

    LaunchError if the agents come to no plan, or to one that resolves differently here; InputError
    if no head can print some contour, or a parameter is not allowed; ValueError as `run_agents`.
    """
    changed(Parameters(), parameters or {})
    problem = build_team_problem(job, machine, graph, lags, start)
    expected = team_digest(problem.digest, job, code=code_digest())
    with draft_folder() as folder:
        write_pack(Pack(job, machine, graph, parameters or {}, lags, start), folder)
        agreement = run_agents(
            problem.head_names,
            ["--pack", str(folder), "--expect", expected],
            stopping=stopping,
            seed=seed,
            on_progress=on_progress,
            on_start=on_start,
            crew=crew if crew is not None and len(crew) == len(problem.head_names) else None,
        )
    resolved = joint_order(problem, agreement.plans, agreement.live)
    if resolved.digest != agreement.digest:
        agreed, here = apart(agreement.digest, resolved.digest)
        raise LaunchError(f"the agreed plan {agreed} resolves to {here} here")
    return LaunchResult(agreement, resolved.toolpaths)
