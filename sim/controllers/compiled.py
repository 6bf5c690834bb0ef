"""The simulator's compiled functions go through this one decorator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from decmcts.jit import compiler

F = TypeVar("F", bound=Callable[..., Any])

_compile: Callable[..., Any] = compiler(Path(__file__).parent)


def compiled(function: F) -> F:
    """Compile `function` on first use and keep the machine code on disk."""
    machine_code: F = _compile(function)
    return machine_code
