"""Travel over outer walls of whole files, with each `--avoid-walls`, against the source's.

    python benchmarks/wall_travel.py [--time-limit 5] [--files NAME]

Machine `mk4s` where the print fits it, else `paper`; files whose outer walls are not known say
nothing and are left out. Writes docs/results/wall_travel.csv (resumable, a row a file and choice)
and docs/results/wall_travel.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import median
from typing import Any

from common import RESULTS, ROOT, Rows, corpus, markdown, measured, setting

KEY = ("file", "avoid_walls", "limit_s")
CHOICES = ("never", "auto", "always")
MACHINES = ("mk4s", "paper")
FIGURES = ("travel_over_walls_mm", "file_time_s", "retractions", "emitted_travel_mm")


def attempt(path: Path, choice: str, limit: float) -> dict[str, Any]:
    """Plan one file; the row is empty where it is refused or its walls are not known."""
    row = {"file": path.name, "avoid_walls": choice, "limit_s": limit}
    result: dict[str, Any] = {}
    out = "/tmp/wall_travel.gcode"
    for machine in MACHINES:
        result = measured(["plan", str(path), "-o", out, "--machine", machine,
                           "--no-quality", "--time-limit", f"{limit:g}",
                           "--avoid-walls", choice])  # fmt: skip
        if not result["exit"]:
            break
    before, after = result.get("before", {}), result.get("after", {})
    return {
        **row,
        "kept_source": result.get("kept_source", ""),
        **{f"{key}_before": before.get(key, "") for key in FIGURES},
        **{f"{key}_after": after.get(key, "") for key in FIGURES},
    }


def table(rows: list[dict[str, str]]) -> list[list[str]]:
    """Return a line a file: what of its travel leads over walls, and its time, by choice."""
    by = {(row["file"], row["avoid_walls"]): row for row in rows}
    lines = []
    for name in sorted({row["file"] for row in rows}):
        mine = [by.get((name, choice)) for choice in CHOICES]
        if None in mine or not mine[0]["travel_over_walls_mm_after"] or \
                mine[0]["travel_over_walls_mm_after"] == "None":  # fmt: skip
            continue
        source = mine[0]
        over = [f"{float(r['travel_over_walls_mm_after']):.0f}" for r in mine]
        took = [f"{float(r['file_time_s_after']):.1f}" for r in mine]
        lines.append([name, f"{float(source['travel_over_walls_mm_before']):.0f}", *over,
                      f"{float(source['file_time_s_before']):.1f}", *took])  # fmt: skip
    return lines


def summary(lines: list[list[str]]) -> str:
    """Return what the table says in short."""
    more = sum(float(line[3]) > float(line[1]) + 0.5 for line in lines)
    less = [1.0 - float(line[4]) / float(line[2]) for line in lines if float(line[2]) > 0.0]
    longer = [float(line[8]) / float(line[6]) - 1.0 for line in lines]
    return (
        f"With `auto` {more} of {len(lines)} files have more travel over outer walls than their "
        f"source. `always` against `never`: {100 * median(less):.0f} % less of it in the median "
        f"of {len(less)} files that have any, {100 * median(longer):+.2f} % time in the median, "
        f"{100 * max(longer):+.2f} % at most."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=5.0)
    parser.add_argument("--files", default="")
    options = parser.parse_args()
    rows = Rows(RESULTS / "wall_travel.csv", KEY)
    folder = corpus() / "gcode"
    for path in sorted([*folder.glob("*.gcode.gz"), *folder.glob("*.bgcode")]):
        if options.files not in path.name:
            continue
        for choice in CHOICES:
            if not rows.has(file=path.name, avoid_walls=choice, limit_s=options.time_limit):
                rows.append(attempt(path, choice, options.time_limit))
                print(rows.rows[-1], flush=True)
    lines = table(rows.rows)
    said = setting(planner="hybrid", quality="none", time_limit=f"{options.time_limit:g} s", seed=0)
    head = ["file", "source mm", *(f"{c} mm" for c in CHOICES), "source s",
            *(f"{c} s" for c in CHOICES)]  # fmt: skip
    text = f"# Travel over outer walls\n\n{said}\n\nRepeat: `python benchmarks/wall_travel.py`. "
    text += "Length of travel moves that cross an outer wall of the layer printed last or next, "
    text += f"seen from above, and time, of whole files. {summary(lines)}\n\n"
    (ROOT / "docs" / "results" / "wall_travel.md").write_text(text + markdown(lines, head))


if __name__ == "__main__":
    main()
