"""Whether what happened left spots of a plan time to cool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decmcts.print.plan import ActionKind, PlanDocument
from sim.controllers.carry_out import Run
from sim.controllers.program import HeadProgram
from sim.rules.cooling import TooSoon, too_soon_in


def too_soon(
    document: PlanDocument, programs: Sequence[HeadProgram], run: Run
) -> tuple[TooSoon, ...]:
    """Return what a run of a plan's own actions prints over sooner than the plan's rule allows."""
    begin, end = np.full((2, len(document.contours)), np.inf)
    for actions, program, head in zip(document.plan.heads, programs, run.heads, strict=True):
        firsts = np.flatnonzero(np.diff(program.action, prepend=-1) != 0)
        lasts = np.append(firsts[1:], len(program.action)) - 1
        own = program.action[firsts]
        prints = actions.kind[own] == ActionKind.PRINT
        contours = actions.contour[own[prints]]
        begin[contours], end[contours] = head.begin[firsts[prints]], head.end[lasts[prints]]
    return tuple(too_soon_in(document, begin, end))
