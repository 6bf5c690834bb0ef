"""Runs one command and turns every failure into one clear line.

Exit codes: 0 done, 1 the result or the checked file has faults, 2 the input
cannot be used, 70 an internal error (a traceback only with `--debug`), 130, 143
and 129 stopped by Ctrl-C, SIGTERM and SIGHUP before there was a result.
"""

from __future__ import annotations

import os
import threading
import traceback
from collections.abc import Callable

from typer.exceptions import TyperException

from decmcts.cli import (
    commands,  # noqa: F401 - it registers them
    signals,
)
from decmcts.cli.console import err
from decmcts.cli.options import app
from decmcts.errors import InputError, VerificationError

STOPPED = 130  # what typer makes of a KeyboardInterrupt


def run(arguments: list[str], *, program: Callable[..., object] = app) -> int:
    """Run one command of a program and return its exit code."""
    signals.forget()
    threading.excepthook = _thread_failed
    try:
        code = program(args=arguments, prog_name="decmcts", standalone_mode=False)
    except TyperException as error:
        usage = _usage(error)
        return _failed(usage, 2) if usage else 2
    except (InputError, VerificationError) as error:
        return _failed(error, 2 if isinstance(error, InputError) else 1)
    except OSError as error:
        return _failed(_in_words(error), 2)
    except MemoryError:
        return _failed("out of memory; no file was left half written", 70)
    except Exception as error:
        if signals.is_ending():  # compiled code that a signal came into turns it into another error
            return _stopped()
        return _failed(
            f"internal error: {type(error).__name__}: {error}; no file was left "
            "half written; `decmcts --debug COMMAND` shows the traceback",
            70,
        )
    if code == STOPPED:
        return _stopped()
    return code if isinstance(code, int) else 0


def _thread_failed(failed: threading.ExceptHookArgs) -> None:
    """Show what ended a thread, on the console as all else."""
    if failed.exc_value is not None:
        text = "".join(traceback.format_exception(failed.exc_value))
        err.show(f"decmcts: a thread failed\n{text}")


def _stopped() -> int:
    """Say that the program was stopped; return its exit code."""
    return _failed("stopped; no file was left half written", signals.exit_code())


def _in_words(error: OSError) -> str:
    """Return what the system refused, without its number."""
    if error.strerror is None:
        return str(error)
    return error.strerror if error.filename is None else f"{error.filename}: {error.strerror}"


def _usage(error: TyperException) -> str:
    """Return what is wrong with the command line, and where help is; '' when that was shown."""
    if not error.format_message():
        return ""  # help was shown
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "decmcts"
    text = error.format_message().rstrip(".").replace("Value error, ", "")
    return f"{text}; `{command} --help` lists what there is"


def _failed(error: Exception | str, code: int) -> int:
    """Say what failed in one line; with --debug also where."""
    if os.environ.get("DECMCTS_DEBUG"):
        err.show(traceback.format_exc())  # it may hold what a file does
    err.show(" ".join(f"decmcts: {error}".split()))
    return code
