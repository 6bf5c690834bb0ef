"""What is not counted is only what makes and returns no array."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from decmcts.jit.kernel import Kernel
from decmcts.jit.library import borrows
from decmcts.jit.store import Store


class Pair(NamedTuple):
    """Two numbers."""

    first: int
    second: float


class Row(NamedTuple):
    """An array."""

    values: NDArray[np.float64]


def reads(values: NDArray[np.float64]) -> float:
    """Only read."""
    return float(max(values[0], np.sqrt(values[1])))


def writes(values: NDArray[np.float64], k: int) -> None:
    """Write in place."""
    for i in range(k, len(values)):
        values[i] += 1.0


def paired(row: Row) -> Pair:
    """Return a tuple of numbers."""
    return Pair(len(row.values), abs(row.values[0]))


def calls(values: NDArray[np.float64]) -> float:
    """Call what only borrows."""
    return inner(values) + reads(values[1:])  # slices are borrowed too


def makes(count: int) -> float:
    """Make an array."""
    return np.zeros(count)[0]


def copies(values: NDArray[np.float64]) -> float:
    """Make an array by a method."""
    return values.copy()[0]


def returns(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an array."""
    return values[1:]


def returns_row(row: Row) -> Row:
    """Return an array in a tuple."""
    return row


def lists(count: int) -> int:
    """Make a list."""
    return len([count])


def takes(values: NDArray[np.float64]) -> float:
    """Take an array of a compiled function, and nobody would free it."""
    return handed(values)[0]


def says_nothing(values):  # type: ignore[no-untyped-def]  # that is the case
    return values[0]


def hides(values: NDArray[np.float64]) -> float:
    """Make an array in a way that no call shows."""
    both = values + values
    return both[0]


FOLDER = TemporaryDirectory()
STORE = Store(Path(FOLDER.name))
inner, handed = Kernel(reads, STORE), Kernel(returns, STORE)


@pytest.mark.parametrize("function", [reads, writes, paired])
def test_functions_of_numbers_borrow(function: Callable[..., Any]) -> None:
    """Their arrays are the caller's all the while."""
    assert borrows(function, compiled=Kernel)


def test_a_function_borrows_if_all_it_calls_return_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Plain functions are not looked into, compiled ones say what they return."""
    assert not borrows(calls, compiled=Kernel)  # `reads` is plain Python here
    monkeypatch.setitem(calls.__globals__, "reads", inner)
    assert borrows(calls, compiled=Kernel)


@pytest.mark.parametrize(
    "function", [makes, copies, returns, returns_row, lists, takes, says_nothing]
)
def test_what_makes_or_returns_an_array_is_counted(function: Callable[..., Any]) -> None:
    """Uncounted, it would never be freed, or freed while in use."""
    assert not borrows(function, compiled=Kernel)


@pytest.mark.slow
@pytest.mark.parametrize("function", [reads, hides])
def test_kernels_give_what_python_gives(function: Callable[..., Any], tmp_path: Path) -> None:
    """Where an array is made after all, the kernel is compiled with counts; nothing leaks."""
    values = np.array([1.0, 9.0, 4.0])
    kernel = Kernel(function, Store(tmp_path))
    assert kernel(values) == function(values)
    before = sys.getrefcount(values)
    for _ in range(3):
        kernel(values)
    assert sys.getrefcount(values) == before
    assert borrows(function, compiled=Kernel)
    assert kernel._borrows == (function is reads)


def hides(values: NDArray[np.float64]) -> Pair:
    """Return an array, and say that it does not."""
    return Hidden(values[1:], 1.0)  # type: ignore[return-value]


class Hidden(NamedTuple):
    """Named as if of numbers."""

    first: NDArray[np.float64]
    second: float


def bare(values: NDArray[np.float64]) -> tuple:  # type: ignore[type-arg]
    """Return a tuple of anything."""
    return values[1:], values


def test_a_tuple_of_anything_may_hold_arrays():
    """Only what is named is believed."""
    assert not borrows(bare, compiled=Kernel)


def test_an_annotation_that_hides_an_array_is_refused():
    """Nothing uncounted is handed out."""
    assert borrows(hides, compiled=Kernel)
    with pytest.raises(TypeError, match=r"returns Hidden.*its annotation says numbers"):
        Kernel(hides, STORE)(np.ones(3))
