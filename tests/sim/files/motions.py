"""Moves of files, made by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.faults import Verdict
from sim.files.moves import check_moves


@dataclass(frozen=True)
class File:
    """What `read_motions` returns, by hand."""

    points: np.ndarray
    extrusion: np.ndarray
    feed: np.ndarray
    line: np.ndarray
    contour: np.ndarray
    width: np.ndarray
    height: np.ndarray
    placed: None = None
    arc: None = None
    arcs: None = None
    tool: None = None


def verify_motions(*given, **more) -> Verdict:
    """Return the verdict on the moves of a file."""
    return check_moves(*given, **more).verdict()
