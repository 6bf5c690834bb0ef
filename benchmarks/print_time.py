"""Print times: the estimator against the slicers' own, and what `--objective time` saves.

    python benchmarks/print_time.py [--saved stained_glass_3,...] [--time-limit 5] [--table-only]

First every file of the corpus that names an estimate (PrusaSlicer and its
relatives, Cura, ideaMaker, ...), in this process; then each model of `--saved` is
planned for travel and for time. Writes docs/results/print_time.csv (a row a file) and
print_time_saved.csv (a row a run), both resumable, print_time.md and print_time.png.
"""

from __future__ import annotations

import argparse
import math
import re
import statistics
import tempfile
from pathlib import Path
from typing import Any

from common import RESULTS, Rows, corpus, markdown, measured, setting

from decmcts.errors import InputError
from decmcts.formats.gcode.controller.duration import text_time
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.print.machine import MotionLimits

UNITS = {"d": 86400, "h": 3600, "m": 60, "s": 1}
PRUSA = "PrusaSlicer"
SAVED = (
    "stained_glass_3,xyz_cube_20,openbot_phone_mount,teaset_chess_7,spool_mount_4,benchy_lowpoly"
)
KEY = ("model", "machine", "objective", "limit_s", "seed")
# kind, and where its estimate stands: in words (1h 2m 3s), or in seconds
WORDS = re.compile(
    rb"(?:estimated printing time \(normal mode\) =|model printing time:) *([^;\r\n]*)"
)
SECONDS = re.compile(rb"^;(?:TIME:|Print Time: |\s*--- print time: )(\d+)", re.M)
MAKERS = ("PrusaSlicer", "SuperSlicer", "OrcaSlicer", "BambuStudio", "Cura", "ideaMaker", "Kiri")


def stated(text: bytes) -> float:
    """Return the seconds a file's slicer says it takes, 0 for none."""
    if match := WORDS.search(text):
        found = re.findall(r"(\d+)([dhms])", match[1].decode())
        return float(sum(int(n) * UNITS[unit] for n, unit in found))
    match = SECONDS.search(text)
    return float(match[1]) if match else 0.0


def maker(path: Path) -> str:
    name = path.name.lower()
    return next((m for m in MAKERS if name.startswith(m.lower())), PRUSA)


def estimate(path: Path, root: Path) -> dict[str, Any] | None:
    """Return the row of a file, or None where no estimate stands in it."""
    text = load_text(path)
    due = stated(text)
    if not due:
        return None
    try:
        found = text_time(text, MotionLimits(), path=path)
    except InputError as error:
        print(error)
        return None
    return {
        "file": name_of(path, root),
        "slicer": maker(path),
        "stated_s": due,
        "motion_s": round(found.motion_s, 1),
        "dwell_s": round(found.dwell_s, 1),
        "change_s": round(found.change_s, 1),
        "error_percent": round(100 * (found.total_s / due - 1), 3),
        "moves": len(found.seconds),
    }


def name_of(path: Path, root: Path) -> str:
    return str(path.relative_to(root)).removesuffix(".gcode.gz")


def save(model: str, machine: str, objective: str, options: argparse.Namespace) -> dict[str, Any]:
    path = corpus() / "models" / "gcode" / f"{model}.gcode.gz"
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["plan", str(path), "--machine", machine, "--objective", objective]
        arguments += ["-o", f"{folder}/out.gcode", "--no-certificate", "--allow-slower"]
        arguments += ["--time-limit", str(options.time_limit), "--seed", "0"]
        result = measured(arguments)
    before, after = result.get("before", {}), result.get("after", {})
    key = zip(KEY, (model, machine, objective, options.time_limit, 0), strict=True)
    return {
        **dict(key),
        "contours": after.get("contours", ""),
        "travel_before_mm": before.get("extrusionless_travel_mm", ""),
        "travel_after_mm": after.get("extrusionless_travel_mm", ""),
        "time_before_s": before.get("print_time_s", ""),
        "time_after_s": after.get("print_time_s", ""),
        "file_before_s": result.get("file_time_s", {}).get("before", ""),
        "file_after_s": result.get("file_time_s", {}).get("after", ""),
        "error": result.get("error", ""),
    }


def quantities(errors: list[float]) -> list[str]:
    """Return median and nine-in-ten size of the errors, the least and the most."""
    sizes = sorted(map(abs, errors))
    nine = sizes[math.ceil(0.9 * (len(sizes) - 1))]
    return [f"{statistics.median(sizes):.2f}", f"{nine:.2f}"] + [
        f"{value:+.2f}" for value in (min(errors), max(errors))
    ]


def spread(rows: list[dict[str, Any]]) -> str:
    """Return the table of errors by slicer."""
    lines = []
    for name in MAKERS:
        errors = [float(r["error_percent"]) for r in rows if r["slicer"] == name]
        if errors:
            lines.append(
                [name, str(len(errors)), f"{statistics.median(errors):+.2f}", *quantities(errors)]
            )
    head = ["slicer", "files", "median error %", "median \\|error\\| %", "9 in 10 below %",
            "least %", "most %"]  # fmt: skip
    return markdown(lines, head)


def within(rows: list[dict[str, Any]], percent: float = 2.0) -> str:
    """Say how many files of PrusaSlicer are met within so many percent."""
    sizes = [abs(float(r["error_percent"])) for r in rows if r["slicer"] == PRUSA]
    near = sum(size <= percent for size in sizes)
    return f"\n{near} of {len(sizes)} files of {PRUSA} within {percent:g} %.\n"


def saved_table(rows: list[dict[str, str]]) -> str:
    lines = []
    for r in rows:
        if r["error"]:
            lines.append([r["model"], r["machine"], r["objective"], r["error"], *[""] * 7])
            continue
        was, now = float(r["time_before_s"]), float(r["time_after_s"])
        length = 1 - float(r["travel_after_mm"]) / float(r["travel_before_mm"])
        lines.append(
            [r["model"], r["machine"], r["objective"], r["contours"]]
            + [f"{100 * length:.1f}", *(f"{value:.0f}" for value in (was, now, was - now))]
            + [f"{100 * (1 - now / was):.2f}"]
            + [f"{float(r[k]):.0f}" for k in ("file_before_s", "file_after_s")]
        )
    head = ["model", "machine", "objective", "contours", "travel less %", "time before s",
            "after s", "saved s", "saved %", "file before s", "file after s"]  # fmt: skip
    return markdown(lines, head)


def all_files(rows: list[dict[str, Any]]) -> str:
    lines = [
        [r["file"], r["slicer"]]
        + [f"{float(r[f'{k}_s']):.0f}" for k in ("stated", "motion", "dwell", "change")]
        + [f"{float(r['error_percent']):+.2f}", str(r["moves"])]
        for r in rows
    ]
    head = ["file", "slicer", "stated s", "motion s", "dwell s", "changes s", "error %", "moves"]
    return markdown(lines, head)


def plot(rows: list[dict[str, Any]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(12, 4.5), layout="constrained")
    for name in MAKERS:
        mine = [r for r in rows if r["slicer"] == name]
        x = [float(r["stated_s"]) / 60 for r in mine]
        axes[0].semilogx(x, [float(r["error_percent"]) for r in mine], "o", label=name, alpha=0.7)
    axes[0].axhspan(-2, 2, color="grey", alpha=0.15)
    axes[0].set(xlabel="stated, minutes", ylabel="error, %", ylim=(-20, 20))
    axes[0].legend(fontsize=8)
    errors = [float(r["error_percent"]) for r in rows if r["slicer"] == PRUSA]
    axes[1].hist(errors, bins=[x / 10 for x in range(-30, 31)])
    axes[1].set(xlabel=f"error, % ({PRUSA}; {len(errors)} files)", ylabel="files")
    for axis in axes:
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def compare(root: Path, rows: Rows) -> None:
    """Add the rows that are not there yet."""
    for path in sorted(root.glob("**/*.gcode.gz")):
        if not rows.has(file=name_of(path, root)) and (row := estimate(path, root)):
            rows.append(row)
            print(*(f"{k}={v}" for k, v in row.items()), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--saved", default=SAVED)
    parser.add_argument("--machines", default="mk4s,paper")
    parser.add_argument("--time-limit", type=float, default=5.0)
    parser.add_argument("--table-only", action="store_true", help="no new runs")
    parser.add_argument("--note", default="", help="said beside the setting")
    options = parser.parse_args()
    compared = Rows(RESULTS / "print_time.csv", ("file",))
    if not options.table_only:
        compare(corpus(), compared)
    saved = Rows(RESULTS / "print_time_saved.csv", KEY)
    for model in [] if options.table_only else filter(None, options.saved.split(",")):
        for machine in options.machines.split(","):
            for objective in ("travel", "time"):
                key = (model, machine, objective, options.time_limit, 0)
                if not saved.has(**dict(zip(KEY, key, strict=True))):
                    saved.append(save(model, machine, objective, options))
                    print(*(f"{k}={v}" for k, v in saved.rows[-1].items()), flush=True)
    said = setting(note=options.note, seed=0)
    text = f"# Print time\n\n{said}\n\nRepeat: `python benchmarks/print_time.py`.\n\n"
    text += "## The estimate against the slicer's own\n\n" + spread(compared.rows)
    text += within(compared.rows) + NOTES + "\n![errors](print_time.png)\n\n"
    text += f"## What `--objective time` saves\n\n{SAVED_NOTES}\n" + saved_table(saved.rows)
    text += "\n## All files\n\n" + all_files(sorted(compared.rows, key=lambda r: r["file"]))
    (RESULTS / "print_time.md").write_text(text)
    plot(compared.rows, RESULTS / "print_time.png")


NOTES = """
Limits are the file's own; where it has none, those of no particular machine
(docs/machine-format.md), so only PrusaSlicer and its relatives are comparable.
Dwells (G4) are counted here and not by PrusaSlicer. What changing tools and colours
takes is mostly in the slicer's head and not in the file: prints that do (Bambu's two
colours, PrusaSlicer's XL, the Klipper file for T1) are the outliers.
"""
SAVED_NOTES = """Planner `local`, process order kept, freedom reversible, seed 0, against the
slicer's order with the same travels made safe; times of the print as planned, and of whole
files (start and end G-code too) as estimated from the source's and the written text.
"""

if __name__ == "__main__":
    main()
