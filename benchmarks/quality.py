"""What each wish costs: shells and anchors, cooling, and a limit to layers ahead.

    python benchmarks/quality.py [--time-limit 5] [--models a,b]

Ten models, machine `mk4s`, process order `keep`. Their slicer had cooling off, so
the rule is asked for. Writes docs/results/quality.csv (resumable) and quality.md.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path
from typing import Any

from common import RESULTS, Rows, corpus, markdown, measured, setting
from models import figures_of

MODELS = (
    "stained_glass_3 xyz_cube_20 openbot_phone_mount pillars_5x5 odri_spacers_6 "
    "teaset_chess_7 benchy_lowpoly six_cylinders spool_mount_4 odri_pulleys_rollers_9"
)
WISHES = {  # name: (what it says in the table, options)
    "none": ("geometry and process order only", ["--no-quality"]),
    "shells": ("shells and anchors", ["--quality", "--min-layer-time", "0"]),
    "cool 10": ("and 10 s for each spot", ["--quality", "--min-layer-time", "10"]),
    "ahead 4": (
        "shells, at most 4 layers ahead",
        ["--quality", "--min-layer-time", "0", "--max-layers-ahead", "4"],
    ),
}
KEY = ("model", "wish", "machine", "limit_s", "seed")


def run(path: Path, key: dict[str, Any]) -> dict[str, Any]:
    arguments = ["plan", str(path), "--machine", key["machine"], "--no-certificate"]
    arguments += ["--time-limit", f"{key['limit_s']:g}", "--seed", str(key["seed"])]
    result = measured([*arguments, *WISHES[key["wish"]][1]])
    after = result.get("after", {})
    waits = {name: after.get(name, "") for name in ("waits", "waits_s")}
    return {**key, **figures_of(result), **waits}


def cell(row: dict[str, str] | None) -> str:
    """Return travel and time saved, and the waits."""
    if row is None or row["error"]:
        return "" if row is None else row["error"]
    time = 100 * (1 - float(row["time_after_s"]) / float(row["time_before_s"]))
    waits = f" ({float(row['waits_s']):.0f} s in {row['waits']})" if float(row["waits_s"]) else ""
    return f"{float(row['less_percent']):.1f} / {time:.1f}{waits}"


def table(rows: list[dict[str, str]], names: list[str]) -> str:
    found = {(row["model"], row["wish"]): row for row in rows}
    lines = [[name, *(cell(found.get((name, wish))) for wish in WISHES)] for name in names]
    medians = ["median"]
    for wish in WISHES:
        gains = [
            float(row["less_percent"]) for row in rows if row["wish"] == wish and not row["error"]
        ]
        medians.append(f"{statistics.median(gains):.1f}" if gains else "")
    return markdown([*lines, medians], ["model", *(text for text, _ in WISHES.values())])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=5.0)
    parser.add_argument("--models", default=MODELS.replace(" ", ","))
    parser.add_argument("--table-only", action="store_true")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    rows = Rows(RESULTS / "quality.csv", KEY)
    names = options.models.split(",")
    for name in [] if options.table_only else names:
        for wish in WISHES:
            key = dict(zip(KEY, (name, wish, "mk4s", options.time_limit, 0), strict=True))
            if not rows.has(**key):
                path = corpus() / "models" / "gcode" / f"{name}.gcode.gz"
                rows.append(run(path, key))
                print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)
    done = {row["model"] for row in rows.rows}
    said = setting(
        note=options.note, planner="local", machine="mk4s", freedom="reversible",
        process_order="keep", time_limit=f"{options.time_limit:g} s", seed=0,
    )  # fmt: skip
    text = f"# What quality costs\n\n{said}\n\nRepeat: `python benchmarks/quality.py`. "
    text += "Each cell: extrusionless travel and estimated print time less than in the source, "
    text += "in per cent, and in brackets the seconds waited for cooling and in how many places. "
    text += "The models were sliced with cooling off, so that layers may be shorter than the "
    text += "rule; a spot then owes what the source gave it.\n\n"
    text += table(rows.rows, [name for name in MODELS.split() if name in done])
    (RESULTS / "quality.md").write_text(text)


if __name__ == "__main__":
    main()
