"""Declares the commands and turns every failure into one clear line.

Exit codes: 0 done, 1 the result or the checked file has faults, 2 the input
cannot be used, 70 an internal error (a traceback only with `--debug`).
"""

from __future__ import annotations

import contextlib
import gzip
import os
import signal
import sys
import threading
import traceback
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import typer

from agents.supervisor import LaunchError
from decmcts import __version__
from decmcts.errors import InputError, VerificationError

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Finds a better, proven-safe order for the extrusions of a 3D print.",
)


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"decmcts {__version__}")
        raise typer.Exit


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    """Options of every command."""
    if debug:
        os.environ["DECMCTS_DEBUG"] = "1"


@contextlib.contextmanager
def interrupt_stops() -> Iterator[Callable[[], bool]]:
    """Let the first Ctrl-C end the search, not the program; yields `stop()`."""
    stopped = threading.Event()

    def on_interrupt(_signal: int, _frame: object) -> None:
        if stopped.is_set():
            raise KeyboardInterrupt
        stopped.set()

    if threading.current_thread() is not threading.main_thread():
        yield stopped.is_set
        return
    previous = signal.signal(signal.SIGINT, on_interrupt)
    try:
        yield stopped.is_set
    finally:
        signal.signal(signal.SIGINT, previous)


def guess_machine(path: Path) -> str | None:
    """Return the preset of the printer the environment or the file names, if any."""
    from decmcts.formats.machine_file import preset_for_printer

    named = os.environ.get("SLIC3R_PRINTER_MODEL", "")
    return preset_for_printer(named) if named else preset_for_printer(printer_model_of(path))


def printer_model_of(path: Path) -> str:
    """Return the `printer_model` that a PrusaSlicer-like file names in its comments, or ''."""
    try:
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            text = file.read()
    except (OSError, EOFError, zlib.error):
        return ""  # the reader will say what is wrong with it
    at = text.rfind(b"; printer_model = ")
    if at < 0:
        return ""
    return text[at + 18 : text.find(b"\n", at)].decode("latin-1").strip()


def main() -> None:
    """Run the command line; every failure is one line on standard error."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code."""
    from decmcts.cli.console import err

    try:
        app(args=arguments, prog_name="decmcts")
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else 0
    except (InputError, VerificationError, LaunchError) as error:
        return _failed(error, 2 if isinstance(error, InputError) else 1)
    except KeyboardInterrupt:
        err.print("decmcts: stopped; nothing was written")
        return 130
    except OSError as error:
        return _failed(error, 2)
    except Exception as error:
        if not os.environ.get("DECMCTS_DEBUG"):
            err.print(
                f"decmcts: internal error: {type(error).__name__}: {error}; nothing was written; "
                "run again with --debug for the traceback",
                soft_wrap=True,
                markup=False,
            )
            return 70
        traceback.print_exc()
        return 70
    return 0


def _failed(error: Exception, code: int) -> int:
    from decmcts.cli.console import err

    if os.environ.get("DECMCTS_DEBUG"):
        traceback.print_exc()
    err.print(f"decmcts: {error}", soft_wrap=True, markup=False)
    return code


# The commands register themselves on `app`; imported last because they need it.
from decmcts.cli import check, plan, post, team  # noqa: E402, F401  # registration needs `app`
