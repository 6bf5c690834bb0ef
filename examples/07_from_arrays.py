"""Make a print of arrays, without a slicer or a file, and plan it.

    python examples/07_from_arrays.py [OUT]

Here it is a field of square towers: each layer of each is one closed contour.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import decmcts

SIDE_MM, APART_MM, LAYER_MM = 10.0, 30.0, 0.2


def towers(rows: int = 3, layers: int = 10) -> decmcts.Source:
    """Return rows × rows towers on an MK4S, printed layer by layer, line by line."""
    square = SIDE_MM * np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    corners = 60.0 + APART_MM * np.stack(np.meshgrid(*[np.arange(rows)] * 2), -1).reshape(-1, 2)
    n = layers * len(corners)
    layer = np.repeat(np.arange(layers, dtype=np.int32), len(corners))
    points = np.empty((n, len(square), 3))
    points[..., :2] = np.tile(corners, (layers, 1))[:, None] + square
    points[..., 2] = LAYER_MM * (1 + layer[:, None])
    return decmcts.from_arrays(
        points.reshape(-1, 3),
        len(square) * np.arange(n + 1),
        layer,
        "mk4s",
        role=np.full(n, decmcts.Role.EXTERNAL_PERIMETER),
        feed=40.0,
        width=0.45,
        height=LAYER_MM,
    )


def main(out: Path, time_limit_s: float = 2.0) -> tuple[decmcts.Result, decmcts.Verdict]:
    """Plan the towers, write G-code and have that judged."""
    source = towers()
    result = decmcts.plan(source, decmcts.Search(time_limit_s))
    print(f"travel: {result.before.travel_mm:.0f} mm, now {result.after.travel_mm:.0f} mm")
    written = result.write_gcode(out, allow_slower=True)
    verdict = decmcts.verify(written.paths, source.path, source.machine)
    print("wrote", out, "- sound" if verdict.ok else verdict.shown)
    return result, verdict


if __name__ == "__main__":
    main(Path(sys.argv[1] if sys.argv[1:] else "towers.gcode"))
