"""One order for everything, printed by one head at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.toolpath import Toolpath
from decmcts.team.space import build_space, require_printable


def share_out(
    order: NDArray[np.int32], eligible: NDArray[np.bool_], live: Sequence[int]
) -> NDArray[np.int64]:
    """Return which head prints each contour of `order`: it changes only where it must, (n,)."""
    head = np.empty(len(order), np.int64)
    now = max(live, key=lambda r: (int(eligible[:, r].sum()), -r))
    for i, contour in enumerate(order):
        if not eligible[contour, now]:
            now = next(r for r in live if eligible[contour, r])
        head[i] = now
    return head


def one_head_toolpaths(
    job: PrintJob, machine: Machine, toolpath: Toolpath, *, live: Sequence[int] | None = None
) -> list[Toolpath]:
    """Return the toolpaths, one per head, in which one head prints what it can in this order.

    The head that may print most does so; contours it can not print go to another.
    `schedule` then prints them one head at a time where they depend or conflict. `live`
    names the heads that may be used, by default all.

    Raises
    ------
    InputError
        If no head may print some contour.
    """
    eligible = build_space(job.contours, machine).eligible
    heads = range(len(machine.heads))
    usable = tuple(heads) if live is None else tuple(live)
    eligible = eligible & np.isin(heads, usable)
    require_printable(job.contours, machine, eligible)
    head = share_out(toolpath.order, eligible, usable)
    return [
        Toolpath(toolpath.order[head == r], toolpath.reversed[head == r], toolpath.entry[head == r])
        for r in heads
    ]
