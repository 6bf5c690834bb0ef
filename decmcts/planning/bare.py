"""Bare problems: what they compile first, and what is checked of an answer."""

from __future__ import annotations

import math

import numpy as np

from decmcts.errors import VerificationError
from decmcts.formats.qcsp import QcspProblem
from decmcts.formats.sop import SopInstance
from decmcts.planning.events import Stop
from decmcts.search.sop.solver import SopResult, solve_sop
from decmcts.team.qcsp.solver import solve_qcsp


def compile_qcsp(problem: QcspProblem, stop: Stop) -> None:
    """Search a moment, so that compiling is off the clock."""
    solve_qcsp(problem, time_limit_s=math.inf, max_proposals=10, stop=stop)


def compile_sop() -> None:
    """Solve a small problem that no search proves at once, so that compiling is off the clock."""
    points = np.random.default_rng(0).random((40, 2))
    costs = np.linalg.norm(points[:, None] - points[None, :], axis=2)
    nothing = np.empty((0, 2), np.int32)
    solve_sop(costs, nothing, time_limit_s=math.inf, max_iterations=40_000)


def require_sound(instance: SopInstance, found: SopResult) -> None:
    """Raise VerificationError unless the result is what it says it is.

    The instance as read is the measure: each node once, no constraint broken, the
    cost as claimed.
    """
    position = np.empty(len(instance), np.int64)
    position[found.order] = np.arange(len(instance))
    a, b = instance.precedence.T
    cost = float(instance.costs[found.order[:-1], found.order[1:]].sum())
    if not (
        np.array_equal(np.sort(found.order), np.arange(len(instance)))
        and (position[a] < position[b]).all()
        and abs(cost - found.cost) <= 1e-6 * (1.0 + cost)
    ):
        raise VerificationError("the search returned a wrong sequence; nothing was written")
