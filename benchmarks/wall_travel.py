"""Travel over outer walls of whole files, with each `--avoid-walls`, against the source's.

    python benchmarks/wall_travel.py [--time-limit 5] [--files NAME]

Machine `mk4s` where the print fits it, else `paper`; files whose outer walls are not known say
nothing and are left out. Writes docs/results/wall_travel.csv (resumable, a row a file and choice)
and docs/results/wall_travel.md.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from common import RESULTS, Rows, corpus, markdown, measured, setting
from numpy.typing import NDArray

from decmcts.formats.gcode import read_gcode
from decmcts.formats.gcode.controller.motion import interpret
from decmcts.formats.gcode.text.lines import split_lines
from decmcts.formats.gcode.text.source_text import load_text
from sim.content.over_walls import wall_lines

KEY = ("file", "avoid_walls", "limit_s")
CHOICES = ("never", "auto", "always")
MACHINES = ("mk4s", "paper")
SHOWN = (("travel_over_walls_mm", 1), ("crossings", 0), ("file_time_s", 1), ("retractions", 0))
FIGURES = ("travel_over_walls_mm", "file_time_s", "retractions", "emitted_travel_mm")


def attempt(path: Path, choice: str, limit: float) -> dict[str, Any]:
    """Plan one file; the row has no figures where it is refused or its walls are not known."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.gcode"
        result: dict[str, Any] = {"exit": 2}
        for machine in MACHINES:
            if result["exit"]:
                result = measured(["plan", str(path), "-o", str(out), "--machine", machine,
                                   "--no-quality", "--time-limit", f"{limit:g}",
                                   "--avoid-walls", choice])  # fmt: skip
        before, after = result.get("before", {}), result.get("after", {})
        known = after.get("travel_over_walls_mm") is not None
        return {
            "file": path.name, "avoid_walls": choice, "limit_s": limit,
            "kept_source": result.get("kept_source", ""),
            **{f"{key}_before": before.get(key, "") if known else "" for key in FIGURES},
            **{f"{key}_after": after.get(key, "") if known else "" for key in FIGURES},
            "crossings_before": crossings(path, path) if known else "",
            "crossings_after": crossings(out, path) if known else "",
        }  # fmt: skip


def crossings(path: Path, source: Path) -> int:
    """Return how often travel moves of a file cross an outer wall of the layer printed next.

    However a travel is cut into moves, a wall crossed is counted once.
    """
    lines = split_lines(load_text(path), path)
    motion = interpret(lines)
    lays, across = motion.extrusion > 0.0, np.diff(motion.points[:, :2], axis=0).any(axis=1)
    beads = np.flatnonzero(lays & across)
    travels = np.flatnonzero((motion.extrusion == 0.0) & across)
    travels = travels[(travels > beads[0]) & (travels < beads[-1])]
    z = motion.points[1:, 2][beads[np.searchsorted(beads, travels)]]
    start, end = motion.points[travels, :2], motion.points[travels + 1, :2]
    walls, height, _ = wall_lines(read_gcode(source)[0].contours)
    leg, wall = shapely.STRtree(walls).query(
        shapely.linestrings(np.stack([start, end], axis=1)), predicate="crosses"
    )
    return int((np.abs(height[wall] - z[leg]) < 1e-6).sum())


def table(rows: list[dict[str, str]]) -> list[list[str]]:
    """Return a line a file: what of its travel leads over walls, and its time, by choice."""
    by = {(row["file"], row["avoid_walls"]): row for row in rows}
    lines = []
    for name in sorted({row["file"] for row in rows}):
        mine = [by[name, choice] for choice in CHOICES if (name, choice) in by]
        if len(mine) == len(CHOICES) and all(row["travel_over_walls_mm_after"] for row in mine):
            lines.append(
                [name, *(cell for key, digits in SHOWN for cell in figure(mine, key, digits))]
            )
    return lines


def figure(rows: list[dict[str, str]], key: str, digits: int) -> list[str]:
    """Return a figure of the source and of the result with each choice."""
    values = [rows[0][f"{key}_before"], *(row[f"{key}_after"] for row in rows)]
    return [f"{float(value):.{digits}f}" for value in values]


def summary(lines: list[list[str]]) -> str:
    """Return what the table says in short."""
    values = np.array([[float(cell) for cell in line[1:]] for line in lines])
    if not len(values):
        return "No file has been planned with each choice yet."
    over, crossed, seconds = values[:, 0:4], values[:, 4:8], values[:, 8:12]
    some, led, any_crossed = over[:, 1] > 0.0, over[:, 0] > 0.0, crossed[:, 1] > 0.0
    more = [int((over[:, k] > over[:, 0] + 0.05).sum()) for k in (1, 2)]
    longer, than_source = (100.0 * (seconds[:, 3] / seconds[:, k] - 1.0) for k in (1, 0))
    return (
        f"More travel over outer walls than in the source: with `never` {more[0]} of {len(lines)} "
        f"files, with `auto` {more[1]}. `always` against `never`: {less(over[some])} % less of it "
        f"in the median of {int(some.sum())} files, {less(crossed[any_crossed])} % fewer "
        f"crossings; {np.median(longer):+.2f} % time in the median of all, {longer.max():+.2f} % "
        f"at most. `always` against the source: {less(over[led], 0)} % less in the median of "
        f"{int(led.sum())} files, those that keep the source counted; "
        f"{np.median(than_source):+.2f} % time in the median, {than_source.max():+.2f} % at most."
    )


def less(values: NDArray[np.float64], than: int = 1) -> str:
    """Return by how many per cent `always` is below `never` in the median, or below column 0."""
    return f"{100.0 * np.median(1.0 - values[:, 3] / values[:, than]):.0f}" if len(values) else "0"


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
    names = ("over walls, mm", "walls crossed", "time, s", "retractions")
    head = ["file", *(f"{name}: {c}" for name in names for c in ("source", *CHOICES))]
    text = f"# Travel over outer walls\n\n{said}\n\nRepeat: `python benchmarks/wall_travel.py`. "
    text += "Of whole files: the length of travel moves that cross an outer wall of the layer "
    text += "printed last or next, seen from above; how often travels cross one of the layer "
    text += "printed next, however they are cut into moves; estimated time; how often filament is "
    text += f"pulled back. {summary(lines)}\n\n"
    (RESULTS / "wall_travel.md").write_text(text + markdown(lines, head))


if __name__ == "__main__":
    main()
