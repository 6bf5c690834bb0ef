"""Where each head enters what it prints, chosen anew for the orders that were agreed on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from decmcts.errors import InputError
from decmcts.print.toolpath import Toolpath
from decmcts.search.problem import OrderProblem


def entered_anew(problem: OrderProblem, toolpaths: Sequence[Toolpath]) -> list[Toolpath]:
    """Return the toolpaths with the directions and entries of least travel for their orders.

    Exact for each head's order as `problem` prices travels: a dynamic programme over the
    ways to print each contour.

    Parameters
    ----------
    problem : OrderProblem
        The whole print, with the freedom and the seams that are allowed.
    toolpaths : Sequence[Toolpath]
        One a head; together every contour once.

    Raises
    ------
    InputError
        If a contour is missing or printed twice.
    """
    order = np.concatenate([toolpath.order for toolpath in toolpaths]).astype(np.int32)
    if not np.array_equal(np.sort(order), np.arange(len(problem))):
        raise InputError("the toolpaths do not print every contour once")
    # Heads one after the other are one order; the travels between them cost the same for all
    # but the two ends.
    flip, option = problem.visits_for(problem.metric(), order)
    entry = np.zeros(len(problem), np.int32)
    if problem.seams is not None:
        chosen = np.where(option >= 0, option, problem.seams.offsets[:-1])
        entry = problem.seams.vertices[chosen]
    return [
        replace(
            toolpath,
            reversed=flip[toolpath.order].astype(np.bool_),
            entry=np.ascontiguousarray(entry[toolpath.order], np.int32),
        )
        for toolpath in toolpaths
    ]
