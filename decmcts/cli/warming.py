"""`decmcts warm`: everything compiled ahead, by two processes, with progress."""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack

import typer

from decmcts.cli.ahead import all_parts, cache_line, is_compiled
from decmcts.cli.app import app
from decmcts.cli.console import err, out, steps
from decmcts.jit.store import cache_home, remove_unused

WORKERS = 2


@app.command()
def warm() -> None:
    """Compile everything ahead of need; takes minutes once, and nothing when it is done."""
    parts = all_parts()
    missing = [part for part in parts if not is_compiled(part)]
    for folder in remove_unused(cache_home()):
        err.print(f"removed {folder}, unused for 30 days", soft_wrap=True)
    with steps() as (announce, _):
        done = len(parts) - len(missing)
        if missing:
            announce(f"compiling: {done} of {len(parts)} parts are done")
        for part in _made(missing):
            done += 1
            announce(f"compiling: {done} of {len(parts)} parts are done, last: {part}")
    left = [part for part in parts if not is_compiled(part)]
    if left:
        err.print(f"not compiled, or not kept: {', '.join(left)}", soft_wrap=True)
        raise typer.Exit(1)
    out.print(cache_line(), soft_wrap=True)


def _made(missing: list[str]) -> Iterator[str]:
    """Yield each part as it is done; one process begins at the front, the other at the end."""
    if not missing:
        return
    said: queue.Queue[str | None] = queue.Queue()
    with ExitStack() as stack:
        for worker in range(WORKERS):
            order = missing if worker == 0 else missing[::-1]
            command = [sys.executable, "-m", "decmcts.cli.warm", *order]
            child = stack.enter_context(
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            )
            stack.callback(child.kill)
            threading.Thread(target=_pass_on, args=(child, said), daemon=True).start()
        yield from _each_once(said)


def _pass_on(child: subprocess.Popen[str], said: queue.Queue[str | None]) -> None:
    assert child.stdout is not None
    for line in child.stdout:
        said.put(line.strip())
    said.put(None)


def _each_once(said: queue.Queue[str | None]) -> Iterator[str]:
    seen: set[str] = set()
    ended = 0
    while ended < WORKERS:
        part = said.get()
        if part is None:
            ended += 1
        elif part not in seen:
            seen.add(part)
            yield part
