"""How planning by several heads grows with contours and heads.

    python benchmarks/team_growth.py --parts cost
    python benchmarks/team_growth.py --parts search [--time-limit 120] [--reference 600]

Prints are the first contours of `wide`, 1200 mm of all the corpus' plates (`team_prints.py`);
heads stand on one rail. *Cost*: what one agent needs to build the problem, for a joint order
of default plans, for a round, and its memory and messages (`agent_cost.py`). *Search*: all
heads plan in turn in one process for `--reference` seconds of processor time a head, and with
other seeds for `--time-limit`: after how long are these within 2 % of the former's result?
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from common import (
    Rows,
    arguments,
    grouped,
    markdown,
    names,
    own_process,
    run_missing,
    seeds,
    setting,
)
from team_prints import job_named, machine_named

from agents.planners.pack import Pack, write_pack
from decmcts.feasibility.rules import order_rules
from decmcts.planning.problem.print_problem import parked_above

KEY = ("part", "print", "contours", "heads", "seed", "seconds")
CONTOURS = (1000, 2000, 5000, 10000, 20000, 40000)
HEADS = (1, 2, 4, 8)
REFERENCE_SEED = 1000  # another than that of any run held against it
WITHIN = 1.02
COSTS = {
    "build_s": "build",
    "order_s": "joint order",
    "round_s": "round",
    "schedule_s": "exact plan",
}
Line = dict[str, str]


def keys_of(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the runs: what agents cost, then the reference and the runs held against it."""
    runs = [("cost", 0, 0.0)] if "cost" in options.parts else []
    if "search" in options.parts:
        runs += [("search", REFERENCE_SEED, options.reference)]
        runs += [("search", seed, options.time_limit) for seed in options.seeds]
    for part, seed, seconds in runs:
        for print_ in options.models:
            for contours in options.contours:
                for heads in options.heads:
                    key = (part, print_, contours, heads, seed, seconds)
                    yield dict(zip(KEY, key, strict=True))


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Hand the print to a process of its own, as a launcher does, and return its figures."""
    job, heads = job_named(f"{key['print']}:{key['contours']}"), key["heads"]
    machine = machine_named(key["print"], heads)
    machine = replace(machine, limits=machine.limits.under(job.limits))
    machine = parked_above(machine, job.contours)
    graph = order_rules(job, machine)
    with tempfile.TemporaryDirectory() as folder:
        write_pack(Pack(job, machine, graph), Path(folder))
        asked = json.dumps({**key, "folder": folder})
        worker = str(Path(__file__).with_name("agent_cost.py"))
        done = own_process([sys.executable, worker, asked], timeout_s=7200.0 * heads)
    row = {"error": "", **key, "edges": graph.n_edges, **done}
    del row["wall_s"], row["exit"], row["peak_mib"]
    return row


def exponent(of: Sequence[float], values: Sequence[float]) -> str:
    """Return e of values ~ of^e, by least squares of logarithms; nothing for a single one."""
    if len(set(of)) < 2:
        return ""
    return f"{np.polyfit(np.log(np.asarray(of)), np.log(np.asarray(values)), 1)[0]:.2f}"


def n_log_n(contours: Sequence[float]) -> list[float]:
    """Return n log n of numbers of contours."""
    return [n * math.log(n) for n in contours]


def column(rows: Sequence[Line], name: str) -> list[float]:
    """Return a column as numbers."""
    return [float(row[name]) for row in rows]


def of_contours(rows: list[Line]) -> str:
    """Return how each figure grows with n log n, a line a number of heads."""
    lines = []
    for (heads,), mine in grouped(rows, "heads").items():
        n = n_log_n(column(mine, "contours"))
        fits = [exponent(n, column(mine, name)) for name in (*COSTS, "agent_mib")]
        lines.append([heads, *fits])
    return markdown(lines, ["heads", *COSTS.values(), "memory"])


def of_heads(rows: list[Line]) -> str:
    """Return how each figure grows with heads from two up, a line a number of contours."""
    lines = []
    for (contours,), mine in grouped([r for r in rows if r["heads"] != "1"], "contours").items():
        heads = column(mine, "heads")
        fits = [exponent(heads, column(mine, name)) for name in (*COSTS, "bytes_per_s")]
        lines.append([contours, *fits])
    return markdown(lines, ["contours", *COSTS.values(), "bytes a second"])


def costs(rows: list[Line]) -> str:
    """Return what one agent costs, a line a run."""
    lines = [
        [r["heads"], r["contours"], r["edges"], f"{float(r['build_s']):.2f}",
         f"{1 / float(r['order_s']):.1f}", f"{float(r['round_s']):.1f}",
         f"{float(r['schedule_s']):.2f}", r["agent_mib"], r["distribution_bytes"],
         r["joint_bytes"], r["bytes_per_s"]]
        for r in rows
    ]  # fmt: skip
    head = ["heads", "contours", "edges", "build s", "joint orders/s", "round s", "exact plan s",
            "MiB", "distribution B", "joint B", "B/s at most"]  # fmt: skip
    return markdown(lines, head)


def within(row: Line, reference_s: float) -> float | None:
    """Return after how many seconds a head a run was within 2 % of a makespan; None: never."""
    history = json.loads(row["history"])
    return next((at for at, makespan in history if makespan <= WITHIN * reference_s), None)


def searches(rows: list[Line], options: argparse.Namespace) -> str:
    """Return after how long searches are within 2 % of the reference's result."""
    lines = []
    for (heads, contours), mine in grouped(rows, "heads", "contours").items():
        (reference, *_), runs = split_reference(mine, options)
        if not reference:
            continue
        last = json.loads(reference["history"])[-1][1]
        own = within(reference, last)
        reached = [at for r in runs if (at := within(r, last)) is not None]
        ends = [json.loads(r["history"])[-1][1] / last for r in runs]
        over = float(reference["over_bound"])
        lines.append([heads, contours, f"{last:.0f}", f"{over:.3f}", f"{own:.1f}",
                      f"{len(reached)} of {len(runs)}",
                      f"{statistics.median(reached):.1f}" if reached else "",
                      f"{statistics.median(ends):.3f}" if ends else "",
                      str(sum(int(r["faults"]) for r in mine))])  # fmt: skip
    head = ["heads", "contours", "reference, s of print", "÷ bound", "it was within 2 % after s",
            "others reached it", "after s, median", "their last ÷ reference", "faults"]  # fmt: skip
    return markdown(lines, head)


def split_reference(
    rows: list[Line], options: argparse.Namespace
) -> tuple[list[Line | None], list[Line]]:
    """Return the reference run, or None, and the runs held against it."""
    asked = [r for r in rows if r["seed"] == str(REFERENCE_SEED)]
    asked = [r for r in asked if float(r["seconds"]) == options.reference]
    others = [r for r in rows if r["seed"] != str(REFERENCE_SEED)]
    others = [r for r in others if float(r["seconds"]) == options.time_limit]
    return [*asked, None], others


def plot(rows: list[Line], path: Path) -> None:
    """Draw seconds of a joint order, joint orders a second, and memory against contours."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(15, 4.6), layout="constrained")
    for k, ((heads,), mine) in enumerate(grouped(rows, "heads").items()):
        n, seconds = np.asarray(column(mine, "contours")), np.asarray(column(mine, "order_s"))
        label, color = f"{heads} head{'s' if heads != '1' else ''}", f"C{k}"
        axes[0].loglog(n, seconds, "o-", color=color, label=label)
        if len(mine) > 1:  # of one print there is no growth to compare with
            growth = np.asarray(n_log_n(column(mine, "contours")))
            axes[0].loglog(n, seconds[0] * growth / growth[0], "--", color=color, alpha=0.4)
        axes[1].loglog(n, 1 / seconds, "o-", color=color, label=label)
        axes[2].semilogx(n, column(mine, "agent_mib"), "o-", color=color, label=label)
    axes[0].set(ylabel="processor seconds a joint order; dashed: n log n")
    axes[1].set(ylabel="joint orders a second")
    axes[2].set(ylabel="peak memory of an agent, MiB", ylim=(0, None))
    for axis in axes:
        axis.set_xlabel("contours")
        axis.grid(alpha=0.3, which="both")
        axis.legend()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def report(rows: Rows, options: argparse.Namespace) -> str:
    """Return the page."""
    cost = ordered(rows, "cost")
    text = f"# Growth with contours and heads\n\n{setting(note=options.note, quality='none')}\n\n"
    text += "Repeat: `python benchmarks/team_growth.py --parts cost`. Prints: the first contours "
    text += f"of {' '.join(dict.fromkeys(r['print'] for r in rows.rows))}, heads in a row on one "
    text += "rail. Processor seconds, each run a process of its own that is handed the print as a "
    text += "launcher hands it to an agent. *Build*: the problem. *Joint orders/s*: one over the "
    text += "median time in which default plans of eight policies resolve. *Round*: tree, updates "
    text += "and polishing, no policies to try. *Exact plan*: safe travels and times, once at the "
    text += "end. *Distribution*, *joint*: bytes of these messages after two rounds. *B/s at "
    text += "most*: what an agent that does such rounds sends, heartbeats included; a head alone "
    text += "sends nothing, and searches one order in rounds of another kind.\n\n"
    text += "![growth](team_growth.png)\n\n" + costs(cost)
    text += "\n## Exponents\n\nOf n log n, n the number of contours, by least squares (wanted: at "
    text += f"most 1):\n\n{of_contours(cost)}\nOf the number of heads, two and up (wanted: at most "
    text += f"1):\n\n{of_heads(cost)}"
    return text + of_search(ordered(rows, "search"), options) + rows.failures()


def of_search(rows: list[Line], options: argparse.Namespace) -> str:
    """Return the section on searches, nothing where there are none."""
    if not rows:
        return ""
    limits = f"--time-limit {options.time_limit:g} --reference {options.reference:g}"
    there = {name: ",".join(dict.fromkeys(r[name] for r in rows)) for name in KEY}
    seeds_ = sorted({r["seed"] for r in rows} - {str(REFERENCE_SEED)})
    limits += f" --seeds {','.join(seeds_)}" if seeds_ else ""
    text = "\n## Seconds to within 2 %\n\nRepeat: `python benchmarks/team_growth.py --parts search "
    text += f"{limits} --heads {there['heads']} --contours {there['contours']}`. Processor seconds "
    text += "a head; all heads plan in turn in one process. Reference: the makespan after "
    text += (
        f"{options.reference:g} s a head with a seed of its own; others: {options.time_limit:g} "
    )
    text += "s a head. *Faults*: of the exact plans, by the judge.\n\n"
    return text + searches(rows, options)


def ordered(rows: Rows, part: str) -> list[Line]:
    """Return the rows of one part without errors, by heads and contours."""
    mine = [r for r in rows.rows if r["part"] == part and not r["error"]]
    return sorted(mine, key=lambda r: (int(r["heads"]), int(r["contours"])))


def main() -> None:
    parser = arguments(__doc__, time_limit=120.0, models="wide")
    parser.add_argument("--reference", type=float, default=600.0, help="seconds a head")
    parser.add_argument("--heads", type=seeds, default=list(HEADS), help="N,N,…")
    parser.add_argument("--contours", type=seeds, default=list(CONTOURS), help="N,N,…")
    parser.add_argument("--parts", type=names, default=["cost", "search"], help="cost, search")
    options = parser.parse_args()
    rows = Rows(options.results / "team_growth.csv", KEY)
    if not options.table_only:
        run_missing(rows, keys_of(options), run)
    rows.read()
    (options.results / "team_growth.md").write_text(report(rows, options))
    if cost := ordered(rows, "cost"):
        plot(cost, options.results / "team_growth.png")


if __name__ == "__main__":
    main()
