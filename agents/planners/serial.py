"""The explicit serial order: what agents agree on whose hosts resolve plans differently.

One head's plan states the order of all contours (`encode_serial`); who prints what
follows from which head may. The digest is of whole numbers only, and the order is
checked against this host's own precedence and reach, so hosts whose arithmetic
differs agree on it. No messages here.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b

import numpy as np

from agents.messages.kinds import Plans
from decmcts.errors import InputError
from decmcts.print.toolpath import Toolpath
from decmcts.team.engine.alone import one_head_toolpaths
from decmcts.team.engine.plans import decode, encode_serial
from decmcts.team.engine.problem import TeamProblem
from decmcts.team.engine.resolve import Resolved, as_allowed, resolve


def serial_plans(problem: TeamProblem, live: Sequence[int]) -> Plans:
    """Return plans that state the source's own order."""
    order = Toolpath.as_sliced(len(problem.job.contours))
    return {min(live): encode_serial(order, problem.n_macros)}


def joint_order(problem: TeamProblem, plans: Plans, live: Sequence[int]) -> Resolved:
    """Return the joint order of some plans: checked if they state one, else resolved.

    InputError if no live head may print some contour, or a stated order breaks the precedence.
    """
    stated = _stated(problem, plans, live)
    order = None if stated is None else as_allowed(problem, stated)
    if order is None and stated is not None:
        raise InputError("the serial order contradicts the precedence")
    found = resolve(problem, plans, live)
    if order is None:
        return found
    toolpaths = tuple(one_head_toolpaths(problem.job, problem.machine, order, live=live))
    return Resolved(toolpaths, found.makespan_s, _digest(toolpaths))


def _stated(problem: TeamProblem, plans: Plans, live: Sequence[int]) -> Toolpath | None:
    """Return the order that the first live head with one states."""
    n = len(problem.job.contours)
    decoded = (decode(plans[r], problem.n_macros, n).serial for r in sorted(live) if r in plans)
    return next((order for order in decoded if order is not None), None)


def _digest(toolpaths: Sequence[Toolpath]) -> str:
    state = blake2b(digest_size=32, person=b"decmcts-serial-1")
    for head, toolpath in enumerate(toolpaths):
        symbols = 2 * toolpath.order.astype(np.int64) + toolpath.reversed
        for row in ([head, len(toolpath)], symbols, toolpath.turn):
            state.update(np.ascontiguousarray(row, "<i8").tobytes())
    return state.hexdigest()
