"""The beads of all contours as they are written, found for a whole print at once.

Most contours are **plain**: level and straight from point to point, at one feed and in one state of
the machine, with filament in each segment. All their lines are alike and are formatted together.
The others are written segment by segment (`decmcts.formats.gcode.writing.writer`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decmcts.arrays import Flags, Floats
from decmcts.formats.gcode.document import NO_ARC, GcodeDocument
from decmcts.print.job import PrintJob

NEAR_TIE = 1e-4  # of a last digit: so near to the middle between two numbers Python rounds

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class BeadRows:
    """Every contour run as sliced or reversed, from its own begin or end.

    Segment k of the arrays goes from point k - 1 to point k; the first row of a contour has none.
    """

    job: PrintJob
    offsets: list[int]  # (n + 1,) rows of each contour
    plain: list[bool]  # (n,)
    feed: list[float]  # (n,) of the last segment; of plain contours that of all
    state: list[int]  # (n,) likewise
    top: list[float]  # (n,) mm
    forth: Floats  # (n_points, 3) x and y where each segment ends, and its E as the file counts it
    back: Floats  # (n_points, 3) the same where contours run reversed
    rounded_off: Floats  # (n_points,) what the E words of moves leave out

    @classmethod
    def of(cls, document: GcodeDocument, job: PrintJob) -> BeadRows:
        """Return the beads of a print; O(points)."""
        contours = job.contours
        points, last = contours.points, contours.offsets[1:] - 1
        given = contours.extrusion * (document.e_area or 1.0)
        before = np.concatenate([points[:1], points[:-1]])
        return cls(
            job, contours.offsets.tolist(), _plain(document, job).tolist(),
            contours.feed[last].tolist(), document.point_state[last].tolist(),
            np.maximum.reduceat(points[:, 2], contours.offsets[:-1]).tolist() if len(last) else [],
            np.column_stack([points[:, :2], given]), np.column_stack([before[:, :2], given]),
            given - rounded(given, document.decimals[1]),
        )  # fmt: skip

    def ends(self, contour: int, *, is_reversed: bool) -> Floats:
        """Return where the segments of a contour end, and their E, in the order they are run."""
        rows = slice(self.offsets[contour] + 1, self.offsets[contour + 1])
        return self.back[rows][::-1] if is_reversed else self.forth[rows]

    def left(self, contour: int, *, is_reversed: bool) -> list[float]:
        """Return what the E words of a contour round off, in the same order."""
        rows = self.rounded_off[self.offsets[contour] + 1 : self.offsets[contour + 1]]
        left: list[float] = (rows[::-1] if is_reversed else rows).tolist()
        return left


def _plain(document: GcodeDocument, job: PrintJob) -> Flags:
    """Tell which contours are plain, (n,)."""
    contours = job.contours
    points, feed, state = contours.points, contours.feed, document.point_state
    begins, last = contours.offsets[:-1], contours.offsets[1:] - 1
    sizes = np.diff(contours.offsets)
    x, y, z = points.T.copy()
    odd = ~(contours.extrusion > 0.0) | (feed != np.repeat(feed[last], sizes))
    odd |= state != np.repeat(state[last], sizes)
    odd[1:] |= ((x[1:] == x[:-1]) & (y[1:] == y[:-1])) | (z[1:] != z[:-1])
    if len(document.arcs.centre):
        odd |= document.point_arc != NO_ARC
    odd[begins] = sizes < 2
    return ~np.logical_or.reduceat(odd, begins) if len(begins) else np.zeros(0, np.bool_)


def rounded(values: Floats, digits: int) -> Floats:
    """Return numbers rounded to some decimals exactly as Python and its formats round them."""
    scaled = values * 10.0**digits
    whole = np.rint(scaled)
    found = whole / 10.0**digits
    close = np.abs(np.abs(scaled - whole) - 0.5) < NEAR_TIE
    unsure = np.flatnonzero(close | (np.abs(scaled) > 1e9))
    found[unsure] = [round(value, digits) for value in values[unsure].tolist()]
    return np.asarray(found)


def level_part(way: Floats) -> Floats:
    """Return the first points of a way up to where it goes straight up or down.

    A wipe does not go back into a vertical bead.
    """
    step = np.diff(way, axis=0)
    upright = np.flatnonzero((step[:, 2] != 0.0) & (step[:, :2] == 0.0).all(axis=1))
    return way[: upright[0] + 1] if len(upright) else way


def first_part(way: Floats, length: float) -> Floats:
    """Return the first `length` mm of a polyline."""
    step = np.linalg.norm(np.diff(way, axis=0), axis=1)
    reach = np.cumsum(step)
    k = int(np.searchsorted(reach, length))
    if k >= len(step):
        return way
    before = reach[k - 1] if k else 0.0
    t = (length - before) / step[k] if step[k] > 0 else 0.0
    last = way[k] + t * (way[k + 1] - way[k])
    return np.concatenate([way[: k + 1], np.round(last, 3)[None]])
