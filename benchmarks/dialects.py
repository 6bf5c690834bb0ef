"""Every file of many slicers: read, planned and verified, or refused and why.

    python benchmarks/dialects.py [--time-limit 5]

Machine `mk4s` where the print fits it, else `paper`. Writes docs/results/dialects.csv
(a row a file, resumable; rows of other columns are dropped) and docs/dialects.md.
"""

from __future__ import annotations

import argparse
import csv
import json
import tempfile
from pathlib import Path
from typing import Any

from common import RESULTS, ROOT, Rows, corpus, markdown, measured, setting

KEY = ("file", "limit_s")


WHOLE = ("file_time_s", "retractions", "travel_over_walls_mm", "arcs")  # of whole files
PRIMING = "skirt_brim"


def plan(path: Path, machine: str, limit: float) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        out, made = f"{folder}/out.gcode", Path(folder, "plan.json")
        result = measured(["plan", str(path), "-o", out, "--machine", machine, "--no-quality",
                           "--time-limit", f"{limit:g}", "--plan", str(made)])  # fmt: skip
        return {**result, **(priming(made) if made.exists() else {})}


def priming(path: Path) -> dict[str, Any]:
    """Return the place of the last skirt or brim in the source's order and the new, from 1."""
    document = json.loads(path.read_text())
    role = [contour["role"] for contour in document["contours"]]
    order = [a["contour"] for a in document["heads"][0]["actions"] if a["kind"] == "print"]
    was = [k for k, name in enumerate(role, 1) if name == PRIMING]
    now = [k for k, contour in enumerate(order, 1) if role[contour] == PRIMING]
    return {"priming_before": was[-1] if was else "", "priming_after": now[-1] if now else ""}


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
        "priming_before": result.get("priming_before", ""),
        "priming_after": result.get("priming_after", ""),
        **{f"{key}_before": before.get(key, "") for key in WHOLE},
        **{f"{key}_after": after.get(key, "") for key in WHOLE},
        "kept_source": result.get("kept_source", ""),
        "barriers": len(result.get("barriers", [])),
        "outcome": "verified" if not result["exit"] else f"exit {result['exit']}",
        "reason": result.get("error", "").removeprefix("decmcts: ").replace(f"{path.parent}/", ""),
    }


def arrow(row: dict[str, str], key: str) -> str:
    """Return what a figure was and is, nothing where the file does not show it."""
    was, now = row[f"{key}_before"], row[f"{key}_after"]
    known = {was, now}.isdisjoint({"", "None"})
    return f"{float(was):.0f} → {float(now):.0f}" if known else ""


def kept(row: dict[str, str]) -> str:
    return {"True": "the source", "False": "the new order"}.get(row["kept_source"], "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--time-limit", type=float, default=5.0)
    parser.add_argument("--files", default="")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    folder = corpus() / "gcode"
    rows = Rows(RESULTS / "dialects.csv", KEY)
    if rows.rows and "arcs_after" not in rows.rows[0]:
        rows.path.unlink()
        rows.rows.clear()
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
                      arrow(r, "priming"), *(arrow(r, key) for key in WHOLE), kept(r),
                      r["barriers"], r["reason"]])  # fmt: skip
    head = ["file", "slicer", "outcome", "machine", "contours", "travel less %",
            "last of skirt and brim", "time of whole file s", "retractions",
            "travel over outer walls mm", "arcs", "written", "barriers", "why"]  # fmt: skip
    said = setting(
        note=options.note,
        planner="hybrid",
        quality="none",
        time_limit=f"{options.time_limit:g} s",
        seed=0,
    )
    text = f"# Dialects: real files of many slicers\n\n{said}\n\nRepeat: "
    text += "`python benchmarks/dialects.py`. A refused file is refused with the line shown; "
    text += "nothing is written. Before → after: the place of the last skirt or brim contour, "
    text += "and of whole files, start and end code included, the estimated time, how often "
    text += "filament is pulled back, and the length of travel moves that cross an outer wall of "
    text += "the layer printed last or next, seen from above, and G2 and G3 that print. Where the "
    text += "new order would take longer the source is kept.\n\n" + markdown(lines, head)
    (ROOT / "docs" / "dialects.md").write_text(text)


if __name__ == "__main__":
    main()
