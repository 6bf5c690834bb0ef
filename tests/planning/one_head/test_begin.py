"""Compiling a kernel takes seconds: none of it may come out of a search's time limit."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from decmcts.planning.compiling import FIRST, compiling_beside, part_of
from decmcts.planning.events import unheard
from decmcts.planning.one_head.order_search import OrderSearch
from decmcts.planning.options import Search
from tests.late_kernels import late_kernels
from tests.search.problems import random_problem

LOADED = """
from dataclasses import replace
import numpy as np
from decmcts.planning.one_head.order_search import compile_search
from decmcts.feasibility.graph import DependencyGraph
from decmcts.search.planners import plan_order
from decmcts.search.sequence.timed_lags import no_timed_lags
from decmcts.search.sequence.stopping import Stopping
from tests.search.problems import random_problem, with_bare, with_loops, with_pace
"""
AHEAD = """
planner, kind, is_ahead = case
problem = random_problem(0, 600, density=0.002)
if kind == "narrow":  # few contours a layer: solved exactly
    layer = np.arange(60, dtype=np.int32) // 4
    pairs = np.argwhere(layer[:, None] + 1 == layer[None, :]).astype(np.int32)
    graph = DependencyGraph.from_pairs(60, pairs)
    problem = replace(random_problem(0, 60, density=0.0), layer=layer, graph=graph)
if kind == "loops":
    problem = with_loops(problem, 0)
if kind == "time":
    problem = with_pace(problem)
if kind == "bare":
    problem = with_bare(problem)
if kind == "cooling":
    problem = replace(problem, timed_lags=no_timed_lags(600))
if is_ahead:
    compile_search(problem, planner)
"""
SEARCH = "plan_order(problem, planner=planner, stopping=Stopping(iterations=30_000), seed=0)"
KINDS = [("hybrid", kind) for kind in ("paths", "narrow", "loops", "time", "bare", "cooling")]
KINDS += [("mcts", "paths"), ("local", "loops")]


@pytest.mark.long
def test_a_search_finds_every_kernel_compiled() -> None:
    """Small searches ahead of the real one take every path it may take; counted is what is late."""
    ahead = [(*kind, "ahead") for kind in KINDS]
    late = [(*kind, "") for kind in KINDS[:2]]
    *found, paths, narrow = late_kernels(LOADED, AHEAD, SEARCH, [*ahead, *late])
    assert dict(zip(KINDS, found, strict=True)) == {kind: [] for kind in KINDS}
    assert "anneal" in paths and "trace" in narrow


def test_a_search_limited_by_iterations_begins_with_what_was_asked_for(fresh: Path) -> None:
    """Equal seeds give equal orders, whatever is compiled."""
    problem = random_problem(0, 30)
    part = part_of(problem, "hybrid")
    with compiling_beside([part], unheard, start=NeverDone()):
        by_time, by_iterations = (
            OrderSearch(None, problem, None, None, Search(max_iterations=most), unheard)
            for most in (None, 10)
        )
        assert by_time.first == FIRST
        assert by_iterations.first == "hybrid"
        assert not by_iterations.ready()


class NeverDone:
    """Starts a process that compiles nothing, in the place of one that compiles."""

    def __call__(self, parts: Sequence[str]) -> subprocess.Popen[bytes]:
        return subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
