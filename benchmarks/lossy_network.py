"""Teams on a network in memory that loses, delays, repeats and reorders what they say.

    python benchmarks/lossy_network.py [--seeds 0,1,…] [--planners toy,unequal,team]

Every seed is a team of 2 to 8 heads with delays up to a bound of at most 2 s (they
differ from message to message, so order changes) and up to half of all messages
repeated; each is run in silence (no loss, no delay) and at every loss. Planners:
`toy` is the small problem of the tests, 40 jobs; `unequal` is the same on hosts one
of which resolves plans differently; `team` is the project's own on a small print
for two heads, judged by `sim`. Clock and network are simulated, so a run repeats
bit for bit. A run is valid if all heads released one plan and that plan is one.
"""

from __future__ import annotations

import sys
import tempfile
import time
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from common import Rows, arguments, grouped, markdown, median, names, run_missing, setting, spread

from agents.agreeing.events import Release
from agents.networks.memory import Weather
from agents.planners.serial import joint_order
from agents.planners.source import load_source
from agents.planners.team_planner import TeamPlanner
from decmcts.print.plan import PlanDocument
from decmcts.team.engine.problem import TeamProblem, build_team_problem
from decmcts.team.schedule.joint_plan import schedule
from sim.experiments.made_print import made_gcode
from sim.experiments.memory_team import MemoryTeam
from sim.verify import verify_plan
from tests.agents.simulation import Team
from tests.agents.toy import load_balance

KEY = ("planner", "loss", "seed")
QUIET = "quiet"
LOSSES = (QUIET, *(str(round(0.1 * k, 1)) for k in range(10)))
PATIENCE_S = 600.0
PLANNING_S = {"toy": 1.0, "unequal": 1.0, "team": 0.1}  # simulated; a round takes 0.02
SEEDS = {"toy": 100, "unequal": 10, "team": 10}
JOBS = 40


def weather_of(loss: str, seed: int) -> Weather:
    """Return the weather of a seed: its delays and repetitions are the same at every loss."""
    rng = np.random.default_rng([seed, 7])
    slowest, duplicate = float(rng.uniform(0.0, 2.0)), float(rng.uniform(0.0, 0.5))
    if loss == QUIET:
        return Weather()
    return Weather(loss=float(loss), delay_s=(0.0, slowest), duplicate=duplicate)


def heads_of(planner: str, seed: int) -> int:
    """Return how many heads the team of a seed has."""
    return 2 if planner == "team" else 2 + seed % 7


@lru_cache(maxsize=4)
def problem_of(seed: int) -> TeamProblem:
    """Return a small print for the two heads of `dual-gantry`: three towers and a skirt."""
    x = np.random.default_rng(seed).permutation(np.arange(100.0, 251.0, 30.0))[:3]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "towers.gcode")
        path.write_text(made_gcode([(float(at), 100.0) for at in x]))
        pack = load_source(path, "dual-gantry", "keep")
    return build_team_problem(pack.job, pack.machine, pack.graph, start=pack.start)


def team_of(planner: str, loss: str, seed: int) -> MemoryTeam:
    """Return the team of a run."""
    heads, weather = heads_of(planner, seed), weather_of(loss, seed)
    limit_s = PLANNING_S[planner]
    if planner == "team":
        return MemoryTeam(
            heads, weather, lambda head: TeamPlanner(problem_of(seed), head, seed=seed),
            seed=seed, limit_s=limit_s,
        )  # fmt: skip
    quirks = {heads - 1: "another host"} if planner == "unequal" else {}
    return Team(heads, weather, seed=seed, limit_s=limit_s, quirks=quirks)


def fault_of(planner: str, release: Release, seed: int) -> str:
    """Return what is wrong with a released plan, nothing for a valid one."""
    if planner == "team":
        problem = problem_of(seed)
        order = joint_order(problem, release.plans, release.live)
        if (order.digest, order.makespan_s) != (release.digest, release.makespan_s):
            return "resolves differently"
        graph = problem.graph
        plan = schedule(problem.job, problem.machine, graph, list(order.toolpaths))
        contours = problem.job.contours
        document = PlanDocument(problem.digest, problem.machine, contours, graph.pairs(), plan, {})
        verdict = verify_plan(document, source=problem.job, seed=seed)
        return "" if verdict.ok else str(verdict.faults[0])
    if planner == "unequal":
        (stated,) = release.plans.values()
        return "" if sorted(stated.tolist()) == list(range(JOBS + 1)) else "not every job once"
    done = np.sort(np.concatenate(list(release.plans.values())))
    lengths = np.random.default_rng(JOBS).uniform(1.0, 9.0, JOBS)
    makespan = load_balance(lengths, release.plans, release.live)[1]
    return (
        "" if done.tolist() == list(range(JOBS)) and makespan == release.makespan_s else "no plan"
    )


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Let one team agree and judge what it released."""
    planner, loss, seed = key["planner"], key["loss"], key["seed"]
    began = time.process_time()
    team = team_of(planner, loss, seed)
    heads = len(team.agents)
    while len(team.releases()) < heads and team.network.now < PATIENCE_S:
        team.run(0.1)
    releases = list(team.releases().values())
    fault = "" if len(releases) == heads else f"{len(releases)} of {heads} released"
    if len({release.digest for release in releases}) > 1:
        fault = "two plans released"
    traffic = [agent.traffic for agent in team.agents.values()]
    return key | {
        "heads": heads,
        "fault": fault or fault_of(planner, releases[0], seed),
        "serial": int(planner != "team" and len(releases[0].plans) == 1) if releases else "",
        "released_s": round(team.network.now, 2),
        "makespan_s": releases[0].makespan_s if releases else "",
        "messages": round(sum(sum(t.sent.values()) for t in traffic) / heads),
        "bytes": round(sum(sum(t.sent_bytes.values()) for t in traffic) / heads),
        "cpu_s": round(time.process_time() - began, 2),
        "error": "",
    }


def report(rows: list[dict[str, str]], said: str) -> str:
    """Return the page."""
    runs = [r for r in rows if r["loss"] != QUIET]
    faults = [r for r in runs if r["fault"]]
    text = f"# A network that loses, delays and repeats\n\n{said}\n\n"
    text += "Repeat: `python benchmarks/lossy_network.py`. Teams of 2 to 8 heads (`team`: 2) in "
    text += "memory, their clock simulated. Each seed has delays up to a bound of its own of at "
    text += "most 2 s, and up to half of all messages twice. `toy`: 40 jobs; `unequal`: one host "
    text += "resolves plans differently, so a serial order is agreed on; `team`: this project's "
    text += "planner on a small print, its plans judged by `sim`. Valid: every head released the "
    text += "same plan, and that plan holds. Makespan: over that of the same seed on a network "
    text += "that loses, delays and repeats nothing. Later: how many simulated seconds after "
    text += "that same run the last head released. Messages: sent by one agent in all.\n\n"
    text += f"{len(runs)} runs, {len(faults)} not valid; {cpu_minutes(rows):.0f} minutes of "
    text += "processor time.\n\n"
    head = ["planner", "loss", "runs", "valid", "makespan ÷ no loss, median", "worst",
            "later by s, median (quartiles)", "worst s", "messages", "KiB"]  # fmt: skip
    text += markdown([line(rows, key, group) for key, group in by_loss(runs)], head)
    return text + "".join(
        f"- {r['planner']} {r['loss']} {r['seed']}: {r['fault']}\n" for r in faults
    )


def cpu_minutes(rows: list[dict[str, str]]) -> float:
    """Return the processor time of all runs."""
    return sum(float(r["cpu_s"]) for r in rows) / 60.0


def by_loss(rows: list[dict[str, str]]) -> list[tuple[tuple[str, ...], list[dict[str, str]]]]:
    """Return the runs by planner and loss, ascending."""
    return sorted(grouped(rows, "planner", "loss").items())


def line(
    rows: list[dict[str, str]], key: tuple[str, ...], group: list[dict[str, str]]
) -> list[str]:
    """Return one line of the table."""
    quiet = {(r["planner"], r["seed"]): r for r in rows if r["loss"] == QUIET}
    fine = [r for r in group if not r["fault"] and (r["planner"], r["seed"]) in quiet]
    calm = [quiet[r["planner"], r["seed"]] for r in fine]
    pairs = list(zip(fine, calm, strict=True))
    ratio = [float(a["makespan_s"]) / float(b["makespan_s"]) for a, b in pairs]
    late = [float(a["released_s"]) - float(b["released_s"]) for a, b in pairs]
    planner, loss = key
    return [planner, f"{100 * float(loss):.0f} %", str(len(group)), str(len(fine)),
            spread(ratio, 3), f"{max(ratio, default=0.0):.3f}",
            spread(late), f"{max(late, default=0.0):.1f}",
            f"{median(group, 'messages'):.0f}", f"{median(group, 'bytes') / 1024:.0f}"]  # fmt: skip


def main() -> None:
    """Make the runs that are missing, then the page."""
    parser = arguments(__doc__, time_limit=0.0, models="")
    parser.add_argument("--planners", type=names, default=list(SEEDS), help="NAME,NAME,…")
    options = parser.parse_args()
    rows = Rows(options.results / "lossy_network.csv", KEY)
    if not options.table_only:
        for planner in options.planners:
            seeds = options.seeds if options.seeds != [0] else range(SEEDS[planner])
            keys = [
                {"planner": planner, "loss": loss, "seed": seed}
                for seed in seeds
                for loss in LOSSES
            ]
            run_missing(rows, keys, run)
    said = setting(note=options.note)
    (options.results / "lossy_network.md").write_text(report(rows.rows, said))


if __name__ == "__main__":
    main()
