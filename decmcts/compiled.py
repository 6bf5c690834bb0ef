"""The decorators of kernels: compiled loops on bare numbers and arrays.

Kernels stand beside what calls them, in files named `…_kernels.py`, which import each other, the
kinds of arrays, and nothing else of the project. They trust what they are given; their callers
validate.
`NUMBA_DISABLE_JIT=1` runs them as plain Python (one CI job does, for small cases).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from decmcts.jit import compiler

F = TypeVar("F", bound=Callable[..., Any])

SOURCES, FILES = Path(__file__).parent, "*_kernels.py"  # a change in any of them compiles all anew

_compile: Callable[..., Any] = compiler(SOURCES, files=FILES)
_inline: Callable[..., Any] = compiler(SOURCES, files=FILES, inlined=True)
_apart: Callable[..., Any] = compiler(SOURCES, files=FILES, apart=True)


def kernel(function: F) -> F:
    """Compile `function` on first use and keep the machine code on disk."""
    compiled: F = _compile(function)
    return compiled


def inlined(function: F) -> F:
    """Compile `function` into every kernel that calls it.

    For small ones that take structs of many arrays: handing these over costs more
    than the work itself (a joint order of 6 000 contours takes a third of the time).
    """
    compiled: F = _inline(function)
    return compiled


def apart(function: F) -> F:
    """Compile `function` once into each kernel that calls it, however often it is called there.

    For large ones: the compiler copies them to every call else, which takes minutes.
    """
    compiled: F = _apart(function)
    return compiled
