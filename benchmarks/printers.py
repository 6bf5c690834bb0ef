"""Every file that states clearances: planned without a machine file, and what that leaves free.

    python benchmarks/printers.py [--time-limit 1] [--files WORD]

A contour could move if the order constraints leave it free against a contour of
another layer: either may come first. They are counted for the head of the file's
clearances and for the head of the printer's preset, where there is one. Writes
docs/results/printers.csv (a row a file, resumable) and printers.md.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from common import RESULTS, Rows, corpus, last, markdown, run_missing, setting
from numpy.typing import NDArray

KEY = ("file", "limit_s")
SETTINGS_SAID = "process order keep, quality on"


def movable(before: NDArray[np.int32], layer: NDArray[np.int32]) -> int:
    """Count contours that are free against at least one of another layer.

    Parameters
    ----------
    before : NDArray[np.int32]
        (m, 2) pairs a, b with a < b: a is printed before b; what follows from them counts.
    layer : NDArray[np.int32]
        (n,) layer of each contour.
    """
    n = len(layer)
    reached = np.eye(n, dtype=np.bool_)  # reached[a, b]: a comes before b, or is b
    follow: list[list[int]] = [[] for _ in range(n)]
    for a, b in before.tolist():
        follow[a].append(b)
    for a in range(n - 1, -1, -1):
        for b in follow[a]:
            reached[a] |= reached[b]
    free = ~(reached | reached.T) & (layer[:, None] != layer[None, :])
    return int(free.any(axis=1).sum())


def movable_with(path: Path, machine: Any) -> int:
    """Count the contours of a file that could move under a machine's head."""
    from decmcts.planning.problem.print_problem import load

    loaded = load(path, machine)
    return movable(loaded.graph.pairs(), loaded.job.contours.layer.astype(np.int32))


def heads_of(path: Path) -> tuple[Any, Any]:
    """Return the machine of a file's clearances and its printer's preset; None: there is none."""
    from decmcts.formats.gcode.text.source_text import load_text
    from decmcts.formats.heads.clearances import SETTINGS, clearance_machine, read_clearances
    from decmcts.formats.machines.machine_file import load_machine, preset_for_printer
    from decmcts.formats.machines.own_machine import comment_settings

    found = read_clearances(comment_settings(load_text(path), SETTINGS, path), path)
    if found is None:
        return None, None
    preset = preset_for_printer(found.printer)
    return clearance_machine(found, source=path.name), load_machine(preset) if preset else None


def counted(path: Path, machine: Any) -> str:
    """Return the number of contours that could move, or why there is none."""
    from decmcts.errors import InputError

    if machine is None:
        return ""
    try:
        return str(movable_with(path, machine))
    except InputError as error:
        return error.what


def said(arguments: list[str]) -> dict[str, Any]:
    """Return what a command says as JSON, run in this process; its last line as `error` if none.

    All prints share one process, so that kernels are loaded once.
    """
    from decmcts.cli.run import run as command

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = command([*arguments, "--json"])
    told = out.getvalue()
    if code in (0, 1) and "{" in told:
        return dict(json.loads(told[told.index("{") :]))
    return {"error": last(err.getvalue() + told)}


def run(key: dict[str, Any]) -> dict[str, Any]:
    path = corpus() / "gcode" / key["file"]
    stated, preset = heads_of(path)
    with tempfile.TemporaryDirectory() as folder:
        out = f"{folder}/out.gcode"
        result = said(["plan", str(path), "-o", out, "--time-limit", f"{key['limit_s']:g}",
                       "--no-certificate", "--allow-slower"])  # fmt: skip
        judged = {} if "error" in result else said(["verify", out, "--source", str(path)])
    after = result.get("after", {})
    travel = {name: result.get(name, {}).get("extrusionless_travel_mm", "")
              for name in ("before", "after")}  # fmt: skip
    return {
        **key,
        "machine": result.get("machine", ""),
        "contours": after.get("contours", ""),
        "travel_before_mm": travel["before"],
        "travel_after_mm": travel["after"],
        "movable_clearances": counted(path, stated),
        "preset": preset.name if preset is not None else "",
        "movable_preset": counted(path, preset),
        "verified": judged.get("ok", ""),
        "error": result.get("error", "") or judged.get("error", ""),
    }


def states_clearances(path: Path) -> bool:
    return heads_of(path)[0] is not None


def table(rows: list[dict[str, str]], slicers: dict[str, str]) -> str:
    lines = []
    for row in sorted(rows, key=lambda row: row["file"]):
        gain = ""
        if row["travel_before_mm"] and float(row["travel_before_mm"]):
            gain = (
                f"{100 * (1 - float(row['travel_after_mm']) / float(row['travel_before_mm'])):.1f}"
            )
        lines.append([
            row["file"], slicers.get(row["file"].removesuffix(".gz"), ""), row["machine"],
            {"True": "verified", "False": "faults"}.get(row["verified"], row["error"]),
            row["contours"], row["movable_clearances"],
            f"{row['movable_preset']} ({row['preset']})" if row["preset"] else "", gain,
        ])  # fmt: skip
    return markdown(lines, [
        "file", "slicer", "machine without `--machine`", "outcome", "contours",
        "could move, clearances", "could move, preset", "travel less %",
    ])  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--time-limit", type=float, default=1.0)
    parser.add_argument("--files", default="", help="only those with this in their name")
    parser.add_argument("--table-only", action="store_true", help="run nothing")
    parser.add_argument("--note", default="", help="said beside the setting")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder that is written")
    options = parser.parse_args()
    folder = corpus() / "gcode"
    rows = Rows(options.results / "printers.csv", KEY)
    if not options.table_only:
        files = sorted([*folder.glob("*.gcode.gz"), *folder.glob("*.bgcode")])
        wanted = [path for path in files if options.files in path.name and states_clearances(path)]
        run_missing(rows, [{"file": p.name, "limit_s": options.time_limit} for p in wanted], run)
    with (folder / "manifest.csv").open(newline="") as file:
        slicers = {r["name"]: f"{r['slicer']} {r['version']}" for r in csv.DictReader(file)}
    latest = {row["file"]: row for row in rows.rows}
    setting_said = setting(
        note=options.note, planner="hybrid", machine="none named", settings=SETTINGS_SAID,
        time_limit=f"{options.time_limit:g} s", seed=0,
    )  # fmt: skip
    text = f"# Prints without a machine file\n\n{setting_said}\n\n"
    text += "Repeat: `python benchmarks/printers.py"
    text += f" --time-limit {options.time_limit:g}`. Every file of the corpus that states "
    text += "clearances, planned without `--machine` and verified. A contour could move if the "
    text += "order constraints leave it free against a contour of another layer. Presets of Prusa "
    text += "printers are their real heads.\n\n"
    text += table(list(latest.values()), slicers)
    (options.results / "printers.md").write_text(text)


if __name__ == "__main__":
    main()
