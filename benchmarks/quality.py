"""What each rule costs: shells and anchors, cooling, and a limit to layers ahead.

    python benchmarks/quality.py [--time-limit 20] [--models a,b]

Ten models, planner `hybrid`, machine `mk4s`, process order `keep`. Their slicer had
cooling off, so the rule is asked for. Writes docs/results/quality.csv (a row a run,
resumable), quality.md and quality.png.
"""

from __future__ import annotations

import argparse
import itertools
import textwrap
from pathlib import Path
from typing import Any

from common import (
    CPU_TIME,
    Rows,
    arguments,
    grouped,
    markdown,
    measured,
    median,
    of_models,
    print_path,
    run_missing,
    setting,
    spread,
)
from models import figures_of, gains_of, time_saved

MODELS = (
    "stained_glass_3 xyz_cube_20 openbot_phone_mount pillars_5x5 odri_spacers_6 "
    "teaset_chess_7 benchy_lowpoly six_cylinders spool_mount_4 odri_pulleys_rollers_9"
)
MACHINE = "mk4s"
RULES = {  # name: (what it says in the table, options)
    "none": ("geometry and process order only", ["--no-quality"]),
    "shells": ("shells and anchors", ["--quality", "--min-layer-time", "0"]),
    "cool 10": ("and 10 s for each spot", ["--quality", "--min-layer-time", "10"]),
    "ahead 4": (
        "shells, at most 4 layers ahead",
        ["--quality", "--min-layer-time", "0", "--max-layers-ahead", "4"],
    ),
}
KEY = ("model", "rules", "machine", "limit_s", "seed")


def run(key: dict[str, Any]) -> dict[str, Any]:
    arguments = ["plan", str(print_path(key["model"])), "--machine", key["machine"]]
    arguments += ["--time-limit", f"{key['limit_s']:g}", "--seed", str(key["seed"])]
    arguments += ["--no-certificate", *RULES[key["rules"]][1]]
    result = measured(arguments, timeout_s=1800.0 + 8.0 * key["limit_s"], cpu_time=True)
    after = result.get("after", {})
    waits = {name: after.get(name, "") for name in ("waits", "waits_s")}
    return {**key, **waits, **figures_of(result)}


def cell(runs: list[dict[str, str]]) -> str:
    """Return travel and time saved, and the waits."""
    if not runs:
        return ""
    time, waits_s = spread([time_saved(row) for row in runs]), median(runs, "waits_s")
    waits = f" ({waits_s:.0f} s in {median(runs, 'waits'):.0f})" if waits_s else ""
    return f"{spread(gains_of(runs))} / {time}{waits}"


def table(rows: list[dict[str, str]]) -> str:
    found = grouped(rows, "model", "rules")
    models = dict.fromkeys(row["model"] for row in rows)
    lines = [[name, *(cell(found.get((name, rules), [])) for rules in RULES)] for name in models]
    by_rules = grouped(rows, "rules")
    lines.append(
        ["median (quartiles)"]
        + [
            f"{spread(gains_of(mine))} / {spread([time_saved(row) for row in mine])}"
            for mine in (by_rules.get((rules,), []) for rules in RULES)
        ]
    )
    return markdown(lines, ["model", *(text for text, _ in RULES.values())])


def plot(rows: list[dict[str, str]], path: Path) -> None:
    import matplotlib.pyplot as plt

    by_rules = grouped(rows, "rules")
    there = [rules for rules in RULES if (rules,) in by_rules]
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.5), layout="constrained")
    for axis, of, label in (
        (axes[0], gains_of, "travel less than in the source, %"),
        (axes[1], lambda mine: [time_saved(row) for row in mine], "print time less, %"),
    ):
        axis.axhline(0.0, color="grey")
        axis.boxplot(
            [of(by_rules[rules,]) for rules in there],
            tick_labels=[textwrap.fill(RULES[rules][0], 16) for rules in there],
            widths=0.5,
        )
        axis.set(ylabel=label)
        axis.grid(axis="y", alpha=0.3)
    figure.savefig(path, dpi=110)


def write_results(rows: Rows, options: argparse.Namespace) -> None:
    mine = [r for r in rows.rows if float(r["limit_s"]) == options.time_limit and not r["error"]]
    said = setting(
        note=options.note, planner="hybrid", machine=MACHINE, freedom="reversible",
        process_order="keep", time_limit=f"{options.time_limit:g} s",
        seeds=" ".join(sorted({r["seed"] for r in mine})), seconds=CPU_TIME,
    )  # fmt: skip
    text = f"# What quality costs\n\n{said}\n\nRepeat: `python benchmarks/quality.py "
    text += f"--time-limit {options.time_limit:g}{of_models(mine, MODELS)}`. "
    text += "Each cell: extrusionless travel and estimated print time less than in the source, "
    text += "in per cent, and in brackets the seconds waited for cooling and in how many places. "
    text += "The models were sliced with cooling off, so that layers may be shorter than the "
    text += "rule; a spot then owes what the source gave it.\n\n"
    text += table(mine) + "\n![what quality costs](quality.png)\n" + rows.failures()
    (options.results / "quality.md").write_text(text)
    if mine:
        plot(mine, options.results / "quality.png")


def main() -> None:
    options = arguments(__doc__, time_limit=20.0, models=MODELS).parse_args()
    rows = Rows(options.results / "quality.csv", KEY)
    keys = [
        dict(zip(KEY, (model, rules, MACHINE, options.time_limit, seed), strict=True))
        for seed, model, rules in itertools.product(options.seeds, options.models, RULES)
    ]
    if not options.table_only:
        run_missing(rows, keys, run)
    write_results(rows, options)


if __name__ == "__main__":
    main()
