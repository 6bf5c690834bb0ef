"""Two heads on eight large plates, or other prints: makespan against one head and the bound.

    python benchmarks/two_heads.py [--time-limit 60] [--seeds 0,1,2] [--plates a,b]
    python benchmarks/two_heads.py --machine dueling-zero   # prints that fit on its bed
    python benchmarks/two_heads.py --plates four_nuts,…   # also single parts of the corpus

Real processes over real zenoh sessions. Every plan is verified for every timing
its order allows, and replayed with timing errors of 0.5x to 2x on each action.
Writes docs/results/two_heads.csv (resumable) and two_heads.md.
"""

from __future__ import annotations

import argparse
import gzip
import re
import statistics
import tempfile
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from common import (
    RESULTS,
    Rows,
    grouped,
    markdown,
    measured,
    median,
    names,
    seeds,
    setting,
    spread,
)
from team_prints import PLATES, plate_path

from decmcts.feasibility.rules import order_rules
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.formats.plans.plan_json import read_plan
from decmcts.print.contours import taken
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.plan import PlanDocument
from decmcts.search.planners import plan_order
from decmcts.search.sequence.problem import OrderProblem
from decmcts.search.sequence.stopping import Stopping
from decmcts.team.bounds.makespan import makespan_bound
from decmcts.team.engine.alone import lone_machine
from decmcts.team.schedule.joint_plan import schedule
from decmcts.team.schedule.metrics import head_toolpath

FITTING = ("gf_chess_plate_6", "hourglass_chess_6", "koch_brackets_4", "moveo_covers_4",
         "nishapur_chess_16", "playblock_chess_16", "strong_brackets_8",
         "trashcan_chess_8")  # fmt: skip
USUAL = {"dueling-zero": FITTING}  # prints of a machine; of others the plates
LONE_S = 20.0  # for the busiest head's contours alone
KEY = ("machine", "plate", "limit_s", "seed")


def placed(path: Path, name: str, folder: Path) -> Path:
    """Return a print as it is, or moved to the middle of the bed of a machine that is smaller.

    Moved by its text: all X and Y of absolute moves.
    """
    job, machine = loaded(path, name)
    low, high = job.contours.points[:, :2].min(axis=0), job.contours.points[:, :2].max(axis=0)
    bed = np.array([machine.bed_min, machine.bed_max])
    if (low >= bed[0]).all() and (high <= bed[1]).all():
        return path
    by = dict(zip("XY", (bed.sum(axis=0) - low - high) / 2, strict=True))

    def moved(word: re.Match[str]) -> str:
        return f"{word[1]}{float(word[2]) + by[word[1]]:.3f}"

    with gzip.open(path, "rt") as file:
        lines = [re.sub(r"\b([XY])(-?[\d.]+)", moved, line) if line.startswith(("G0 ", "G1 "))
                 else line for line in file]  # fmt: skip
    target = folder / path.name
    with gzip.open(target, "wt") as file:
        file.writelines(lines)
    return target


def run(path: Path, key: dict[str, Any], trials: int) -> dict[str, Any]:
    """Plan for two heads, each a process, and replay the joint plan."""
    limit = ["--time-limit", str(key["limit_s"]), "--seed", str(key["seed"])]
    machine = ["--machine", key["machine"]]
    with tempfile.TemporaryDirectory() as folder:
        plan = f"{folder}/plan.json.gz"
        two = measured(["launch", str(path), *machine, *limit, "--no-quality", "--plan", plan])
        if two["exit"]:
            return {**key, **dict.fromkeys(FIGURES, ""), "error": two["error"]}
        replay = measured(["verify", plan, "--source", str(path), "--trials", str(trials)])
        return {**key, **figures_of(path, key, plan, two, replay)}


def figures_of(
    path: Path, key: dict[str, Any], plan: str, two: dict[str, Any], replay: dict[str, Any]
) -> dict[str, Any]:
    after, machine = two["after"], key["machine"]
    alone, bound = after["one_head_s"], after["bound"]
    agents = after["agents"]
    prints, travels = after["printing_s_per_head"], after["travelling_s_per_head"]
    busiest = max(range(len(prints)), key=lambda r: prints[r] + travels[r])
    lone_s = time_alone(path, machine, read_plan(plan), busiest, key["seed"])
    return {
        "contours": after["contours"],
        "one_head_s": alone,
        "two_heads_s": after["makespan_s"],
        "speedup": round(alone / after["makespan_s"], 3),
        "bound_s": round(bound["bound_s"], 1),
        "over_bound": round(after["makespan_s"] / bound["bound_s"], 3),
        "whole_s": round(whole_bound(path, machine), 1),
        "over_whole": round(after["makespan_s"] / whole_bound(path, machine), 3),
        "prints_s": round(prints[busiest], 1),
        "travels_s": round(travels[busiest], 1),
        "lone_s": round(lone_s, 1),
        "messages": sum(agent["sent"] for agent in agents),
        "bytes": sum(agent["sent_bytes"] for agent in agents),
        "planner": after["planner"],
        "faults": len(replay.get("faults", [replay.get("error", "?")])),
        "plan_s": round(two["wall_s"], 1),
        "peak_mib": round(two["peak_mib"]),
        "error": "",
    }


def time_alone(path: Path, name: str, made: PlanDocument, busiest: int, seed: int) -> float:
    """Return how long a head takes for its contours, or pieces, with nobody else there.

    In the best order `hybrid` finds in LONE_S, none of the other heads' contours to wait for.
    """
    job, machine = loaded(path, name)
    rows = np.sort(head_toolpath(made.plan.heads[busiest]).order).astype(np.int64)
    part = replace(job, contours=taken(made.contours, rows), acceleration=None)
    lone = lone_machine(machine)
    graph = order_rules(part, lone)
    order = plan_order(
        OrderProblem.from_job(part, graph, "reversible"), planner="hybrid",
        stopping=Stopping(seconds=LONE_S), seed=seed,
    )  # fmt: skip
    return schedule(part, lone, graph, [order.toolpath]).makespan_s


@cache
def loaded(path: Path, name: str) -> tuple[PrintJob, Machine]:
    """Return a print and a machine with the limits that hold for both."""
    job, _ = read_gcode(path)
    machine = load_machine(name)
    return job, replace(machine, limits=machine.limits.under(job.limits))


@cache
def whole_bound(path: Path, name: str) -> float:
    """Return the bound for heads that hold a contour's whole room, without travel: W - M."""
    job, machine = loaded(path, name)
    machine = replace(machine, release="action")
    return makespan_bound(job, machine, order_rules(job, machine), travel=False).bound_s


FIGURES = ("contours", "one_head_s", "two_heads_s", "speedup", "bound_s", "over_bound",
           "whole_s", "over_whole", "prints_s", "travels_s", "lone_s", "messages", "bytes",
           "planner", "faults", "plan_s", "peak_mib", "error")  # fmt: skip


def of_prints(rows: list[dict[str, str]]) -> str:
    """Return a line for each print: medians and least and most over its seeds."""
    lines = []
    for (plate,), mine in grouped(rows, "plate").items():
        over = [float(r["over_whole"]) for r in mine]
        lines.append(
            [
                plate,
                mine[0]["contours"],
                str(len(mine)),
                f"{median(mine, 'one_head_s'):.0f}",
                f"{median(mine, 'two_heads_s'):.0f}",
                f"{median(mine, 'speedup'):.2f}×",
                f"{median(mine, 'bound_s'):.0f}",
                f"{median(mine, 'over_bound'):.3f}",
                f"{median(mine, 'whole_s'):.0f}",
                f"{median(mine, 'over_whole'):.3f} ({min(over):.3f} to {max(over):.3f})",
                quotient(mine, "prints_s", "two_heads_s"),
                quotient(mine, "travels_s", "two_heads_s"),
                quotient(mine, "lone_s", "whole_s"),
                f"{median(mine, 'messages'):.0f}",
                f"{median(mine, 'bytes') / 1024:.0f}",
                str(sum(int(r["faults"]) for r in mine)),
                f"{median(mine, 'plan_s'):.0f}",
            ]
        )
    head = ["print", "contours", "seeds", "one head s", "two heads s", "speed-up", "bound s",
            "makespan ÷ bound", "W−M s", "makespan ÷ (W−M)", "busiest prints", "travels",
            "busiest alone ÷ (W−M)", "messages", "KiB", "faults in replay", "wall s"]  # fmt: skip
    return markdown(lines, head)


def quotient(rows: list[dict[str, str]], above: str, below: str) -> str:
    """Return the median of one field over another, of rows that have both."""
    found = [float(r[above]) / float(r[below]) for r in rows if r[above]]
    return f"{statistics.median(found):.3f}" if found else ""


def report(rows: Rows, said: str) -> str:
    """Return the page: a table for each machine, plates and other prints apart."""
    text = f"# Two heads on large plates\n\n{said}\n\nRepeat: `python benchmarks/two_heads.py`. "
    text += "One head: the best order `local` finds in a third of the time (at most 10 s), for one "
    text += "such head that reaches everything, alone on the machine. Bound: proven for heads that "
    text += "give room back piece by piece, as here, with what they travel at least. W−M: the "
    text += "bound for heads that hold a contour's whole room to its end, without travel; heads as "
    text += "here may beat it. Busiest: the head that prints and travels longest, and what part "
    text += "of the makespan that is; alone: what it takes for its contours in the best order "
    text += f"`hybrid` finds in {LONE_S:g} s, with nobody to wait for. Messages and bytes: sent by "
    text += "both agents. Medians over seeds; in brackets least and most.\n"
    done = [r | {"of": kind_of(r["plate"])} for r in rows.rows]
    for (machine, of), mine in grouped(done, "machine", "of").items():
        text += f"\n## `{machine}`, {of}\n\nMedian of the prints: makespan "
        text += f"{of_all(mine, 'over_bound')} times the bound, {of_all(mine, 'over_whole')} times "
        text += f"W−M, {of_all(mine, 'speedup')} times as fast as one head.\n\n{of_prints(mine)}"
    return text + rows.failures()


def kind_of(print_name: str) -> str:
    """Return under which heading a print is listed."""
    if print_name in PLATES:
        return "plates"
    return "several parts that fit" if print_name in FITTING else "single parts"


def of_all(rows: list[dict[str, str]], field: str) -> str:
    """Return the median over prints of the medians over their seeds, with quartiles."""
    return spread([median(mine, field) for mine in grouped(rows, "plate").values()], 2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--trials", type=int, default=5)
    parser.add_argument("--machine", default="dual-gantry")
    parser.add_argument("--plates", type=names, help="NAME,NAME,…")
    parser.add_argument("--seeds", type=seeds, default=[0], help="SEED,SEED,…")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    rows = Rows(RESULTS / "two_heads.csv", KEY)
    plates = options.plates or USUAL.get(options.machine, PLATES)
    with tempfile.TemporaryDirectory() as folder:
        for seed, plate in product(options.seeds, plates):
            values = (options.machine, plate, options.time_limit, seed)
            key = dict(zip(KEY, values, strict=True))
            if not rows.has(**key):
                path = placed(plate_path(plate), options.machine, Path(folder))
                rows.append(run(path, key, options.trials))
                print(rows.rows[-1], flush=True)
    said = setting(note=options.note, quality="none", time_limit=f"{options.time_limit:g} s",
                   timing_trials=options.trials)  # fmt: skip
    (RESULTS / "two_heads.md").write_text(report(rows, said))


if __name__ == "__main__":
    main()
