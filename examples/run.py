#!/usr/bin/env python3
"""Sets everything up and runs the two-head demo, or the tests, on a bare machine.

    python3 examples/run.py demo     # leaves G-code, plan and pictures in ./out
    python3 examples/run.py tests    # lint, types, import rules, tests

`tests` is `checks` and then `suite`; `long` runs the tests that `suite` leaves out.

Needs Python >= 3.11 with venv and a network for the first run; uses the standard
library only, because nothing else is installed yet.
"""

from __future__ import annotations

import os
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ENVIRONMENT = ROOT / ".venv"
BIN = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")
# Each process imports hundreds of files; that they are compiled once saves a third of its start.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def run(*command: str | Path) -> None:
    """Run a command in the project's folder and stop at the first failure."""
    print("+", *command, flush=True)
    code = subprocess.call([str(part) for part in command], cwd=ROOT)
    if code:
        sys.exit(code)


def set_up(extras: str) -> None:
    """Make the virtual environment and install the project and what it needs."""
    if sys.version_info < (3, 11):  # noqa: UP036  # this file runs before anything is installed
        sys.exit(f"decmcts needs Python 3.11 or later, this is {sys.version.split()[0]}")
    if not (BIN / "python").exists() and not (BIN / "python.exe").exists():
        venv.create(ENVIRONMENT, with_pip=True)
    # Pip would compile all files there are, which takes as long as all else it does.
    run(BIN / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check",
        "--no-compile", "--editable", f".{extras}")  # fmt: skip


def demo() -> None:
    """Plan the example plate for two heads, each its own process."""
    set_up("")
    run(BIN / "python", "-m", "decmcts.cli", "demo", "--out", "out")


def checks() -> None:
    """Install all that tests need, check what is written, and compile the kernels beside it."""
    set_up("[dev,docs]")
    python = BIN / "python"
    with subprocess.Popen([str(python), "-m", "decmcts.cli", "warm"], cwd=ROOT) as warm:
        try:
            run(python, "-m", "ruff", "check", ".")
            run(python, "-m", "ruff", "format", "--check", ".")
            run(python, "-m", "mypy")
            run(BIN / "lint-imports")
        except BaseException:
            warm.terminate()
            raise
    if warm.returncode:
        sys.exit(warm.returncode)


def pytest(marked: str) -> None:
    """Run the tests marked so, on two cores; what tests of a file share is made once."""
    run(BIN / "python", "-m", "pytest", "-m", marked, "-n", "2", "--dist", "worksteal")


def suite() -> None:
    """Run the tests, once `checks` has run."""
    pytest("not slicers and not long")


def long() -> None:
    """Run the tests of rare things that take long."""
    pytest("long and not slicers")


def tests() -> None:
    """Check what is written and run the tests."""
    checks()
    suite()


if __name__ == "__main__":
    commands = {"demo": demo, "tests": tests, "checks": checks, "suite": suite,
                "long": long}  # fmt: skip
    if len(sys.argv) != 2 or sys.argv[1] not in commands:
        sys.exit(f"usage: python3 examples/run.py {'|'.join(commands)}")
    commands[sys.argv[1]]()
