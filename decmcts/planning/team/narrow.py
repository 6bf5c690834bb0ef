"""Prints that lie along a rail where heads could share them only if they were turned."""

from __future__ import annotations

import numpy as np

from decmcts.print.contours import Role
from decmcts.print.job import PrintJob
from decmcts.print.kinematics import widest
from decmcts.print.machine import Machine

WORTH = 0.3  # of the print more that two heads could print at once, turned


def narrow_note(job: PrintJob, machine: Machine) -> str | None:
    """Return the line to say where a print turned by 90 degrees could be shared by more.

    Two heads that keep L mm apart along a rail can print 2 (B - L) / B of an even part of width B
    at once, at most all of it. Skirts do not count. The rest of a print that stands on the bed
    already cannot be turned.
    """
    contours = job.contours
    mine = np.repeat(contours.role != Role.SKIRT_BRIM, np.diff(contours.offsets))
    kept = widest(machine)
    if kept is None or job.printed is not None or not mine.any():
        return None
    apart = kept.least_mm
    sizes = np.ptp(contours.points[mine, :2], axis=0)
    along, across = float(sizes[kept.axis]), float(sizes[1 - kept.axis])
    if shared(across, apart) < shared(along, apart) + WORTH:
        return None
    x, y = "xy"[kept.axis], "yx"[kept.axis]
    return (
        f"the print is {along:.0f} mm wide along {x}, where heads keep {apart:.0f} mm apart, and "
        f"{across:.0f} mm along {y}: turned by 90° in the slicer, heads could share more of it"
    )


def shared(width_mm: float, apart_mm: float) -> float:
    """Return which part of an even print of a width two heads can print at once, 0 to 1."""
    return float(np.clip(2.0 * (width_mm - apart_mm) / max(width_mm, 1e-9), 0.0, 1.0))
