"""What the benchmarks share: the corpus, one measured run of the program, resumable rows.

Every benchmark runs the installed command line as a user would, one process a
run, and appends one row a run to a CSV file, so that a long table can be made in
several sittings; to repeat a run, delete its row. Corpus: the environment variable
DECMCTS_CORPUS, else ../shared beside the checkout; `four_nuts` and `plate` are
examples of this project and need none.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from importlib.metadata import version
from pathlib import Path
from typing import Any

from decmcts.experiments import kinds
from decmcts.experiments.kinds import grouped, markdown, median, spread
from decmcts.samples import SAMPLES

__all__ = ["grouped", "markdown", "median", "spread"]

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "docs" / "results"


def corpus() -> Path:
    """Return the corpus of real prints, or stop with one line saying it is absent."""
    path = Path(os.environ.get("DECMCTS_CORPUS", ROOT.parent / "shared"))
    if not (path / "models" / "gcode").is_dir():
        sys.exit(f"the corpus of real prints is not at {path}; set DECMCTS_CORPUS")
    return path


def print_path(name: str) -> Path:
    """Return the file of a print: an example of this project, or a model of the corpus."""
    example = SAMPLES / f"{name}.gcode.gz"
    return example if example.is_file() else corpus() / "models" / "gcode" / f"{name}.gcode.gz"


def arguments(
    description: str | None, *, time_limit: float, models: str
) -> argparse.ArgumentParser:
    """Return a parser of the options all benchmarks share."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--time-limit", type=float, default=time_limit, help="seconds a search")
    parser.add_argument("--models", type=names, default=names(models), help="NAME,NAME,…")
    parser.add_argument("--seeds", type=seeds, default=[0], help="SEED,SEED,…")
    parser.add_argument("--table-only", action="store_true", help="run nothing")
    parser.add_argument("--note", default="", help="said beside the setting")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder that is written")
    return parser


def names(text: str) -> list[str]:
    """Return the words of a list with commas or blanks."""
    return text.replace(",", " ").split()


def seeds(text: str) -> list[int]:
    """Return the numbers of a list with commas."""
    return [int(word) for word in names(text)]


def of_models(rows: Iterable[dict[str, str]], all_models: str) -> str:
    """Return ` --models …` as a repeated command needs it, nothing for none or the usual ones."""
    there = list(dict.fromkeys(row["model"] for row in rows))
    return "" if set(there) in (set(), set(names(all_models))) else f" --models {','.join(there)}"


def setting(**chosen: Any) -> str:
    """Return one line that says what was run, where and with which versions."""
    names = ("decmcts", "numpy", "numba", "eclipse-zenoh", "python-fcl")
    versions = ", ".join(f"{name} {version(name)}" for name in names)
    told = ", ".join(f"{key} {value}" for key, value in chosen.items() if value != "")
    return (
        f"{told}; {versions}; Python {platform.python_version()}, {os.cpu_count()} cores, "
        f"{platform.machine()}, {time.strftime('%Y-%m-%d')}"
    )


CPU_TIME = "processor time of the search (cpu_time.py)"  # what seconds are, for `setting`


def measured(
    arguments: list[str],
    *,
    timeout_s: float = 1800.0,
    cpu_time: bool = False,
    environment: dict[str, str] | None = None,
) -> dict[str, Any]:
    """Run `decmcts ARGUMENTS --json` in a process of its own, see `own_process`.

    With `cpu_time` the search is timed by its work (`cpu_time.py`).
    """
    program = [str(Path(__file__).parent / "cpu_time.py")] if cpu_time else ["-m", "decmcts.cli"]
    command = [sys.executable, *program, *arguments, "--json"]
    return own_process(command, timeout_s=timeout_s, environment=environment)


def own_process(
    command: list[str], *, timeout_s: float = 1800.0, environment: dict[str, str] | None = None
) -> dict[str, Any]:
    """Run a command that prints one JSON object, in a process of its own.

    Returns that object with `wall_s`, `peak_mib` (largest single process) and
    `exit`; a failed run has its one line of error under `error`.
    """
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        started = time.perf_counter()
        child = subprocess.Popen(
            command, stdout=out, stderr=err, env={**os.environ, **(environment or {})}
        )
        deadline = started + timeout_s
        while True:
            pid, status, usage = os.wait4(child.pid, os.WNOHANG)
            if pid:
                break
            if time.perf_counter() > deadline:
                child.kill()
            time.sleep(0.05)
        child.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - started
        out.seek(0)
        err.seek(0)
        if child.returncode == 0:
            row: dict[str, Any] = json.loads(out.read())
        else:
            row = {"error": last(err.read())}
    return {**row, "exit": child.returncode, "wall_s": wall, "peak_mib": usage.ru_maxrss / 1024}


def last(text: str) -> str:
    """Return the last non-empty line of a program's output."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "no message"


Run = Callable[[dict[str, Any]], dict[str, Any]]


class Rows(kinds.Rows):
    """Rows of a benchmark, which asks run by run and says in the end which failed."""

    def has(self, **key: Any) -> bool:
        """Say whether a run with this key was made already, by this process or another."""
        return not self.missing([key])

    def failures(self) -> str:
        """Return a Markdown section on the runs that failed and were not made since, or nothing."""
        made = {self.key_of(row) for row in self.rows if not row["error"]}
        failed = {self.key_of(row): row["error"] for row in self.rows if row["error"]}
        lines = [f"- {' '.join(key)}: {failed[key]}\n" for key in failed if key not in made]
        return "\n## Failed\n\n" + "".join(lines) if lines else ""


def run_missing(rows: Rows, keys: Iterable[dict[str, Any]], run: Run, *, jobs: int = 1) -> None:
    """Make the runs that are not there yet, `jobs` at a time, a row each as they end."""
    missing = rows.missing(keys)
    with ThreadPoolExecutor(jobs) as pool:
        try:
            for done in as_completed([pool.submit(run, key) for key in missing]):
                rows.append(done.result())
                print(*(f"{k}={v}" for k, v in rows.rows[-1].items()), flush=True)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def in_groups(items: Sequence[Any], size: int) -> Iterator[Sequence[Any]]:
    """Yield the items, `size` at a time."""
    for first in range(0, len(items), size):
        yield items[first : first + size]
