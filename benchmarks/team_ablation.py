"""What each part of the search for several heads brings: one left out or changed at a time.

    python benchmarks/team_ablation.py [--time-limit 20] [--seeds 0,1,2] [--models mix_2,…]

All heads plan in turn in one process, so that every variant gets the same processor time
(`--time-limit`). All begin with the order that `launch` begins with, a sweep; NAME@CUT has its
contours cut for it (`team_prints.py`). *no tree*: plans come from policies and exchanges on the
best joint plan. *no messages*: no head learns what another plans; the best of theirs counts.
*q frozen*: the distributions over plans stay uniform. *windows alone*: neither tree nor
distributions nor joint plans. *one tree*: one central Monte Carlo tree over joint plans, of the
same moves, in place of a tree and a distribution a head, and the same windows. *no windows*:
joint orders are neither recreated nor polished; *one tree alone*: nor with one tree.
*annealing*: of one joint order (`decmcts/experiments/baselines/annealing.py`). *no recreation*:
orders are polished alone. *no piecewise release*: a head holds the reserved space of a contour to
its end.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
from collections.abc import Iterator
from typing import Any

from common import (
    Rows,
    arguments,
    grouped,
    markdown,
    names,
    run_missing,
    setting,
    spread,
)
from team_run import VARIANTS, in_own_process

KEY = ("plate", "heads", "method", "seed", "cpu_s")
HEADS = 2
ALL = VARIANTS[0]
PRINTS = "gf_baseplate@all,openbot_top_A@inside,slab@all,mix_2,mix_6"
STEPS = 8  # of the time, for which the entropy is told
Rounds = list[tuple[float, float]]


def keys_of(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the runs, print after print."""
    for plate in options.models:
        for seed in options.seeds:
            for method in (word.replace("_", " ") for word in options.methods):
                yield dict(zip(KEY, (plate, HEADS, method, seed, options.time_limit), strict=True))


def run(key: dict[str, Any]) -> dict[str, Any]:
    """Make one run; of how it went the entropy at some times is kept."""
    row = in_own_process({**key, "swept": ":" not in key["plate"]})
    del row["swept"]
    row.pop("history", None)
    row["entropy"] = json.dumps(sampled(row.get("entropy") or [], key["cpu_s"]))
    return row


def sampled(entropy: Rounds, end_s: float) -> list[float]:
    """Return the entropy at even steps of the time: the last told by then, nan before any."""
    told = []
    for k in range(1, STEPS + 1):
        by_then = [value for at, value in entropy if at <= end_s * k / STEPS]
        told.append(by_then[-1] if by_then else math.nan)
    return told


def against_all(rows: list[dict[str, str]]) -> dict[str, list[float]]:
    """Return variant -> makespans over those of the whole search, of the same print and seed."""
    whole = {(r["plate"], r["seed"]): float(r["makespan_s"]) for r in rows if r["method"] == ALL}
    return {
        method: [
            float(r["makespan_s"]) / whole[r["plate"], r["seed"]]
            for r in mine
            if (r["plate"], r["seed"]) in whole
        ]
        for (method,), mine in grouped(rows, "method").items()
    }


def of_variants(rows: list[dict[str, str]]) -> str:
    """Return a line for each variant: against the bound and against the whole search."""
    cut = against_all([r for r in rows if "@" in r["plate"]])
    uncut = against_all([r for r in rows if "@" not in r["plate"]])
    lines = []
    for (method,), mine in grouped(rows, "method").items():
        both = cut.get(method, []) + uncut.get(method, [])
        lines.append(
            [
                method,
                str(len(mine)),
                spread([float(r["over_bound"]) for r in mine], 3),
                spread(cut.get(method, []), 3),
                spread(uncut.get(method, []), 3),
                f"{min(both):.3f} to {max(both):.3f}" if both else "",
                f"{statistics.median(int(r['rounds'] or r['orders']) for r in mine):.0f}",
                f"{statistics.median(float(r['spent_s']) for r in mine):.1f}",
                str(sum(int(r["faults"]) for r in mine)),
            ]
        )
    head = ["variant", "runs", "makespan ÷ bound", "÷ all, cut", "÷ all, whole",
            "least and most", "rounds", "processor s", "faults"]  # fmt: skip
    return markdown(lines, head)


def of_prints(rows: list[dict[str, str]]) -> str:
    """Return a line for each print: what each variant takes against the whole search."""
    there = list(dict.fromkeys(r["method"] for r in rows if r["method"] != ALL))
    lines = []
    for (plate,), mine in grouped(rows, "plate").items():
        against = against_all(mine)
        whole = [float(r["over_bound"]) for r in mine if r["method"] == ALL]
        said = [plate, mine[0]["contours"], spread(whole, 3)]
        lines.append([*said, *(spread(against.get(m, []), 3) for m in there)])
    return markdown(lines, ["print", "contours", "all ÷ bound", *there])


def of_entropy(rows: list[dict[str, str]]) -> str:
    """Return the median entropy of q over time, a line a variant."""
    lines = []
    for (method,), mine in grouped(rows, "method").items():
        told = [json.loads(r["entropy"]) for r in mine]
        columns = [[v for v in step if not math.isnan(v)] for step in zip(*told, strict=True)]
        medians = [f"{statistics.median(column):.2f}" if column else "" for column in columns]
        lines.append([method, *medians])
    steps = [f"{k}/{STEPS}" for k in range(1, STEPS + 1)]
    return markdown(lines, ["variant", *steps])


def report(rows: Rows, options: argparse.Namespace) -> str:
    """Return the page."""
    mine = [r for r in rows.rows if float(r["cpu_s"]) == options.time_limit and not r["error"]]
    there = ",".join(sorted({r["seed"] for r in mine}))
    said = setting(
        note=options.note,
        processor_time=f"{options.time_limit:g} s a search",
        seeds=there.replace(",", " "),
        machine="dual-gantry",
        quality="none",
    )
    text = f"# What each part of the search for several heads brings\n\n{said}\n\n"
    text += f"Repeat: `python benchmarks/team_ablation.py --time-limit {options.time_limit:g} "
    text += f"--seeds {there}`. All heads plan in turn in one process. Medians, quartiles in "
    text += "brackets, over plates and seeds. *÷ all*: makespan over that of the whole search "
    text += "with the same seed; above 1 the part brings something, or what is done otherwise "
    text += "brings nothing. *Least and most* of these. *Rounds*: joint orders of annealing. "
    text += "*Processor s*: what the search took. *Faults*: of all plans, by the judge.\n\n"
    text += of_variants(mine)
    text += f"\n## ÷ all by print\n\n{of_prints(mine)}"
    text += "\n## Entropy of q over time\n\nOf a head's distribution over its plans: 0 for one "
    text += "plan, 1 for all alike; the mean of the heads and the median of the runs, at eighths "
    text += "of the time. 0 at first: there is one plan while policies are tried.\n\n"
    text += of_entropy(mine)
    return text + rows.failures()


def main() -> None:
    parser = arguments(__doc__, time_limit=20.0, models=PRINTS)
    parser.add_argument("--methods", type=names, default=[v.replace(" ", "_") for v in VARIANTS],
                        help="NAME,NAME,… with _ for blanks")  # fmt: skip
    options = parser.parse_args()
    rows = Rows(options.results / "team_ablation.csv", KEY)
    if not options.table_only:
        run_missing(rows, keys_of(options), run)
    rows.read()
    (options.results / "team_ablation.md").write_text(report(rows, options))


if __name__ == "__main__":
    main()
