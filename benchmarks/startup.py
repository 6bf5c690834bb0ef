"""How long `decmcts plan` takes in all with a second of search: first run and later ones.

    python benchmarks/startup.py [--models four_nuts] [--repeats 5]

The first run has an empty cache of machine code and compiles; later ones go on from
there until all is compiled; the last one has an empty cache that cannot be written. Writes
docs/results/startup.csv (a row a run, with the seconds of each step) and startup.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from common import Rows, arguments, grouped, last, markdown, print_path, setting, spread

KEY = ("model", "limit_s", "cache", "repeat")
MOST_S = 5.0  # of a later run, in all
BEGINS_S = 30.0  # of a first run, until the search begins
STEPS = {
    "read": "reading",
    "graph": "dependency graph",
    "source": "the source's own order",
    "bound_first": "a first bound",
    "prepare": "preparing the search",
    "search": "searching (",
    "judge": "the source's own order, judged before anything is written",
    "schedule": "safe travels",
    "bound": "proving",
    "verify": "verifying",
    "write": "writing",
}
"""What the line of each step begins with, in the order of the run."""
COLUMNS = ("start_s", *(f"{name}_s" for name in STEPS), "search_begins_s")


def timed(command: list[str], environment: dict[str, str]) -> dict[str, Any]:
    """Run a command; return its wall time, and when each step was on the terminal."""
    started = time.perf_counter()
    child = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment, text=True
    )
    assert child.stderr is not None
    lines = [(time.perf_counter() - started, line) for line in child.stderr]
    code = child.wait()
    wall_s = time.perf_counter() - started
    said = "".join(line for _, line in lines)
    return {
        "wall_s": round(wall_s, 2),
        "first_word_s": round(lines[0][0], 2) if lines else "",
        **{name: round(seconds, 2) for name, seconds in step_seconds(lines, wall_s).items()},
        "error": "" if code == 0 else last(said),
    }


def step_seconds(lines: list[tuple[float, str]], wall_s: float) -> dict[str, float]:
    """Return how long each step of `STEPS` took, compiling for it included.

    And when the search began. What came before the first step is the start-up.
    """
    begins: dict[str, float] = {}
    for seconds, line in lines:
        for name, words in STEPS.items():
            if line.startswith(words):
                begins.setdefault(name, seconds)
    marks = sorted(begins.items(), key=lambda item: item[1])
    ends = [*(seconds for _, seconds in marks), wall_s][1:]
    found = {f"{name}_s": end - at for (name, at), end in zip(marks, ends, strict=True)}
    if "search" in begins:
        found["search_begins_s"] = begins["search"]
    if marks:
        found["start_s"] = marks[0][1]
    return {name: found.get(name, 0.0) for name in COLUMNS}


def measure(model: str, options: argparse.Namespace, rows: Rows) -> None:
    """Append the runs of one print, the first with an empty cache."""
    from decmcts.formats.gcode import read_gcode

    contours = len(read_gcode(print_path(model))[0].contours)
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "XDG_CACHE_HOME": folder}
        environment.pop("NUMBA_CACHE_DIR", None)
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has bytecode
        command = [sys.executable, "-m", "decmcts.cli", "plan", str(print_path(model))]
        command += ["-o", str(Path(folder) / "out.gcode"), "--machine", "paper", "--allow-slower"]
        command += ["--time-limit", f"{options.time_limit:g}"]
        runs = [("empty", 0), *(("warm", k + 1) for k in range(options.repeats)), ("read-only", 0)]
        for cache, repeat in runs:
            if (cache, repeat) == ("warm", 1):  # what the first run was too short for
                warm = [sys.executable, "-m", "decmcts.cli", "warm"]
                subprocess.run(warm, env=environment, check=True)
            if cache == "read-only":  # a file in the place of the folder: nobody can write there
                environment["XDG_CACHE_HOME"] = str(Path(folder) / "none")
                (Path(folder) / "none").write_text("")
            key = dict(zip(KEY, (model, options.time_limit, cache, repeat), strict=True))
            rows.append({**key, "contours": contours, **timed(command, environment)})
            print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)


def table(rows: list[dict[str, str]]) -> str:
    lines = []
    for (model, cache), mine in grouped(rows, "model", "cache").items():
        wall = [float(r["wall_s"]) for r in mine]
        words = [float(r["first_word_s"]) for r in mine]
        second = ("yes" if wall[0] <= MOST_S else "NO") if cache == "warm" else ""
        lines.append([model, mine[0]["contours"], cache, str(len(mine)), f"{wall[0]:.2f}",
                      spread(wall, 2), spread(words, 2), second])  # fmt: skip
    head = ["print", "contours", "cache", "runs", "first of them, s", "all, s", "first word, s",
            f"at most {MOST_S:g} s"]  # fmt: skip
    return markdown(lines, head)


def step_table(rows: list[dict[str, str]]) -> str:
    """Return the medians of the steps, and whether the search began soon enough."""
    lines = []
    for (model, cache), mine in grouped(rows, "model", "cache").items():
        medians = [median(float(r.get(name) or 0.0) for r in mine) for name in COLUMNS]
        soon = "yes" if medians[-1] <= BEGINS_S else "NO"
        lines.append([model, cache, *(f"{value:.1f}" for value in medians), soon])
    names = [name.removesuffix("_s").replace("_", " ") for name in COLUMNS]
    return markdown(lines, ["print", "cache", *names, f"at most {BEGINS_S:g} s"])


def main() -> None:
    parser = arguments(__doc__, time_limit=1.0, models="four_nuts,spool_edges_4")
    parser.add_argument("--repeats", type=int, default=5, help="runs with the cache filled")
    options = parser.parse_args()
    rows = Rows(options.results / "startup.csv", KEY)
    for model in [] if options.table_only else options.models:
        last_run = dict(zip(KEY, (model, options.time_limit, "warm", options.repeats), strict=True))
        if not rows.has(**last_run):
            measure(model, options, rows)
    mine = [r for r in rows.rows if float(r["limit_s"]) == options.time_limit]
    said = setting(
        note=options.note,
        time_limit=f"{options.time_limit:g} s",
        machine="paper",
        options="the defaults",
        seed=0,
    )
    text = f"# Start-up\n\n{said}\n\nRepeat: `python benchmarks/startup.py`. Wall time of the "
    text += "whole of `decmcts plan PRINT -o OUT`, from start to exit, in seconds: reading, "
    text += "search, proof of the bound, verification and writing. First word: when something "
    text += "was on the terminal. Of several runs the median and quartiles.\n\n" + table(mine)
    text += "\nSeconds of each step, compiling for it included, and when the search began. "
    text += "Before the first warm run `decmcts warm` compiles the rest. With an empty cache the "
    text += "source's own order is judged beside the search (judge: what of that is left when "
    text += "the search is over).\n\n" + step_table(mine)
    (options.results / "startup.md").write_text(text)


if __name__ == "__main__":
    main()
