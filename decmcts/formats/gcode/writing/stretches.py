"""Stretches of a source's contours as a source of their own: what is left of a print.

The text of contours that are printed goes; start code, end code and the blocks between stay.
Which stretches those are is decided in `decmcts.planning.replanning`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.gcode.document import NO_ARC, GcodeDocument
from decmcts.print.contours import PER_CONTOUR, Contours
from decmcts.print.job import PrintJob


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of one contour of the source, printed as the source runs."""

    of: int  # contour of the source
    points: NDArray[np.float64]  # (k, 3) mm
    extrusion: NDArray[np.float64]  # (k,) mm of filament of the segment ending here; 0 at first
    feed: NDArray[np.float64]  # (k,) mm/s
    row: NDArray[np.int64]  # (k,) point of the source whose segment each is a part of
    whole: bool  # it is all of the contour


def contours_of(source: Contours, stretches: Sequence[Stretch]) -> Contours:
    """Return stretches as contours; only whole ones may be loops."""
    of = np.array([s.of for s in stretches], np.int64)
    whole = np.array([s.whole for s in stretches], np.bool_)
    sizes = [len(s.points) for s in stretches]
    values = {name: getattr(source, name)[of] for name in PER_CONTOUR}
    return Contours(
        points=np.concatenate([np.empty((0, 3)), *(s.points for s in stretches)]),
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        extrusion=np.concatenate([np.empty(0), *(s.extrusion for s in stretches)]),
        feed=np.concatenate([np.empty(0), *(s.feed for s in stretches)]),
        **{**values, "closed": values["closed"] & whole},
    )


def with_stretches(
    job: PrintJob, document: GcodeDocument, stretches: Sequence[Stretch]
) -> tuple[PrintJob, GcodeDocument]:
    """Return the source with these stretches and nothing else.

    Raises
    ------
    InputError
        Where lines that stay move the head by themselves: they would do so once more, through
        what is printed.
    """
    contours = contours_of(job.contours, stretches)
    first = int(contours.epoch.min(initial=np.iinfo(np.int32).max))
    for block in document.blocks:
        if block.moves and block.epoch <= first:
            raise InputError(
                "these lines move the head and have been run: it would move so once more, through "
                "what is printed", path=document.path, line=block.line,
                advice="take them out of the source",
            )  # fmt: skip
    row = np.concatenate([np.empty(0, np.int64), *(s.row for s in stretches)])
    size = np.diff(contours.offsets)
    whole = np.repeat([s.whole for s in stretches], size)
    of = np.array([s.of for s in stretches], np.int64)
    begins = row[contours.offsets[:-1]] == job.contours.offsets[of]
    rate = None if job.acceleration is None else job.acceleration[row]
    text = replace(
        document,
        point_state=document.point_state[row],
        point_arc=np.where(whole, document.point_arc[row], NO_ARC).astype(np.int32),
        owed=np.where(begins, document.owed[of], 0.0),
    )
    return replace(job, contours=contours, acceleration=rate), text
