"""Where on the bed a print must lie so that some head can print each of its contours."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decmcts.print.contours import Contours, taken
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.team.engine.space import able_heads, contour_boxes

STEP_MM = 5.0  # between places that are tried
MOST_S = 5.0
ROUND_MM = 1.0  # contours whose boxes are as large, rounded, count as one


def place_that_fits(job: PrintJob, machine: Machine) -> tuple[float, float] | None:
    """Return how the whole print must be moved, x and y in mm; None: no place was found.

    Places lie `STEP_MM` apart around where the print is, the nearest first, for at most `MOST_S`.
    Tried at each are contours that lie within no other, the lowest and the highest of those that
    cover the same; of a place that is good for them then all.
    """
    contours = job.contours
    largest = replace(job, contours=taken(contours, _largest(contours)), acceleration=None)
    boxes = contour_boxes(contours)
    least = np.array(machine.bed_min) - boxes[:, 0::2].min(axis=0)
    most = np.array(machine.bed_max) - boxes[:, 1::2].max(axis=0)
    x, y = (
        STEP_MM * np.arange(np.ceil(a / STEP_MM), np.floor(b / STEP_MM) + 1.0)
        for a, b in zip(least, most, strict=True)
    )
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    until = time.perf_counter() + MOST_S
    for place in places[np.argsort(np.abs(places).sum(axis=1), kind="stable")]:
        tried = (able_heads(_moved(each, place), machine) for each in (largest, job))
        if all(able.any(axis=1).all() for able in tried):
            return float(place[0]), float(place[1])
        if time.perf_counter() > until:
            break
    return None


def _moved(job: PrintJob, by: NDArray[np.float64]) -> PrintJob:
    points = job.contours.points + np.append(by, 0.0)
    return replace(job, contours=replace(job.contours, points=points))


def _largest(contours: Contours) -> NDArray[np.int64]:
    """Return the contours whose boxes lie within no other's of their tool, lowest and highest."""
    boxes = np.round(contour_boxes(contours) / ROUND_MM)
    kept = set[int]()
    for height in (contours.bottom, -contours.top):
        order = np.argsort(height, kind="stable")
        kept.update(order[_outermost(boxes[order], contours.tool[order])].tolist())
    return np.array(sorted(kept), np.int64)


def _outermost(boxes: NDArray[np.float64], tool: NDArray[np.int16]) -> list[int]:
    """Return the rows whose boxes lie within no other's of their tool; of equal ones the first."""
    key = np.column_stack([boxes * [1, -1, 1, -1], tool])  # the largest come first
    kept = list[int]()
    for row in np.unique(key, axis=0, return_index=True)[1].tolist():
        others = boxes[kept]
        within = (others[:, 0::2] <= boxes[row, 0::2]) & (others[:, 1::2] >= boxes[row, 1::2])
        if not (within.all(axis=1) & (tool[kept] == tool[row])).any():
            kept.append(row)
    return kept
