"""Work beside a launch: who waits for whom."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import pytest

from decmcts.jit.kernel import Kernel, reported_to
from decmcts.jit.store import Store
from decmcts.planning.worker import YIELDING, begun


def priority() -> int:
    """Return the niceness of this thread."""
    return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="threads have a priority of their own on Linux")
def test_kernels_of_a_thread_that_yields_are_made_at_the_usual_priority(tmp_path: Path) -> None:
    """It holds the compiler's lock meanwhile: on a busy machine all else waited for minutes."""

    def double(x: float) -> float:
        return x * 2.0

    def half(x: float) -> float:
        return x / 2.0

    inner = Kernel(half, Store(tmp_path))

    def halves(x: float) -> float:
        return float(inner(x) + inner(x))

    kernels, made = [Kernel(double, Store(tmp_path)), Kernel(halves, Store(tmp_path))], []

    def work() -> tuple[int, list[float]]:
        return priority(), [each(4.0) for each in kernels]

    with reported_to(lambda name: made.append((name, priority()))):
        at, values = begun(work, yielding=True).result()
    assert at == YIELDING and values == [8.0, 4.0]
    assert made == [("double", priority()), ("halves", priority())]


def test_an_error_of_a_thread_that_yields_is_raised() -> None:
    """Whoever asks for the result learns of it."""
    with pytest.raises(ZeroDivisionError):
        begun(lambda: 1 // 0, yielding=True).result()
