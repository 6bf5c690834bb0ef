"""Two heads against one, in one process: how much faster, and is it safe.

    python -m sim.experiments.two_heads [PRINT.gcode ...] --machine dual-gantry --time-limit 20

For each print the team plans in this process with perfect messages; one head
alone plans as long. Every joint plan is judged: the exact check of all timings
and replays with every action between half and twice its time. Prints a table
and writes `two_heads.csv` and a picture and a Gantt chart per print.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from decmcts.errors import InputError
from decmcts.feasibility.graph import DependencyGraph
from decmcts.feasibility.rules import order_rules
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import JointPlan, PlanDocument
from decmcts.samples import sample_path
from decmcts.search.planners import plan_order
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.engine.alone import lone_machine
from decmcts.team.engine.problem import build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.metrics import plan_metrics
from sim.pictures.drawings import draw_gantt, draw_plan
from sim.verify import verify_plan

EXAMPLE = sample_path("plate.gcode.gz")


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table."""

    name: str
    contours: int
    one_head_s: float
    team_s: float
    faster: float  # one_head_s / team_s
    over_bound: float  # team_s / proven lower bound
    replays: int
    contacts: int
    faults: int
    plan_s: float  # seconds of planning
    verify_s: float


def run(
    path: Path, machine: Machine, *, time_limit_s: float, trials: int, seed: int, out: Path
) -> Row:
    """Plan one print for one head and for the team, judge both, draw the team's plan."""
    job, _ = read_gcode(path)
    graph = order_rules(job, machine)
    alone = plan_alone(job, machine, graph, time_limit_s=time_limit_s, seed=seed)
    started = time.perf_counter()
    team = plan_together(job, machine, graph, time_limit_s=time_limit_s, seed=seed)
    plan_s = time.perf_counter() - started
    verdict = verify_plan(team, source=job, trials=trials, seed=seed)
    baseline = verify_plan(alone, source=job, trials=0, seed=seed)
    stem = path.name.split(".")[0]
    draw_plan(out / f"{stem}.png", alone, team)
    draw_gantt(out / f"{stem}_gantt.png", team)
    one, both = alone.plan.makespan_s, team.plan.makespan_s
    bound = makespan_bound(job, machine, graph)
    return Row(
        name=stem,
        contours=len(job.contours),
        one_head_s=one,
        team_s=both,
        faster=one / both,
        over_bound=both / bound.bound_s,
        replays=int(verdict.counts.get("replays", 0)),
        contacts=int(verdict.counts.get("contacts", 0)),
        faults=len(verdict.faults) + len(baseline.faults),
        plan_s=plan_s,
        verify_s=verdict.counts["seconds"],
    )


def plan_alone(
    job: PrintJob, machine: Machine, graph: DependencyGraph, *, time_limit_s: float, seed: int
) -> PlanDocument:
    """Return the plan of one head that reaches everything, the yardstick of the team."""
    machine = lone_machine(machine)
    problem = OrderProblem.from_job(job, graph, "reversible")
    found = plan_order(problem, planner="local", stopping=Stopping(seconds=time_limit_s), seed=seed)
    plan = schedule(job, machine, graph, [found.toolpath])
    return _document(job, machine, graph, plan)


def plan_together(
    job: PrintJob, machine: Machine, graph: DependencyGraph, *, time_limit_s: float, seed: int
) -> PlanDocument:
    """Return the team's joint plan."""
    problem = build_team_problem(job, machine, graph)
    proposal = plan_in_turn(problem, stopping=Stopping(seconds=time_limit_s), seed=seed)
    found = resolve(problem, proposal.plans, range(len(machine.heads)))
    return _document(job, machine, graph, schedule(job, machine, graph, found.toolpaths))


def _document(
    job: PrintJob, machine: Machine, graph: DependencyGraph, plan: JointPlan
) -> PlanDocument:
    metrics = plan_metrics(job, plan)
    return PlanDocument("", machine, job.contours, graph.pairs(), plan, metrics)


def print_table(rows: Sequence[Row]) -> None:
    """Print the rows with aligned columns."""
    heads = [field.name for field in fields(Row)]
    cells = [[v if isinstance(v, str) else f"{v:.5g}" for v in astuple(row)] for row in rows]
    widths = [max(map(len, column)) for column in zip(heads, *cells, strict=True)]
    for line in [heads, *cells]:
        print("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write the rows with a header."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([field.name for field in fields(Row)])
        writer.writerows(astuple(row) for row in rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns 1 when the judge found any fault."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("inputs", nargs="*", type=Path, metavar="PRINT.gcode", default=[EXAMPLE])
    parser.add_argument("--machine", default="dual-gantry")
    parser.add_argument("--time-limit", type=float, default=20.0, metavar="S")
    parser.add_argument("--trials", type=int, default=5, metavar="N", help="random timings")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the results")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    try:
        machine = load_machine(options.machine)
        for path in options.inputs:
            rows.append(  # each print takes minutes: keep what is done
                run(
                    path,
                    machine,
                    time_limit_s=options.time_limit,
                    trials=options.trials,
                    seed=options.seed,
                    out=options.out,
                )
            )
            write_csv(options.out / "two_heads.csv", rows)
            print_table(rows)
    except InputError as error:
        print(f"decmcts: {error}", file=sys.stderr)
        return 2
    return 1 if any(row.faults for row in rows) else 0


if __name__ == "__main__":
    raise SystemExit(main())
