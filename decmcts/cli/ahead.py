"""What is compiled on this machine, by parts, and compiling the rest beside a run.

A part is what one kind of run needs (`decmcts.cli.warm` makes them). That a part is
complete is kept with the machine code; another version, numba or processor begins
anew. See docs/adr/0007-compiled-at-first-use.md.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numba

import decmcts._kernels
import sim.replay
from decmcts.cli.console import err
from decmcts.jit import Store, cache_folder
from decmcts.jit.kernel import reported_to
from decmcts.jit.store import MARK, cache_home, remove_unused, size_of, temporary_folder
from decmcts.search.sequence.problem import OrderProblem

ABOUT = 65  # kernels a first `plan` compiles (docs/results/startup.md)
POLL_S = 0.1
EVERY_S = 3.0  # so often at most a line says what is compiled
PRINT = "reading, scheduling, writing and judging a print"
TEAM = "several heads"

BARE = " with bare travels"
FIRST = "local"  # the planner a search begins with while the kernels of `hybrid` are compiled

_said: list[str] = []  # why the cache cannot be written, once it was said
_beside: list[str] = []  # parts that are being compiled in another process
_children: list[subprocess.Popen[bytes]] = []  # that process
_folders = [
    Path(cache_folder(Path(str(room.__file__)).parent)) for room in (decmcts._kernels, sim.replay)
]
_store = Store(_folders[0])


def unit_of(*, seconds: bool, walls: bool) -> str:
    """Name what is minimised: mm, s, or s where some travels inside walls cost less."""
    return f"time{BARE if walls else ''}" if seconds else "travel"


def search_part(planner: str, unit: str, *, loops: bool) -> str:
    """Name what a search needs: a planner, a unit, loops entered anywhere or not."""
    return f"{planner} for {unit}" + (", seams free" if loops else "")


def bound_part(unit: str) -> str:
    """Name what proving a bound needs."""
    return f"bound on {unit}"


def parts_of(planner: str, objective: str, freedom: str, *, walls: bool = False) -> list[str]:
    """Name what `decmcts plan` needs, in the order a process beside it had best compile it in.

    On an empty cache the run itself has to compile much of `PRINT` while the first search is
    compiled, and goes on with it; the bound is what it needs last.
    `walls` tells that the source leaves travels bare, which is known once it was read.
    """
    unit, loops = unit_of(seconds=objective == "time", walls=walls), freedom == "seam"
    begins = [FIRST, planner] if planner == "hybrid" else [planner]
    searches = [search_part(name, unit, loops=loops) for name in begins]
    return [searches[0], bound_part(unit), PRINT, *searches[1:]]


def compiled_beside(part: str) -> bool:
    """Say whether a part is being compiled in another process this one started."""
    return part in _beside


def part_of(problem: OrderProblem, planner: str) -> str:
    """Name what a search for this problem needs."""
    return search_part(planner, unit_for(problem), loops=problem.seams is not None)


def unit_for(problem: OrderProblem) -> str:
    """Name what is minimised in this problem."""
    pace = problem.pace
    return unit_of(seconds=pace is not None, walls=pace is not None and pace.looks_at_walls)


def all_parts() -> list[str]:
    """Name everything that is compiled ahead, what most runs need first."""
    parts = []
    for objective, freedom in (("travel", "reversible"), ("time", "reversible"),
                               ("travel", "seam"), ("time", "seam")):  # fmt: skip
        parts += parts_of("hybrid", objective, freedom)
    for freedom in ("reversible", "seam"):
        parts += parts_of("hybrid", "time", freedom, walls=True)
    return [*dict.fromkeys(parts), TEAM]


def is_compiled(part: str) -> bool:
    """Say whether a part is complete on this machine."""
    return _store.marked(_mark(part))


def mark_compiled(part: str) -> None:
    """Say that a part is complete on this machine."""
    if not is_compiled(part):
        _store.mark(_mark(part))


def _mark(part: str) -> str:
    compiler = numba.core.registry.cpu_target.target_context.codegen().magic_tuple()
    return "|".join((part, _folders[1].name, numba.__version__, *map(str, compiler)))


def kernels_made() -> int:
    """Return how many kernels of this version there is machine code for."""
    folders = [*_folders, *([spill] if (spill := temporary_folder()) else [])]
    return sum(
        not path.name.startswith(MARK) for folder in folders for path in folder.glob("*.code")
    )


def how_far(made: int) -> str:
    """Return how many kernels are made, beside how many a first run needs, while that tells."""
    return f"{made} of about {ABOUT} done" if made < ABOUT else f"{made} done"


def cache_line() -> str:
    """Return one line on where the machine code is and how much of it there is."""
    files, size = size_of(cache_home())
    return f"{files} files of machine code, {size / 2**20:.0f} MiB, in {cache_home()}"


@contextmanager
def compiling_beside(parts: list[str]) -> Iterator[None]:
    """Compile parts in a process beside the body of a `with`, if any is missing.

    It ends with the body, or with this process if that is killed.
    """
    try:
        compile_beside(parts)
        yield
    finally:
        _end_child()


def compile_beside(parts: list[str]) -> None:
    """Compile these parts, where any is missing, in place of what is compiled beside by now.

    To be called within `compiling_beside`, once it is known what else is needed.
    """
    missing = [part for part in parts if not is_compiled(part)]
    if not missing:
        return
    _end_child()
    remove_unused(cache_home())
    for folder in _folders:
        Store(folder).prepare()  # a temporary one must be known to the child
    say_if_unwritable()
    command = [sys.executable, "-m", "decmcts.cli.warm", *missing]
    quiet = subprocess.DEVNULL
    _children.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet))
    _beside.extend(missing)


def finish_beside(part: str, announce: Callable[[str], None]) -> None:
    """Wait until a part that is compiled beside this process is complete, or cannot be."""
    said_at = -EVERY_S
    while compiled_beside(part) and not is_compiled(part) and _children[-1].poll() is None:
        if time.monotonic() - said_at >= EVERY_S:
            said_at = time.monotonic()
            announce(f"compiling {part}, once on this machine; {how_far(kernels_made())}")
        time.sleep(POLL_S)


def _end_child() -> None:
    """End the process that compiles beside this one, if there is one."""
    _beside.clear()
    while _children:
        with _children.pop() as child:
            child.kill()


@contextmanager
def compilation_announced(announce: Callable[[str], None]) -> Iterator[Callable[[str], None]]:
    """Say what is compiled during which step; yields the callback for steps."""
    step, said_at = "", 0.0

    def say(text: str) -> None:
        nonlocal step, said_at
        announce(text)
        step, said_at = text, 0.0  # last, for another thread may be compiling

    def compiles(name: str) -> None:
        nonlocal said_at
        say_if_unwritable()
        now = time.monotonic()
        if now - said_at >= EVERY_S:
            said_at = now
            announce(f"{step}: compiling {name}, once on this machine; {how_far(kernels_made())}")

    with reported_to(compiles):
        yield say


def say_if_unwritable() -> None:
    """Say, once a run, that the cache cannot be written and what that costs."""
    if Store.unwritable is None or _said:
        return
    _said.append(str(Store.unwritable))
    err.print(
        f"the cache of machine code cannot be written ({Store.unwritable}): what is missing is "
        "compiled in every run; set XDG_CACHE_HOME to a folder that can be written",
        soft_wrap=True,
    )
