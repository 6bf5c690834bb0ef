"""Kernels do what their Python does, whether they were called or only linked before."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from numba.core.compiler_lock import global_compiler_lock

from decmcts.jit.kernel import Kernel, compiled_first, giving_way, reported_to
from decmcts.jit.library import compiling_kernel
from decmcts.jit.store import Store

pytestmark = pytest.mark.slow


def kernels(folder: Path) -> tuple[Kernel, Kernel]:
    """Return a kernel and another one it calls."""
    store = Store(folder)

    def half(values: np.ndarray, k: int) -> float:
        if k >= len(values):
            raise IndexError("beyond the end")
        return values[k] / 2.0

    inner = Kernel(half, store)

    def halves(values: np.ndarray, count: int) -> float:
        total = 0.0
        for k in range(count):
            total += inner(values, k)
        return total

    return Kernel(halves, store), inner


def test_a_callee_is_linked_and_no_more(tmp_path: Path) -> None:
    """Machine code and wrappers of what nobody calls took two fifths of the time."""
    outer, inner = kernels(tmp_path)
    assert outer(np.arange(4.0), 4) == 3.0
    (linked,) = inner.overloads.values()
    assert linked.library.only_linked
    assert [path.name.split("-")[0] for path in tmp_path.glob("*.code")] == ["halves"]


def test_a_callee_may_be_called_later(tmp_path: Path) -> None:
    """Without machine code of its own it must be compiled in full, not run."""
    outer, inner = kernels(tmp_path)
    outer(np.arange(4.0), 4)
    assert inner(np.arange(4.0), 3) == 1.5
    assert outer(np.arange(4.0), 2) == 0.5


def test_an_error_in_a_callee_is_raised(tmp_path: Path) -> None:
    """Exceptions need the globals of the function they come from."""
    outer, _ = kernels(tmp_path)
    with pytest.raises(IndexError, match="beyond the end"):
        outer(np.arange(4.0), 5)


def test_other_types_are_compiled_for(tmp_path: Path) -> None:
    """One function, several metrics."""
    outer, _ = kernels(tmp_path)
    assert outer(np.arange(4.0), 4) == outer(np.arange(4, dtype=np.float32), 4) == 3.0


def test_a_second_kernel_takes_the_code_from_the_store(tmp_path: Path) -> None:
    """Compiling once a machine is the point."""
    made: list[str] = []
    with reported_to(made.append):
        kernels(tmp_path)[0](np.arange(4.0), 4)
        kernels(tmp_path)[0](np.arange(4.0), 4)
    assert made == ["halves"]


TWICE = """
import numpy as np
from decmcts.search.sequence.metric_kernels import respects
from decmcts.jit.kernel import reported_to
with reported_to(print):
    assert respects(np.arange(3, dtype=np.int32), np.array([0, 1, 1, 1]), np.array([1], np.int32))
    assert not respects(np.array([1, 0, 2], np.int32), np.array([0, 1, 1, 1]),
                        np.array([1], np.int32))
"""


def test_a_second_process_compiles_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Code from the store runs as the code it was."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    command = [sys.executable, "-c", TWICE]
    first, second = (subprocess.run(command, check=True, capture_output=True) for _ in range(2))
    assert first.stdout == b"respects\n"
    assert second.stdout == b""


def test_a_thread_that_gives_way_waits(tmp_path: Path) -> None:
    """A search that can begin loads a dozen kernels; others are made one after the other."""
    outer, inner = kernels(tmp_path)

    def judge() -> None:
        with giving_way():
            outer(np.arange(4.0), 4)

    late = threading.Thread(target=judge)
    with compiled_first():
        late.start()
        assert inner(np.arange(4.0), 3) == 1.5
        late.join(0.05)
        assert late.is_alive() and not outer.overloads
    late.join()
    assert outer.overloads


def test_a_thread_gives_way_also_while_another_compiles(tmp_path: Path) -> None:
    """Which thread compiles decides: a kernel made by another is no reason not to wait."""
    outer, _ = kernels(tmp_path)
    waited: list[bool] = []

    def judge() -> None:
        with giving_way():
            outer(np.arange(4.0), 4)

    late = threading.Thread(target=judge)
    with compiled_first():
        with global_compiler_lock, compiling_kernel("of another thread"):
            late.start()
            late.join(0.05)
        late.join(0.5)
        waited.append(late.is_alive() and not outer.overloads)
    late.join()
    assert waited == [True] and outer.overloads


def test_what_comes_first_may_have_threads_of_its_own(tmp_path: Path) -> None:
    """Searches run on two, and wait for both: these wait for no turn."""
    outer, _ = kernels(tmp_path)
    own = threading.Thread(target=outer, args=(np.arange(4.0), 4), daemon=True)
    with compiled_first():
        own.start()
        own.join(60.0)
        assert not own.is_alive()
    assert outer.overloads


def test_what_an_inlined_function_calls_is_not_inlined_with_it(tmp_path: Path) -> None:
    """Else how long a kernel takes to compile hangs on what was compiled before it."""
    store = Store(tmp_path)

    def square(x: float) -> float:
        return x * x

    plain = Kernel(square, store)

    def next_to(x: float) -> float:
        return plain(x) + 1.0

    inlined = Kernel(next_to, store, inlined=True)

    def total(count: int) -> float:
        found = 0.0
        for k in range(count):
            found += inlined(float(k))
        return found

    assert Kernel(total, store)(4) == 18.0
    (made,) = plain.overloads.values()
    assert "alwaysinline" not in str(made.library._final_module)


def test_a_function_kept_apart_is_called(tmp_path: Path) -> None:
    """Its code stands once in a kernel, however often it is called there."""
    store = Store(tmp_path)

    def kept_apart(x: float) -> float:
        return x * x - 1.0

    apart = Kernel(kept_apart, store, apart=True)

    def both(x: float) -> float:
        return apart(x) * apart(x + 1.0)

    kernel = Kernel(both, store)
    assert kernel(3.0) == 8.0 * 15.0
    (made,) = kernel.overloads.values()
    assert "10kept_apartB" in str(made.library._final_module)
