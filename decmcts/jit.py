"""Compiles functions and keeps the machine code on disk, safely across changes.

Numba's own cache looks only at the file a function stands in, so a kernel that
calls one in another file keeps the old machine code when that other file changes.
Here the cache folder is named by a digest of all sources that are compiled
together. Shared by the planner's kernels and the judge's; no algorithm lives here.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])

_config: Any = numba.config  # its options are made at run time


def cache_folder(sources: Path) -> str:
    """Return where the machine code of all Python files in `sources` is kept."""
    state = blake2b(digest_size=8)
    for path in sorted(sources.glob("*.py")):
        state.update(path.name.encode() + path.read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if sys.platform == "win32":
        home = os.environ.get("LOCALAPPDATA", home)
    return os.path.join(home, "decmcts", f"{sources.name.strip('_')}-{state.hexdigest()}")


def compiler(sources: Path) -> Callable[[F], F]:
    """Return a decorator that compiles on first use, cached for these sources.

    `NUMBA_CACHE_DIR` overrides the place; where the folder cannot be made, numba
    chooses its own.
    """
    folder = _config.CACHE_DIR or cache_folder(sources)
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError:
        folder = ""

    def compiled(function: F) -> F:
        before = _config.CACHE_DIR
        _config.CACHE_DIR = folder  # read once, while the function is decorated
        try:
            return cast(F, numba.njit(cache=True, nogil=True)(function))
        finally:
            _config.CACHE_DIR = before

    return compiled
