"""Two processes that compile everything between them."""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack

WORKERS = 2


def made(missing: Sequence[str]) -> Iterator[str]:
    """Yield each part as it is done; one process begins at the front, the other at the end."""
    if not missing:
        return
    lines: queue.Queue[str | None] = queue.Queue()
    with ExitStack() as stack:
        for worker in range(WORKERS):
            order = missing if worker == 0 else missing[::-1]
            command = [sys.executable, "-P", "-m", "decmcts.planning.warm", *order]
            child = stack.enter_context(
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            )
            stack.callback(child.kill)
            threading.Thread(target=_pass_on, args=(child, lines), daemon=True).start()
        yield from _each_once(lines)


def _pass_on(child: subprocess.Popen[str], lines: queue.Queue[str | None]) -> None:
    """Put each line a child prints into the queue, and None when it has ended."""
    assert child.stdout is not None
    for line in child.stdout:
        lines.put(line.strip())
    lines.put(None)


def _each_once(lines: queue.Queue[str | None]) -> Iterator[str]:
    """Yield each part the first time a worker names it, until all workers have ended."""
    seen: set[str] = set()
    ended = 0
    while ended < WORKERS:
        part = lines.get()
        if part is None:
            ended += 1
        elif part not in seen:
            seen.add(part)
            yield part
