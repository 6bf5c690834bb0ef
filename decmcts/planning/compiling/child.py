"""Compiling in processes beside this one, and reporting what this process compiles itself.

See docs/adr/0007-compiled-at-first-use.md.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from decmcts.jit import Store
from decmcts.jit.kernel import reported_to
from decmcts.jit.store import cache_home, remove_unused
from decmcts.planning.compiling.parts import FOLDERS, how_far, is_compiled
from decmcts.planning.events import Event, Note, Report, Step

StartChild = Callable[[Sequence[str]], "subprocess.Popen[bytes]"]
"""Starts a process that compiles these parts."""

POLL_S = 0.1
EVERY_S = 3.0  # at least so long between two reports of what is compiled

_reported: list[str] = []  # why the cache cannot be written, once that was reported
_beside: list[str] = []  # parts that are being compiled in another process
_children: list[subprocess.Popen[bytes]] = []  # that process


def compiled_beside(part: str) -> bool:
    """Say whether a part is being compiled in another process this one started."""
    return part in _beside


def start_compiling(parts: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a process that compiles parts; it ends with this one."""
    command = [sys.executable, "-P", "-m", "decmcts.planning.warm", *parts]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet)


@contextmanager
def compiling_beside(
    parts: Sequence[str], report: Report, *, start: StartChild = start_compiling
) -> Iterator[None]:
    """Compile parts in a process beside the body of a `with`, if any is missing.

    That process ends with the body, or with this process if that is killed. Within the body of
    another `compiling_beside` it replaces the other's process, unless that compiles these parts
    already.
    """
    within = bool(_children)
    try:
        _compile_beside(parts, report, start)
        yield
    finally:
        if not within:
            _end_child()


def _compile_beside(parts: Sequence[str], report: Report, start: StartChild) -> None:
    missing = [part for part in parts if not is_compiled(part)]
    if all(map(compiled_beside, missing)):
        return
    _end_child()
    remove_unused(cache_home())
    for folder in FOLDERS:
        Store(folder).prepare()  # if it has to be a temporary one, the child must find it
    report_if_unwritable(report)
    _children.append(start(missing))
    _beside.extend(missing)


def finish_beside(part: str, report: Report) -> None:
    """Wait until a part that is compiled beside this process is complete, or cannot be."""
    reported_at = -EVERY_S
    while compiled_beside(part) and not is_compiled(part) and _children[-1].poll() is None:
        if time.monotonic() - reported_at >= EVERY_S:
            reported_at = time.monotonic()
            report(Step(f"compiling {part}, once on this machine; {how_far()}"))
        time.sleep(POLL_S)


def _end_child() -> None:
    """End the process that compiles beside this one, if there is one."""
    _beside.clear()
    while _children:
        with _children.pop() as child:
            child.kill()


@contextmanager
def compilation_reported(report: Report) -> Iterator[Report]:
    """Report each kernel that this process compiles within the body, with the step it is for.

    Yields the report to use in the body: it passes events on and takes note of the step.
    """
    step, reported_at = "", 0.0

    def passed_on(event: Event) -> None:
        nonlocal step, reported_at
        report(event)
        if isinstance(event, Step):
            step, reported_at = event.text, 0.0  # set last: another thread may be compiling

    def compiles(name: str) -> None:
        nonlocal reported_at
        report_if_unwritable(report)
        now = time.monotonic()
        if now - reported_at >= EVERY_S:
            reported_at = now
            report(Step(f"{step}: compiling {name}, once on this machine; {how_far()}"))

    with reported_to(compiles):
        yield passed_on


def report_if_unwritable(report: Report) -> None:
    """Report, once a run, that the cache cannot be written and what that costs."""
    if Store.unwritable is None or _reported:
        return
    _reported.append(str(Store.unwritable))
    report(
        Note(
            f"the cache of machine code cannot be written ({Store.unwritable}): what is missing "
            "is compiled in every run; set XDG_CACHE_HOME to a folder that can be written"
        )
    )


def made(missing: Sequence[str]) -> Iterator[str]:
    """Yield each part as it is done; one process begins at the front, another at the end."""
    if not missing:
        return
    left = list(missing)
    with start_compiling(left) as one, start_compiling(left[::-1]) as other:
        try:
            while left:
                ended = one.poll() is not None and other.poll() is not None
                yield from (done := [part for part in left if is_compiled(part)])
                left = [part for part in left if part not in done]
                if ended:
                    return
                time.sleep(POLL_S)
        finally:
            one.kill()
            other.kill()
