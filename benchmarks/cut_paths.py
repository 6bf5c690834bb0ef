"""What the files of a cut print lay down, point by point against their source.

A reader of its own, so that neither the planner's nor the judge's has to be believed: plain G0
and G1 with filament in steps or from the start, no arcs. Each move that prints must lie on a move
of the source that prints, and those on one must cover it once, with its filament in all.
"""

from __future__ import annotations

import gzip
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

NEAR_MM = 1.0e-3  # a cut is rounded to three decimals
EXACT_MM = 1e-9  # of filament: sums of what files say to five decimals
WORD = re.compile(r"([XYZE])(-?\d*\.?\d+)")

Floats = NDArray[np.float64]


def differences(source: Path, files: Sequence[Path]) -> list[str]:
    """Return a line for each place where the files lay down other than their source."""
    due, laid = _by_height([source]), _by_height(files)
    lines = [f"nothing is printed at {z} mm" for z in sorted(due.keys() - laid.keys())]
    lines += [f"something is printed at {z} mm" for z in sorted(laid.keys() - due.keys())]
    for z in sorted(due.keys() & laid.keys()):
        lines += [f"at {z} mm: {line}" for line in _compared(due[z], laid[z])]
    return lines


def _by_height(paths: Sequence[Path]) -> dict[float, Floats]:
    """Return the printing moves at each height, (n, 5): both ends and filament."""
    found: dict[float, list[tuple[float, ...]]] = defaultdict(list)
    for path in paths:
        data = path.read_bytes()
        text = (gzip.decompress(data) if path.suffix == ".gz" else data).decode()
        for z, *move in _moves(text.splitlines()):
            found[z].append(tuple(move))
    return {z: np.array(moves) for z, moves in found.items()}


def _moves(lines: Sequence[str]) -> Iterator[tuple[float, ...]]:
    """Yield height, both ends and filament of each move that prints."""
    at, steps = {"X": 0.0, "Y": 0.0, "Z": 0.0, "E": 0.0}, False
    for line in lines:
        code, _, rest = line.split(";")[0].strip().partition(" ")
        if code in ("M82", "M83"):
            steps = code == "M83"
        elif code == "G92":
            at |= {axis: float(v) for axis, v in WORD.findall(rest)}
        elif code in ("G2", "G3"):
            raise ValueError("arcs are not read here")
        elif code in ("G0", "G1"):
            to = at | {axis: float(v) for axis, v in WORD.findall(rest)}
            pushed = to["E"] - at["E"]
            if steps:
                pushed, to["E"] = (to["E"] if "E" in rest else 0.0), 0.0
            if pushed > 0.0 and (to["X"], to["Y"]) != (at["X"], at["Y"]):
                yield round(to["Z"], 3), at["X"], at["Y"], to["X"], to["Y"], pushed
            at = to


def _compared(due: Floats, laid: Floats) -> list[str]:
    """Return what is wrong at one height."""
    parts: dict[int, list[tuple[float, float, float]]] = defaultdict(list)
    lines = []
    begin, way = due[:, :2], due[:, 2:4] - due[:, :2]
    length = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-12)
    taken = np.zeros(len(due))  # of each move's length, what is printed of it so far
    for move in laid[np.argsort(-np.hypot(*(laid[:, 2:4] - laid[:, :2]).T))]:
        ends = move[:4].reshape(2, 1, 2) - begin
        along = (ends * way).sum(axis=2) / length
        beside = np.abs(ends[..., 0] * way[:, 1] - ends[..., 1] * way[:, 0]) / length
        low, high = along.min(axis=0), along.max(axis=0)
        free = taken + (high - low) <= length + 2.0 * NEAR_MM
        fits = (beside.max(axis=0) <= NEAR_MM) & (low >= -NEAR_MM) & (high <= length + NEAR_MM)
        rows = np.flatnonzero(fits & free)
        if not len(rows):
            lines.append(f"{move[:2]} to {move[2:4]} lies on nothing of the source, or twice on it")
            continue
        flow = np.abs(due[rows, 4] / length[rows] - move[4] / np.hypot(*(move[2:4] - move[:2])))
        row = int(rows[np.argmin(beside.max(axis=0)[rows] + 10.0 * flow)])
        taken[row] += high[row] - low[row]
        parts[row].append((float(low[row]), float(high[row]), float(move[4])))
    return lines + [line for row in range(len(due)) for line in _covered(due[row], parts[row])]


def _covered(move: Floats, parts: list[tuple[float, float, float]]) -> Iterator[str]:
    """Yield what is wrong with the parts of one move of the source."""
    said, length = f"{move[:2]} to {move[2:4]}", float(np.hypot(*(move[2:4] - move[:2])))
    reached = 0.0
    for low, high, _ in sorted(parts):
        if abs(low - reached) > 2.0 * NEAR_MM:
            yield f"{said}: {low:.4f} follows {reached:.4f}"
        reached = high
    if abs(reached - length) > 2.0 * NEAR_MM:
        yield f"{said} ends at {reached:.4f} of {length:.4f}"
    pushed = sum(part[2] for part in parts)
    if abs(pushed - move[4]) > EXACT_MM:
        yield f"{said} has {pushed:.6f} mm of filament, the source {move[4]:.6f}"
