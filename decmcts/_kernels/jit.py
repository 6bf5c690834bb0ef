"""One typed front for numba's decorator, so that strict type checking sees kernels.

Kernels take bare numbers and arrays and trust them; their callers validate.
`NUMBA_DISABLE_JIT=1` runs them as plain Python (one CI job does, for small cases).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from decmcts.jit import compiler

F = TypeVar("F", bound=Callable[..., Any])

_compile: Callable[..., Any] = compiler(Path(__file__).parent)
_inline: Callable[..., Any] = compiler(Path(__file__).parent, inlined=True)
_apart: Callable[..., Any] = compiler(Path(__file__).parent, apart=True)


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
