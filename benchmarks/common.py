"""What the benchmarks share: the corpus, one measured run of the program, resumable rows.

Every benchmark runs the installed command line as a user would, one process a
run, and appends one row a run to a CSV file, so that a long table can be made in
several sittings. Corpus: the environment variable DECMCTS_CORPUS, else ../shared
beside the checkout.
"""

from __future__ import annotations

import csv
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "docs" / "results"


def corpus() -> Path:
    """Return the corpus of real prints, or stop with one line saying it is absent."""
    path = Path(os.environ.get("DECMCTS_CORPUS", ROOT.parent / "shared"))
    if not (path / "models" / "gcode").is_dir():
        sys.exit(f"the corpus of real prints is not at {path}; set DECMCTS_CORPUS")
    return path


def setting(**chosen: Any) -> str:
    """Return one line that says what was run, where and with which versions."""
    names = ("decmcts", "numpy", "numba", "eclipse-zenoh", "python-fcl")
    versions = ", ".join(f"{name} {version(name)}" for name in names)
    told = ", ".join(f"{key} {value}" for key, value in chosen.items() if value != "")
    return (
        f"{told}; {versions}; Python {platform.python_version()}, {os.cpu_count()} cores, "
        f"{platform.machine()}, {time.strftime('%Y-%m-%d')}"
    )


def measured(arguments: list[str], *, timeout_s: float = 1800.0) -> dict[str, Any]:
    """Run `decmcts ARGUMENTS --json` in a process of its own.

    Returns its summary with `wall_s`, `peak_mib` (largest single process) and
    `exit`; a failed run has its one line of error under `error`.
    """
    command = [sys.executable, "-m", "decmcts.cli", *arguments, "--json"]
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        started = time.perf_counter()
        child = subprocess.Popen(command, stdout=out, stderr=err)
        deadline = started + timeout_s
        while True:
            pid, status, usage = os.wait4(child.pid, os.WNOHANG)
            if pid:
                break
            if time.perf_counter() > deadline:
                child.kill()
            time.sleep(0.05)
        wall = time.perf_counter() - started
        out.seek(0)
        err.seek(0)
        code = os.waitstatus_to_exitcode(status)
        row: dict[str, Any] = json.loads(out.read()) if code == 0 else {"error": last(err.read())}
    return {**row, "exit": code, "wall_s": wall, "peak_mib": usage.ru_maxrss / 1024}


def last(text: str) -> str:
    """Return the last non-empty line of a program's output."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "no message"


class Rows:
    """A CSV file of results, one row a run; a run that is there is not repeated."""

    def __init__(self, path: Path, key: tuple[str, ...]) -> None:
        self.path, self.key = path, key
        self.rows: list[dict[str, str]] = []
        self.read()

    def read(self) -> None:
        """Read the rows there are; several benchmarks may append to one file."""
        if self.path.exists():
            with self.path.open(newline="") as file:
                self.rows = list(csv.DictReader(file))

    def has(self, **key: Any) -> bool:
        """Say whether a run with this key was made already, by this process or another."""
        self.read()
        wanted = tuple(str(key[name]) for name in self.key)
        return any(tuple(row[name] for name in self.key) == wanted for row in self.rows)

    def append(self, row: dict[str, Any]) -> None:
        """Add one row at the end of the file at once."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        fresh = not self.path.exists()
        with self.path.open("a", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(row))
            if fresh:
                writer.writeheader()
            writer.writerow(row)
        self.rows.append({name: str(value) for name, value in row.items()})


def markdown(rows: list[list[str]], head: list[str]) -> str:
    """Return a Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"
