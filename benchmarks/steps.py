"""Wall and CPU time of `plan`, `post` and `launch`, step by step, from the events they report.

    python benchmarks/steps.py [--commands plan,post,launch] [--models four_nuts,…] [--json]

Three prints of about 1 000, 15 000 and 44 000 contours: an example of this project and two
models of the corpus, or prints made by code where there is no corpus (`made_15000`). Each run
is a process of its own, with all kernels compiled (`decmcts warm`). CPU time is that of the
process and of what it has started and ended: on a busy machine it says more than wall time.
Silence is the longest time without a word. Writes docs/results/steps.csv (a row a step) and
steps.md.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from common import Rows, arguments, corpus, grouped, markdown, names, own_process, setting
from common import print_path as found_path
from large import gcode

from decmcts import Search, TeamSearch, launch, plan, read
from decmcts.formats.machines.machine_file import load_machine
from decmcts.planning.events import Event, Heads, Step
from decmcts.planning.launch import crew_started

MODELS = "four_nuts,branches_16,spiral_cup"
MADE = {"branches_16": "made_15000", "spiral_cup": "made_44000"}  # where there is no corpus
MACHINES = {"plan": "mk4s", "post": "mk4s", "launch": "dual-gantry"}
KEY = ("command", "model", "limit_s", "place")
MOST_S = {"around": 30.0, "launch": 60.0}  # all steps around the search; `launch` in all
SEARCHES = ("searching", "an order for one head alone", "heads plan")


class Clock:
    """Wall and CPU time of each step, and the longest silence; a report of events."""

    def __init__(self) -> None:
        self.steps: list[tuple[str, float, float]] = []  # what, wall and CPU time it began at
        self.silence_s = 0.0
        self._heard_s = time.perf_counter()

    def __call__(self, event: Event) -> None:
        """Hear an event."""
        now = time.perf_counter()
        self.silence_s, self._heard_s = max(self.silence_s, now - self._heard_s), now
        if isinstance(event, Step):
            self.begin(event.text.split(": compiling")[0])
        elif isinstance(event, Heads):
            self.begin("heads plan")

    def begin(self, text: str) -> None:
        """Begin a step, unless it has begun already."""
        if not self.steps or self.steps[-1][0] != text:
            self.steps.append((text, time.perf_counter(), _cpu_s()))

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each step that took a tenth of a second or more."""
        self.begin("")
        return [
            {"step": text, "wall_s": round(wall - at, 2), "cpu_s": round(cpu - spent, 2)}
            for (text, at, spent), (_, wall, cpu) in zip(self.steps, self.steps[1:], strict=False)
            if wall - at >= 0.1
        ]


def _cpu_s() -> float:
    times = os.times()
    return float(times.user + times.system + times.children_user + times.children_system)


def timed(command: str, path: Path, limit_s: float, folder: Path) -> dict[str, Any]:
    """Run one command on a print; return its steps, contours and longest silence."""
    clock = Clock()
    clock.begin("reading")
    if command == "launch":  # as the command does: processes load while the print is read
        with crew_started(len(load_machine(MACHINES[command]).heads)) as crew:
            source = read(path, MACHINES[command], report=clock)
            result = launch(source, TeamSearch(limit_s), report=clock, crew=crew)
    else:
        source = read(path, MACHINES[command], report=clock)
        result = plan(source, Search(limit_s, certificate=command == "plan"), report=clock)
    clock.begin("writing")
    result.write_gcode(path if command == "post" else folder / "out.gcode", report=clock)
    steps = clock.rows()
    return {"contours": len(source.job.contours), "silence_s": clock.silence_s, "steps": steps}


def place_of(model: str, folder: Path) -> Path:
    """Return a plain G-code file of a print in a folder."""
    out = folder / f"{model}.gcode"
    if model.startswith("made_"):
        out.write_text("".join(gcode(int(model.removeprefix("made_")))))
        return out
    from decmcts.formats.gcode.text.source_text import load_text

    out.write_bytes(load_text(found_path(model)))
    return out


def known_models(models: list[str]) -> list[str]:
    """Return the prints there are: those made by code in the place of the corpus' own."""
    try:
        corpus()
    except SystemExit:
        return [MADE.get(model, model) for model in models]
    return models


def measure(command: str, model: str, limit_s: float, rows: Rows) -> None:
    """Append the steps of one run, made in a process of its own."""
    one = [sys.executable, __file__, "--one", command, "--models", model]
    found = own_process([*one, "--time-limit", f"{limit_s:g}"])
    key = {"command": command, "model": model, "limit_s": limit_s}
    steps = found.get("steps") or [{"step": "", "wall_s": 0.0, "cpu_s": 0.0}]
    for place, step in enumerate(steps):
        more = {name: found.get(name, "") for name in ("contours", "silence_s", "peak_mib")}
        rows.append({**key, "place": place, **step, **more, "error": found.get("error", "")})
    print(command, model, *(f"{s['step']}={s['cpu_s']}" for s in steps), flush=True)


def table(rows: list[dict[str, str]]) -> str:
    """Return a line for each run: in all, around the search, silence and memory."""
    lines = []
    for (command, model, _), mine in grouped(rows, "command", "model", "limit_s").items():
        around = [r for r in mine if not r["step"].startswith(SEARCHES)]
        wall, cpu = (sum(float(r[name]) for r in mine) for name in ("wall_s", "cpu_s"))
        aside_wall, aside = (sum(float(r[n]) for r in around) for n in ("wall_s", "cpu_s"))
        lines.append(
            [command, model, mine[0]["contours"], f"{wall:.1f}", f"{cpu:.1f}", f"{aside_wall:.1f}",
             f"{aside:.1f}", "yes" if aside <= MOST_S["around"] else "NO",
             f"{float(mine[0]['silence_s']):.1f}", f"{float(mine[0]['peak_mib']):.0f}"]
        )  # fmt: skip
    head = ["command", "print", "contours", "all, s", "CPU s", "around the search, s", "CPU s",
            f"at most {MOST_S['around']:g} CPU s", "longest silence, s", "MiB"]  # fmt: skip
    return markdown(lines, head)


def step_table(rows: list[dict[str, str]]) -> str:
    """Return a line for each step of each run."""
    lines = [
        [r["command"], r["model"], r["step"], r["wall_s"], r["cpu_s"]]
        for r in rows
        if not r["error"]
    ]
    return markdown(lines, ["command", "print", "step", "s", "CPU s"])


def main() -> None:
    parser = arguments(__doc__, time_limit=10.0, models=MODELS)
    parser.add_argument("--commands", type=names, default=names("plan,post,launch"))
    parser.add_argument("--json", action="store_true", help="also print all rows as JSON")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        with tempfile.TemporaryDirectory() as folder:
            path = place_of(options.models[0], Path(folder))
            print(json.dumps(timed(options.one, path, options.time_limit, Path(folder))))
        return
    rows = Rows(options.results / "steps.csv", KEY)
    for model in [] if options.table_only else known_models(options.models):
        for command in options.commands:
            if not rows.has(command=command, model=model, limit_s=options.time_limit, place=0):
                measure(command, model, options.time_limit, rows)
    rows.read()
    said = setting(time_limit=f"{options.time_limit:g} s", note=options.note)
    if options.json:
        print(json.dumps(rows.rows, indent=1))
    (options.results / "steps.md").write_text(
        f"# Steps\n\n{said}\n\nRepeat: `python benchmarks/steps.py`. Machines: `mk4s`, and "
        "`dual-gantry` for `launch`. `post` does not prove a bound. The search is what "
        f"`--time-limit` is for, the heads' planning included.\n\n{table(rows.rows)}\n"
        f"Steps of a tenth of a second or more.\n\n{step_table(rows.rows)}{rows.failures()}"
    )


if __name__ == "__main__":
    main()
