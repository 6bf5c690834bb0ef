"""Compiles functions and keeps the machine code on disk, safely across changes.

Shared by the planner's kernels and the judge's; no algorithm lives here. `kernel` is
what a function becomes, `library` how little is made of what it calls, `store` the
files. See docs/adr/0007-compiled-at-first-use.md.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from decmcts.jit.kernel import Kernel
from decmcts.jit.store import Store, cache_folder

__all__ = ["Kernel", "Store", "cache_folder", "compiler"]

F = TypeVar("F", bound=Callable[..., Any])

_config: Any = numba.config  # untyped


def compiler(
    sources: Path, *, files: str = "*.py", inlined: bool = False, apart: bool = False
) -> Callable[[F], F]:
    """Return a decorator that compiles on first use, cached for these sources.

    `sources` is a folder, `files` a pattern of names in it and below. With `inlined`, what calls
    the function gets its code in place of a call; with `apart` always a call, so that each kernel
    has one copy of the function.
    """
    store = Store(Path(cache_folder(sources, files)))

    def compiled(function: F) -> F:
        if _config.DISABLE_JIT:
            return function
        return cast(F, Kernel(function, store, inlined=inlined, apart=apart))

    return compiled
