"""The judge's own compiled functions go through this one decorator.

It is kept apart from the planner's kernels on purpose: the judge shares data
types with the planner, not algorithms.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Compile `function` on first use and keep the machine code on disk."""
    return cast(F, numba.njit(cache=True, nogil=True)(function))
