"""What is compiled on this machine, by parts.

A part is the set of kernels one kind of run needs; `decmcts.planning.warm` compiles them. A
mark beside the machine code says that a part is complete. It holds for one version of the
kernels, numba and the processor. See docs/adr/0007-compiled-at-first-use.md.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numba

import sim.replay
from decmcts.compiled import FILES, SOURCES
from decmcts.jit import Store, cache_folder
from decmcts.jit.kernel import compiler_and_processor
from decmcts.jit.store import MARK, cache_home, size_of, temporary_folder
from decmcts.planning.options import Freedom, PlannerName, Search
from decmcts.search.sequence.problem import OrderProblem

FIRST_RUN_KERNELS = 65  # about so many does a first `plan` compile (docs/results/startup.md)
PRINT = "reading, scheduling, writing and judging a print"
TEAM = "several heads"

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
