"""How far from optimal results are at most, over the models with up to 2500 contours.

    python benchmarks/certificates.py [--time-limit 60] [--freedoms fixed,reversible]

The gap is proven by the certificate that `decmcts plan` prints: it holds both what
the search leaves and what the bound misses. Writes docs/results/certificates.csv
(a row a run, resumable), certificates.md and certificates.png.
"""

from __future__ import annotations

import argparse
import csv
import itertools
from pathlib import Path
from typing import Any

from common import (
    Rows,
    arguments,
    corpus,
    grouped,
    markdown,
    measured,
    names,
    print_path,
    run_missing,
    setting,
    spread,
)

KEY = ("model", "machine", "process", "freedom", "planner", "limit_s", "seed")
MOST_CONTOURS = 2500
AIM_PERCENT = 10.0


def run(key: dict[str, Any]) -> dict[str, Any]:
    arguments = ["plan", str(print_path(key["model"])), "--machine", key["machine"]]
    arguments += ["--planner", key["planner"], "--time-limit", str(key["limit_s"])]
    arguments += ["--freedom", key["freedom"], "--process-order", key["process"]]
    result = measured([*arguments, "--no-quality", "--seed", str(key["seed"])])
    before, after = result.get("before", {}), result.get("after", {})
    missing = after.get("bound_skipped", "")
    return {
        **key,
        "contours": after.get("contours", ""),
        "edges": result.get("edges", ""),
        "travel_before_mm": before.get("extrusionless_travel_mm", ""),
        "travel_after_mm": after.get("extrusionless_travel_mm", ""),
        "bound_mm": after.get("bound_mm", ""),
        "gap_percent": after.get("gap_percent", ""),
        "method": after.get("bound_method", ""),
        "proof_s": result.get("seconds", {}).get("bound", ""),
        "error": result.get("error", missing),
    }


def small_models() -> list[str]:
    """Return the corpus' models that are small enough, small ones first."""
    with (corpus() / "models" / "manifest.csv").open(newline="") as file:
        rows = [(int(row["contours"]), row["name"]) for row in csv.DictReader(file)]
    return [name for contours, name in sorted(rows) if contours <= MOST_CONTOURS]


def summary(rows: list[dict[str, str]]) -> str:
    text = ""
    for (freedom, process), mine in grouped(rows, "freedom", "process").items():
        gaps = [float(r["gap_percent"]) for r in mine if r["gap_percent"]]
        if gaps:
            text += f"- {freedom}, process order {process}: median gap {spread(gaps)} %, "
            text += f"{min(gaps):.1f} to {max(gaps):.1f} % over {len(gaps)} models; at most "
            text += f"{AIM_PERCENT:g} % for {sum(gap <= AIM_PERCENT for gap in gaps)}\n"
    return text


def table(rows: list[dict[str, str]]) -> str:
    lines = []
    for r in rows:
        less = 100 * (1 - float(r["travel_after_mm"]) / float(r["travel_before_mm"]))
        lines.append(
            [r["model"], r["freedom"], r["process"], r["contours"], r["edges"], f"{less:.1f}"]
            + [f"{float(r[name]):.1f}" for name in ("travel_after_mm", "bound_mm")]
            + [f"{float(r['gap_percent']):.2f}" if r["gap_percent"] else "", r["method"]]
        )
    head = ["model", "freedom", "process", "contours", "edges", "less %", "travel mm", "bound mm",
            "at most % above optimal", "method"]  # fmt: skip
    return markdown(lines, head)


def plot(rows: list[dict[str, str]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(8, 4.5), layout="constrained")
    for (freedom, process), mine in grouped(rows, "freedom", "process").items():
        fine = [r for r in mine if r["gap_percent"]]
        n, gaps = ([float(r[name]) for r in fine] for name in ("contours", "gap_percent"))
        axis.semilogx(n, gaps, "o", label=f"{freedom}, {process}")
    axis.axhline(AIM_PERCENT, color="grey", linestyle="--", label="aim for the median")
    axis.set(xlabel="contours", ylabel="at most % above optimal", ylim=(0, None))
    axis.grid(alpha=0.3)
    axis.legend()
    figure.savefig(path, dpi=110)


def write_results(rows: Rows, options: argparse.Namespace) -> None:
    mine = [r for r in rows.rows if not r["error"] and float(r["limit_s"]) == options.time_limit]
    mine.sort(key=lambda r: (int(r["contours"] or 0), r["model"]))
    said = setting(
        note=options.note, machine="paper", quality="none", planner=options.planner,
        time_limit=f"{options.time_limit:g} s, and at most half of that, or 10 s, for the bound",
        seeds=" ".join(sorted({r["seed"] for r in mine})),
    )  # fmt: skip
    text = f"# Certificates\n\n{said}\n\nRepeat: `python benchmarks/certificates.py"
    text += f" --time-limit {options.time_limit:g}`. Models with "
    text += f"at most {MOST_CONTOURS} contours. The gap is proven: the optimum lies between bound "
    text += f"and travel.\n\n{summary(mine)}\n![gaps](certificates.png)\n\n" + table(mine)
    text += rows.failures()
    (options.results / "certificates.md").write_text(text)
    if mine:
        plot(mine, options.results / "certificates.png")


def main() -> None:
    parser = arguments(__doc__, time_limit=60.0, models="")
    parser.add_argument("--freedoms", type=names, default=["fixed"])
    parser.add_argument("--process", type=names, default=["free"])
    parser.add_argument("--planner", default="hybrid")
    options = parser.parse_args()
    rows = Rows(options.results / "certificates.csv", KEY)
    if not options.table_only:
        keys = [
            dict(zip(KEY, (model, "paper", process, freedom, options.planner, options.time_limit,
                           seed), strict=True))
            for seed, freedom, process, model in itertools.product(
                options.seeds, options.freedoms, options.process, options.models or small_models()
            )
        ]  # fmt: skip
        run_missing(rows, keys, run)
    write_results(rows, options)


if __name__ == "__main__":
    main()
