"""Heads that are late: our joint plans against the same plans run by the clock.

    python benchmarks/late_heads.py [--models plate,mix_1,…] [--random 20] [--runs 10]

Prints: the eight large plates and `plate` on `dual-gantry`, planned by two heads in one
process (`--rounds`), and small prints on machines made at random, of two to eight heads
(`tests.makers.random_machines`), by empty plans. Troubles, baseline and what is
counted: `tests.makers.late_heads`. One row for a print and a kind of trouble.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from common import Rows, arguments, corpus, grouped, markdown, print_path, run_missing, setting

from decmcts.errors import InputError
from decmcts.feasibility.rules import order_rules
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.plan import PlanDocument
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.engine.resolve import resolve
from decmcts.team.schedule.joint_plan import schedule
from tests.makers.late_heads import TROUBLES, Rehearsal, Run, random_trouble
from tests.makers.random_teams import problem_of

KEY = ("print", "trouble", "runs", "rounds")
PLATES = "plate mix_1 mix_2 mix_3 mix_4 mix_5 mix_6 same_4_far same_9"


def problem_named(name: str) -> TeamProblem:
    """Return the problem of `random SEED` or of a print on `dual-gantry`."""
    word, _, seed = name.partition(" ")
    if word == "random":
        return problem_of(int(seed))
    path = print_path(name)
    if not path.is_file():
        path = corpus() / "models" / "plates" / "gcode" / f"{name}.gcode.gz"
    job, _ = read_gcode(path)
    machine = load_machine("dual-gantry")
    machine = replace(machine, limits=machine.limits.under(job.limits))
    return build_team_problem(job, machine, order_rules(job, machine))


@lru_cache(maxsize=1)
def rehearsal_of(name: str, rounds: int) -> Rehearsal:
    """Return the joint plan of a print, ready to be executed."""
    problem = problem_named(name)
    heads, plans = range(len(problem.machine.heads)), {}
    if rounds and not name.startswith("random"):
        planned = plan_in_turn(problem, stopping=Stopping(iterations=rounds), seed=0)
        plans = dict(planned.plans)
    found = resolve(problem, plans, heads)
    job, machine, graph = problem.job, problem.machine, problem.graph
    plan = schedule(job, machine, graph, found.toolpaths)
    return Rehearsal(PlanDocument("", machine, job.contours, graph.pairs(), plan, {}))


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Execute one joint plan in one kind of trouble, again and again."""
    began = time.process_time()
    try:
        rehearsal = rehearsal_of(key["print"], key["rounds"])
    except InputError as error:
        return key | {"error": error.what}
    calm = rehearsal.run(random_trouble("none", rehearsal.legs, 0), by_the_clock=False)
    row = key | {
        "heads": len(rehearsal.document.machine.heads),
        "contours": len(rehearsal.document.contours),
        "planned_s": round(calm.makespan_s, 1),
    }
    for name, by_the_clock in (("ours", False), ("clock", True)):
        troubles = (
            random_trouble(key["trouble"], rehearsal.legs, seed) for seed in range(key["runs"])
        )
        made = [rehearsal.run(trouble, by_the_clock=by_the_clock) for trouble in troubles]
        row |= {f"{name}_{what}": value for what, value in figures(made, calm).items()}
    return row | {"cpu_s": round(time.process_time() - began, 1), "error": ""}


def figures(runs: list[Run], calm: Run) -> dict[str, Any]:
    """Return what is counted over some runs."""
    return {
        "collided": sum(run.contacts > 0 for run in runs),
        "contacts": sum(run.contacts for run in runs),
        "too_near": sum(run.too_near for run in runs),
        "rail_breaks": sum(run.rail_breaks for run in runs),
        "too_early": sum(run.too_early for run in runs),
        "longer": round(statistics.median(run.makespan_s for run in runs) / calm.makespan_s, 4),
    }


def keys_of(prints: list[str], runs: int, rounds: int) -> Iterator[dict[str, Any]]:
    """Yield the runs, print after print."""
    for name in prints:
        for trouble in TROUBLES:
            yield {"print": name, "trouble": trouble, "runs": runs, "rounds": rounds}


def shared_prints(count: int) -> list[str]:
    """Return machines made at random on which two heads can print."""
    found: list[str] = []
    seed = 0
    while len(found) < count:
        try:
            if problem_of(seed).space.eligible.any(axis=0).sum() > 1:
                found.append(f"random {seed}")
        except InputError:
            pass
        seed += 1
    return found


def report(rows: list[dict[str, str]], said: str) -> str:
    """Return the page."""
    text = f"# Heads that are late\n\n{said}\n\nRepeat: `python benchmarks/late_heads.py`. "
    text += "Joint plans are executed with other times than planned: each action takes a random "
    text += "multiple of its time, or 1 % of the actions begin up to a minute late, or both. "
    text += "Ours waits for what its actions come after. By the clock: the same plan without these "
    text += "waits, an action begins at its planned time or once its head is free. Collided: runs "
    text += "in which two heads touch. Contacts: pairs of their actions that do; too near: pairs "
    text += "nearer than the clearance, contacts with them; rail: pairs of heads that break its "
    text += "separation; too early: contours begun before what they rest on has been printed. "
    text += "Longer: makespan over that at planned times, median.\n\n"
    cpu = sum(float(row["cpu_s"]) for row in rows if not row["error"]) / 60.0
    text += f"{cpu:.0f} minutes of processor time.\n\n"
    head = ["prints", "trouble", "execution", "runs", "collided", "contacts", "too near", "rail",
            "too early", "longer"]  # fmt: skip
    lines = []
    for (where, trouble), group in table_groups(rows).items():
        for name, words in (("ours", "ours"), ("clock", "by the clock")):
            lines.append([where, trouble, words, *cells(group, name)])
    return text + markdown(lines, head)


def table_groups(rows: list[dict[str, str]]) -> dict[tuple[str, str], list[dict[str, str]]]:
    """Return the rows by where they were printed and trouble."""
    found: dict[tuple[str, str], list[dict[str, str]]] = {}
    for (name, trouble), group in grouped(rows, "print", "trouble").items():
        where = "small, random machines" if name.startswith("random") else "dual-gantry"
        found.setdefault((where, trouble), []).extend(group)
    return found


def cells(group: list[dict[str, str]], name: str) -> list[str]:
    """Return the figures of one line."""
    counts = ("collided", "contacts", "too_near", "rail_breaks", "too_early")
    sums = [str(sum(int(row[f"{name}_{what}"]) for row in group)) for what in counts]
    longer = statistics.median(float(row[f"{name}_longer"]) for row in group)
    return [str(sum(int(row["runs"]) for row in group)), *sums, f"{longer:.3f}"]


def main() -> None:
    """Make the runs that are missing, then the page."""
    parser = arguments(__doc__, time_limit=0.0, models=PLATES)
    parser.add_argument("--random", type=int, default=20, help="machines made at random")
    parser.add_argument("--runs", type=int, default=10, help="of each plan in each trouble")
    parser.add_argument("--rounds", type=int, default=2, help="of planning; 0: empty plans")
    options = parser.parse_args()
    rows = Rows(options.results / "late_heads.csv", KEY)
    if not options.table_only:
        prints = [*options.models, *shared_prints(options.random)]
        run_missing(rows, keys_of(prints, options.runs, options.rounds), run)
    said = setting(rounds=options.rounds, note=options.note)
    (options.results / "late_heads.md").write_text(report(rows.rows, said))


if __name__ == "__main__":
    main()
