"""Searches inside the benchmark's own process, for what the command line does not tell.

That is the cost over time and iterations, and planners with parts left out.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import lru_cache

from common import print_path

from decmcts.cli.pipeline import Loaded, load, search
from decmcts.formats.mesh import SliceOptions
from decmcts.search.planners import Planner, SearchResult


@lru_cache(maxsize=1)
def loaded(model: str, machine: str, process: str) -> Loaded:
    """Return a print with its graph, quality rules left out."""
    return load(
        print_path(model), machine, process_order=process, options=SliceOptions(),
        announce=lambda step: None,
    )  # fmt: skip


def searched(
    model: str,
    machine: str,
    process: str,
    freedom: str,
    planner: str | Planner,
    *,
    limit_s: float,
    seed: int,
    clock: Callable[[], float] = time.monotonic,
) -> tuple[Loaded, SearchResult]:
    """Search as `decmcts plan` does; compiling and reading are off the clock."""
    prepared = loaded(model, machine, process)
    result = search(
        prepared, planner=planner, freedom=freedom, time_limit_s=limit_s, seed=seed, clock=clock
    )
    return prepared, result


def less_percent(result: SearchResult) -> float:
    """Return the reduction of travel against the source, in per cent."""
    return 100 * (1 - result.cost / result.source_cost) if result.source_cost else 0.0
