"""Small prints for two and three heads: how often planning reaches the least makespan.

    python benchmarks/small_teams.py [--time-limit 3] [--seeds 0] [--instances 100]

Prints of 6 or 8 contours on machines made at random. The least makespan is that of all
joint orders the engine can carry out, found by brute force
(`tests.makers.small_teams`). All heads plan in one process, `--time-limit` seconds of
processor time. Makespans are the engine's estimate, ways back to the parks included.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from itertools import count, cycle, islice
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from common import Rows, arguments, grouped, markdown, median, run_missing, setting

from decmcts.search.sequence.stopping import Stopping
from decmcts.team.dec_mcts.rounds import plan_in_turn
from decmcts.team.engine.plans import encode_stated
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import resolve
from tests.makers.small_teams import Least, least_makespan, small_problem

KEY = ("machine", "heads", "towers", "layers", "seed", "limit_s")
SHAPES = ((2, 3, 1), (2, 2, 2), (2, 4, 1), (3, 3, 1), (3, 2, 2))  # heads, towers, layers
REACHED = 1e-6  # share of the least makespan
MOST = 20_000_000  # steps of brute force; more and it is given up
ASKED = 95  # of a hundred


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Plan one print, and look for anything better."""
    problem = small_problem(*(key[name] for name in ("machine", "heads", "towers", "layers")))
    if problem is None:
        return key | {"error": "no such print"}
    heads = range(key["heads"])
    began = time.process_time()
    rounds = [0]
    ours = plan_in_turn(
        problem,
        stopping=Stopping(key["limit_s"]),
        seed=key["seed"],
        clock=time.process_time,
        progress=lambda done, _: rounds.append(done),
    )
    planned = time.process_time()
    least = least_makespan(problem, ours.makespan_s, MOST)
    return key | {
        "kind": problem.machine.name.partition("(")[2].rstrip(")"),
        "contours": len(problem.macro),
        "first_s": round(resolve(problem, {}, heads).makespan_s, 4),
        "ours_s": round(ours.makespan_s, 4),
        "least_s": round(confirmed(problem, least), 4),
        "over_least": round(ours.makespan_s / least.makespan_s, 6),
        "reached": int(ours.makespan_s <= least.makespan_s * (1.0 + REACHED)),
        "complete": int(least.complete),
        "rounds": rounds[-1],
        "tried": least.tried,
        "planned_s": round(planned - began, 1),
        "cpu_s": round(time.process_time() - began, 1),
        "error": "",
    }


def confirmed(problem: TeamProblem, least: Least) -> float:
    """Return the least makespan, which the engine makes of the order found too."""
    if least.stated is not None:
        heads = len(problem.machine.heads)
        plan = encode_stated(least.stated, heads, problem.n_macros)
        again = resolve(problem, {0: plan}, range(heads)).makespan_s
        if not np.isclose(again, least.makespan_s, rtol=REACHED):
            raise AssertionError(f"brute force says {least.makespan_s}, the engine {again}")
    return least.makespan_s


def keys_of(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the runs, a print of each shape in turn."""
    machines = {shape: prints_of(shape) for shape in SHAPES}
    for shape in islice(cycle(SHAPES), options.instances):
        machine = next(machines[shape])
        for seed in options.seeds:
            yield dict(zip(KEY, (machine, *shape, seed, options.time_limit), strict=True))


def prints_of(shape: tuple[int, int, int]) -> Iterator[int]:
    """Yield the seeds of machines with such a print."""
    return (seed for seed in count() if small_problem(seed, *shape) is not None)


def report(rows: Rows, options: argparse.Namespace) -> str:
    """Return the page."""
    mine = [r for r in rows.rows if float(r["limit_s"]) == options.time_limit and not r["error"]]
    there = " ".join(sorted({r["seed"] for r in mine}))
    said = setting(
        note=options.note, processor_time=f"{options.time_limit:g} s a search", seeds=there
    )
    text = f"# Small prints against brute force\n\n{said}\n\n"
    text += f"Repeat: `python benchmarks/small_teams.py --time-limit {options.time_limit:g} "
    text += f"--seeds {there.replace(' ', ',')}`. Towers of a loop and a stroke on machines made "
    text += "at random. *Least*: of every joint order the engine can carry out. *First*: the joint "
    text += "order the heads begin with, over the least. *Reached*: within a millionth. *Not "
    text += "proven*: brute force was given up, and what it found counts as the least.\n\n"
    reached, cpu = sum(int(r["reached"]) for r in mine), sum(float(r["cpu_s"]) for r in mine)
    text += f"**Reached in {reached} of {len(mine)} runs** (asked: {ASKED} %); "
    text += f"{cpu / 60.0:.0f} minutes of processor time.\n\n"
    head = ["heads", "contours", "layers", "runs", "reached", "not proven", "first ÷ least",
            "ours ÷ least, where not reached", "most", "rounds", "joint orders tried"]  # fmt: skip
    groups = grouped(mine, "heads", "contours", "layers").items()
    return text + markdown([line(key, group) for key, group in groups], head) + rows.failures()


def line(key: tuple[str, ...], group: list[dict[str, str]]) -> list[str]:
    """Return one line of the table."""
    missed = [r for r in group if r["reached"] == "0"]
    first = np.median([float(r["first_s"]) / float(r["least_s"]) for r in group])
    return [
        *key,
        str(len(group)),
        str(len(group) - len(missed)),
        str(sum(r["complete"] == "0" for r in group)),
        f"{first:.3f}",
        f"{median(missed, 'over_least'):.3f}" if missed else "",
        f"{max(float(r['over_least']) for r in group):.3f}",
        f"{median(group, 'rounds'):.0f}",
        f"{median(group, 'tried'):.0f}",
    ]


def main() -> None:
    """Make the runs that are missing, then the page."""
    parser = arguments(__doc__, time_limit=3.0, models="")
    parser.add_argument("--instances", type=int, default=100, help="prints, over all shapes")
    options = parser.parse_args()
    rows = Rows(options.results / "small_teams.csv", KEY)
    if not options.table_only:
        run_missing(rows, keys_of(options), run)
    (options.results / "small_teams.md").write_text(report(rows, options))


if __name__ == "__main__":
    main()
