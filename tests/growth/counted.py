"""What a run does, counted: lines of Python, what methods walk through, and bytes of memory."""

from __future__ import annotations

import sys
import tracemalloc
from collections.abc import Callable
from itertools import pairwise
from types import FrameType
from typing import Any

OURS = ("decmcts", "sim", "agents")
WALKS = frozenset(
    {"count", "index", "find", "rfind", "remove", "insert", "join", "split", "rsplit", "replace",
     "partition", "rpartition", "splitlines", "strip", "rstrip", "translate", "copy"}
)  # fmt: skip
SIZED = (list, tuple, str, bytes, bytearray)


def steps(run: Callable[[], object]) -> int:
    """Return how many lines of ours a call runs, and how far methods walk for them.

    A method that looks through a list or a text counts as long as that is: lines alone would
    not tell a search in a loop from a look.
    """
    done = 0

    def line(frame: FrameType, event: str, arg: Any) -> Any:
        nonlocal done
        done += event == "line"
        return line

    def traced(frame: FrameType, event: str, arg: Any) -> Any:
        return line if str(frame.f_globals.get("__name__", "")).startswith(OURS) else None

    def profiled(frame: FrameType, event: str, arg: Any) -> None:
        nonlocal done
        if event == "c_call" and arg.__name__ in WALKS and isinstance(arg.__self__, SIZED):
            done += len(arg.__self__) // 64  # bytes at a time

    before = sys.gettrace(), sys.getprofile()
    sys.settrace(traced)
    sys.setprofile(profiled)
    try:
        run()
    finally:
        sys.setprofile(before[1])
        sys.settrace(before[0])
    return done


def peak_bytes(run: Callable[[], object]) -> int:
    """Return the most memory that a call holds at a time, without what is there before.

    The least of two calls: threads that other tests left behind hold memory now and then, too.
    """
    tracemalloc.start()
    held = []
    try:
        for _ in range(2):
            begun = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            run()
            held.append(tracemalloc.get_traced_memory()[1] - begun)
        return min(held)
    finally:
        tracemalloc.stop()


def grows_faster(counts: list[int], *, slack: float, least: float) -> bool:
    """Tell whether counts of inputs that double grow faster than the inputs.

    Differences leave out what is done once. Less than `least` at the largest is noise.
    """
    steps = [b - a for a, b in pairwise(counts)]
    return steps[-1] > least and steps[-1] > 2.0 * slack * max(steps[-2], 1)
