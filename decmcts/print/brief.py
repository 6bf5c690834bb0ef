"""How what has many numbers shows itself at a prompt: what it is, and its main figures."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from reprlib import Repr
from typing import Any

from numpy.typing import NDArray


class _Short(Repr):
    """One value in short."""

    def __init__(self) -> None:
        super().__init__()
        self.maxtuple = self.maxlist = self.maxdict = 3  # the rest are dots
        self.maxstring, self.maxother = 60, 200  # characters

    def repr_ndarray(self, array: NDArray[Any], level: int) -> str:
        """Return type and shape."""
        return f"{array.dtype} {array.shape}"

    def repr_float(self, value: float, level: int) -> str:
        """Return six digits."""
        return f"{value:.6g}"


def brief(*names: str) -> Callable[[Any], str]:
    """Return a `__repr__` that shows these attributes, dotted or not, each in short.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> @dataclass
    ... class Walk:
    ...     points: np.ndarray
    ...     feeds: tuple[float, ...]
    ...     __repr__ = brief("points", "points.ndim", "feeds")
    >>> Walk(np.zeros((100, 3)), (30.0,) * 100)
    Walk(points=float64 (100, 3), points.ndim=2, feeds=(30, 30, 30, ...))
    """
    short = _Short().repr

    def shown(self: object) -> str:
        values = (f"{name}={short(attrgetter(name)(self))}" for name in names)
        return f"{type(self).__name__}({', '.join(values)})"

    return shown
