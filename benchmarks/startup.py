"""How long `decmcts plan` takes in all with a second of search: first run and later ones.

    python benchmarks/startup.py [--models four_nuts] [--repeats 5]

The first run has an empty cache of machine code and compiles; the second finds it
there. Writes docs/results/startup.csv (a row a run) and startup.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from common import Rows, arguments, grouped, last, markdown, print_path, setting, spread

KEY = ("model", "limit_s", "cache", "repeat")
MOST_S = 5.0  # of a later run, in all


def timed(command: list[str], environment: dict[str, str]) -> dict[str, Any]:
    """Run a command; return its wall time and when it first said something."""
    started = time.perf_counter()
    child = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment
    )
    assert child.stderr is not None
    said = child.stderr.readline()
    first = time.perf_counter() - started
    said += child.stderr.read()
    code = child.wait()
    return {
        "wall_s": round(time.perf_counter() - started, 2),
        "first_word_s": round(first, 2),
        "error": "" if code == 0 else last(said.decode()),
    }


def measure(model: str, options: argparse.Namespace, rows: Rows) -> None:
    """Append the runs of one print, the first with an empty cache."""
    from decmcts.formats.gcode import read_gcode

    contours = len(read_gcode(print_path(model))[0].contours)
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "XDG_CACHE_HOME": folder}
        environment.pop("NUMBA_CACHE_DIR", None)
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has bytecode
        command = [sys.executable, "-m", "decmcts.cli", "plan", str(print_path(model))]
        command += ["-o", str(Path(folder) / "out.gcode")]
        command += ["--time-limit", f"{options.time_limit:g}"]
        for repeat in range(options.repeats + 1):
            key = dict(zip(KEY, (model, options.time_limit, "warm" if repeat else "empty", repeat),
                           strict=True))  # fmt: skip
            rows.append({**key, "contours": contours, **timed(command, environment)})
            print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)


def table(rows: list[dict[str, str]]) -> str:
    lines = []
    for (model, cache), mine in grouped(rows, "model", "cache").items():
        wall = [float(r["wall_s"]) for r in mine]
        words = [float(r["first_word_s"]) for r in mine]
        second = "" if cache == "empty" else ("yes" if wall[0] <= MOST_S else "NO")
        lines.append([model, mine[0]["contours"], cache, str(len(mine)), f"{wall[0]:.2f}",
                      spread(wall, 2), spread(words, 2), second])  # fmt: skip
    head = ["print", "contours", "cache", "runs", "first of them, s", "all, s", "first word, s",
            f"at most {MOST_S:g} s"]  # fmt: skip
    return markdown(lines, head)


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
        note=options.note, time_limit=f"{options.time_limit:g} s", options="the defaults", seed=0
    )
    text = f"# Start-up\n\n{said}\n\nRepeat: `python benchmarks/startup.py`. Wall time of the "
    text += "whole of `decmcts plan PRINT -o OUT`, from start to exit, in seconds: reading, "
    text += "search, proof of the bound, verification and writing. First word: when something "
    text += "was on the terminal. Of several runs the median and quartiles.\n\n" + table(mine)
    (options.results / "startup.md").write_text(text)


if __name__ == "__main__":
    main()
