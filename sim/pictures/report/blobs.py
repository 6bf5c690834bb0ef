"""Arrays for the report's page: quantised, packed as bytes, and compressed in one piece.

What `data.js` reads back: a zlib stream, base64 for a page of text. It begins with the length
of a JSON text (4 bytes, little-endian), then that text, then the bytes of all arrays. Where the
JSON has an array there is a place, `{"at", "n", "type", "delta", "scale"}`. The bytes of an
array lie by their weight, all lowest first: neighbours are alike, so they compress well.
"""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decmcts.arrays import Floats, Ints

STEP_MM = 0.01  # of places in the page
STEP_S = 0.001
_TYPES = (np.int8, np.int16, np.int32)
LEVEL = 9  # of zlib


class Blobs:
    """Arrays on their way into a page; `add` returns what stands for one in the JSON."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def add(
        self, values: NDArray[Any], *, step: float = 1.0, delta: bool = False
    ) -> dict[str, Any]:
        """Keep an array as whole steps; with `delta` as differences, for what changes little.

        Parameters
        ----------
        values : (n,) finite numbers
        step : what one whole step is, in the unit of the values
        """
        whole = np.rint(np.asarray(values, np.float64) / step).astype(np.int64)
        if delta:
            whole = np.diff(whole, prepend=0)
        kind = _narrowest(whole)
        raw = whole.astype(kind.newbyteorder("<"))
        by_weight = raw.view(np.uint8).reshape(len(raw), kind.itemsize).T.tobytes()
        at = sum(map(len, self._parts))
        self._parts.append(by_weight)
        return {
            "at": at, "n": len(raw), "type": f"i{8 * kind.itemsize}", "delta": delta, "scale": step,
        }  # fmt: skip

    def places(self, points: Floats) -> dict[str, Any]:
        """Keep points, (n, 3) mm, as three arrays."""
        columns = zip("xyz", points.T, strict=True)
        return {name: self.add(column, step=STEP_MM, delta=True) for name, column in columns}

    def packed(self, page: dict[str, Any]) -> str:
        """Return the JSON and the arrays that belong to it as base64 of one zlib stream."""
        text = json.dumps(page, separators=(",", ":"), allow_nan=False).encode()
        stream = len(text).to_bytes(4, "little") + text + b"".join(self._parts)
        return base64.b64encode(zlib.compress(stream, LEVEL)).decode()


def _narrowest(whole: Ints) -> np.dtype[Any]:
    low, high = (int(whole.min()), int(whole.max())) if len(whole) else (0, 0)
    for kind in _TYPES:
        if np.iinfo(kind).min <= low and high <= np.iinfo(kind).max:
            return np.dtype(kind)
    raise ValueError(f"a value of {max(-low, high)} steps is too large to draw")
