"""What is compiled on this machine, by parts, and compiling the rest in processes beside this one.

A part is the set of kernels one kind of run needs; `decmcts.planning.warm` compiles them. A
mark beside the machine code says that a part is complete. It holds for one version of the
kernels, numba and the processor. See docs/adr/0007-compiled-at-first-use.md.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numba

import sim.replay
from decmcts.compiled import FILES, SOURCES
from decmcts.jit import Store, cache_folder
from decmcts.jit.kernel import compiler_and_processor, reported_to
from decmcts.jit.store import MARK, cache_home, remove_unused, size_of, temporary_folder
from decmcts.planning.events import Event, Note, Report, Step, unheard
from decmcts.planning.options import Freedom, PlannerName, Search
from decmcts.search.sequence.problem import OrderProblem

FIRST_RUN_KERNELS = 65  # about so many does a first `plan` compile (docs/results/startup.md)
PRINT = "reading, scheduling, writing and judging a print"
TEAM = "several heads"

StartChild = Callable[[Sequence[str]], "subprocess.Popen[bytes]"]
"""Starts a process that compiles these parts."""

POLL_S = 0.1
EVERY_S = 3.0  # at least so long between two reports of what is compiled

_reported: list[str] = []  # why the cache cannot be written, once that was reported
_beside: list[str] = []  # parts that are being compiled in another process
_children: list[subprocess.Popen[bytes]] = []  # that process

FIRST = "local"  # the planner a search begins with while the kernels of `hybrid` are compiled

_config: Any = numba.config  # untyped
FOLDERS = [
    Path(cache_folder(SOURCES, FILES)),
    Path(cache_folder(Path(str(sim.replay.__file__)).parent)),
]


def search_part(planner: str, unit: str, *, loops: bool) -> str:
    """Name what a search needs: a planner, a unit, loops entered anywhere or not."""
    return f"{planner} for {unit}" + (", seams free" if loops else "")


def bound_part(unit: str) -> str:
    """Name what proving a bound needs."""
    return f"bound on {unit}"


def parts_for(search: Search, freedom: Freedom, *, walls: bool = False) -> list[str]:
    """Name the parts that planning for one head needs; a user's own planner has none.

    `walls` tells whether travels that cross walls cost more: kernels are those for time then.
    """
    named = isinstance(search.planner, PlannerName)
    parts = parts_of(search.name, "time" if walls else search.objective, freedom)
    return parts if named else parts[1:]


def parts_of(planner: str, unit: str, freedom: str) -> list[str]:
    """Name the parts that planning for one head needs, in the order to compile them beside a run.

    `PRINT` comes after the first search and its bound: on an empty cache the run itself
    compiles most of `PRINT` in the meantime.
    """
    loops = freedom == "seam"
    begins = [FIRST, planner] if planner == "hybrid" else [planner]
    searches = [search_part(name, unit, loops=loops) for name in begins]
    return [searches[0], bound_part(unit), PRINT, *searches[1:]]


def part_of(problem: OrderProblem, planner: str) -> str:
    """Name what a search for this problem needs."""
    return search_part(planner, unit_for(problem), loops=problem.seams is not None)


def unit_for(problem: OrderProblem) -> str:
    """Name what prices travels in this problem: `travel`, or `time`, also of mm round walls."""
    return "travel" if problem.pace is None else "time"


def all_parts() -> list[str]:
    """Name everything that is compiled ahead, what most runs need first."""
    parts = []
    for freedom in ("reversible", "seam"):
        for unit in ("travel", "time"):
            parts += parts_of("hybrid", unit, freedom)
    return [*dict.fromkeys(parts), TEAM]


def is_compiled(part: str) -> bool:
    """Say whether a part is complete on this machine."""
    return _store().marked(_mark(part))


def mark_compiled(part: str) -> None:
    """Say that a part is complete on this machine, where kernels are compiled at all."""
    if not _config.DISABLE_JIT and not is_compiled(part):
        _store().mark(_mark(part))


def _store() -> Store:
    """Return the store parts are marked in; where caches are is asked each time."""
    return Store(cache_home() / FOLDERS[0].name)


def _mark(part: str) -> str:
    return "|".join((part, FOLDERS[1].name, *compiler_and_processor()))


def how_far() -> str:
    """Return in words how many kernels are compiled, of about how many for a first run."""
    folders = [*FOLDERS, *([spill] if (spill := temporary_folder()) else [])]
    made = sum(not one.name.startswith(MARK) for each in folders for one in each.glob("*.code"))
    first = f" of about {FIRST_RUN_KERNELS}" if made < FIRST_RUN_KERNELS else ""
    return f"{made}{first} done"


def cache_line() -> str:
    """Return one line on where the machine code is and how much of it there is."""
    files, size = size_of(cache_home())
    return f"{files} files of machine code, {size / 2**20:.0f} MiB, in {cache_home()}"


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
        missing = [part for part in parts if not is_compiled(part)]
        if not all(map(compiled_beside, missing)):
            _end_child()
            remove_unused(cache_home())
            for folder in FOLDERS:
                Store(folder).prepare()  # if it has to be a temporary one, the child must find it
            report_if_unwritable(report)
            _children.append(start(missing))
            _beside.extend(missing)
        yield
    finally:
        if not within:
            _end_child()


def finish_beside(part: str, report: Report) -> None:
    """Wait until a part that is compiled beside this process is complete, or cannot be."""
    reported_at = -EVERY_S
    while compiled_beside(part) and not is_compiled(part) and _children[-1].poll() is None:
        if time.monotonic() - reported_at >= EVERY_S:
            reported_at = time.monotonic()
            report(Step(f"compiling {part}, once on this machine; {how_far()}"))
        time.sleep(POLL_S)


def _end_child() -> None:
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
    if Store.unwritable is None or _reported or report is unheard:
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
