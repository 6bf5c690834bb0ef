"""How much work code does, counted instead of timed: the same on every machine."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any


def bytecodes(run: Callable[[], object], *, within: tuple[str, ...]) -> int:
    """Return how many bytecodes a call executes in modules whose names begin so.

    Loops within one call count as often as they go round; what numpy and compiled kernels do
    counts once for each call.
    """
    done = 0

    def local(frame: FrameType, event: str, arg: Any) -> Any:
        nonlocal done
        done += event == "opcode"
        return local

    def traced(frame: FrameType, event: str, arg: Any) -> Any:
        if not str(frame.f_globals.get("__name__", "")).startswith(within):
            return None
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        return local

    before = sys.gettrace()
    sys.settrace(traced)
    try:
        run()
    finally:
        sys.settrace(before)
    return done


def grows_linearly(work: Callable[[int], int], size: int, *, slack: float = 1.15) -> bool:
    """Tell whether twice as much more input is at most twice as much more work.

    Differences leave out what is done once: linear work gives 2, quadratic work gives 4.
    """
    small, medium, large = work(size), work(2 * size), work(4 * size)
    return large - medium <= 2.0 * slack * (medium - small)
