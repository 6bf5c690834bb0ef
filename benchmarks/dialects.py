"""Every file of many slicers: read, planned and verified, or refused and why.

    python benchmarks/dialects.py [--time-limit 20]

Machine `mk4s` where the print fits it, else `paper`. Writes
docs/results/dialects.csv (resumable) and docs/dialects.md.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from pathlib import Path
from typing import Any

from common import RESULTS, ROOT, Rows, corpus, markdown, measured, setting

KEY = ("file", "limit_s")


def plan(path: Path, machine: str, limit: float) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        out = f"{folder}/out.gcode"
        return measured(["plan", str(path), "-o", out, "--machine", machine, "--no-quality",
                         "--time-limit", f"{limit:g}"])  # fmt: skip


def attempt(path: Path, limit: float) -> dict[str, Any]:
    result = plan(path, "mk4s", limit)
    machine = "mk4s"
    if result["exit"]:
        other = plan(path, "paper", limit)
        if not other["exit"] or "contour" not in result.get("error", ""):
            result, machine = other, "paper"
    before, after = result.get("before", {}), result.get("after", {})
    return {
        "file": path.name,
        "limit_s": limit,
        "machine": machine if not result["exit"] else "",
        "contours": after.get("contours", ""),
        "travel_before_mm": before.get("extrusionless_travel_mm", ""),
        "travel_after_mm": after.get("extrusionless_travel_mm", ""),
        "barriers": len(result.get("barriers", [])),
        "outcome": "verified" if not result["exit"] else f"exit {result['exit']}",
        "reason": result.get("error", "").removeprefix("decmcts: ").replace(f"{path.parent}/", ""),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=20.0)
    parser.add_argument("--files", default="")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    folder = corpus() / "gcode"
    rows = Rows(RESULTS / "dialects.csv", KEY)
    with (folder / "manifest.csv").open(newline="") as file:
        slicers = {r["name"]: f"{r['slicer']} {r['version']}" for r in csv.DictReader(file)}
    for path in sorted([*folder.glob("*.gcode.gz"), *folder.glob("*.bgcode")]):
        if options.files and options.files not in path.name:
            continue
        if not rows.has(file=path.name, limit_s=options.time_limit):
            rows.append(attempt(path, options.time_limit))
            print(rows.rows[-1], flush=True)
    lines = []
    for r in sorted(rows.rows, key=lambda r: r["file"]):
        gain = ""
        if r["travel_before_mm"] and float(r["travel_before_mm"]):
            gain = f"{100 * (1 - float(r['travel_after_mm']) / float(r['travel_before_mm'])):.1f}"
        outcome = {"verified": "verified", "exit 2": "refused"}.get(r["outcome"], r["outcome"])
        slicer = slicers.get(r["file"].removesuffix(".gz"), "")
        lines.append([r["file"], slicer, outcome, r["machine"], r["contours"], gain,
                      r["barriers"], r["reason"]])  # fmt: skip
    head = ["file", "slicer", "outcome", "machine", "contours", "travel less %", "barriers", "why"]
    said = setting(
        note=options.note,
        planner="local",
        quality="none",
        time_limit=f"{options.time_limit:g} s",
        seed=0,
    )
    text = f"# Dialects: real files of many slicers\n\n{said}\n\nRepeat: "
    text += "`python benchmarks/dialects.py`. A refused file is refused with the line shown; "
    text += "nothing is written.\n\n" + markdown(lines, head)
    (ROOT / "docs" / "dialects.md").write_text(text)


if __name__ == "__main__":
    main()
