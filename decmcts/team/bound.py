"""How fast two heads can be at best: a lower bound on the makespan.

At every moment two printing heads work on contours that do not conflict. With
W the time of all printing and M the most time such pairs can share, two heads
need at least W - M (`decmcts.team.pairing`). Travel is not counted. More than
two heads: W divided by their number instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.bound import longest_chain
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.job import PrintJob
from decmcts.print.machine import Machine
from decmcts.print.motion import job_times
from decmcts.team.pairing import pair_work
from decmcts.team.space import build_space

SAFETY = 1e-6  # relative; the solver's tolerance, taken off the bound


@dataclass(frozen=True, slots=True)
class Bound:
    """Lower bounds on the makespan in seconds, and what they allow at most."""

    serial_s: float  # W: all printing by one head, without travel
    overlap_s: float  # M: most time that two heads can print at once
    chain_s: float  # longest chain of the dependency graph
    exclusive_s: float  # most work that only one head can do
    bound_s: float  # no plan of these heads prints faster
    speedup: float  # serial_s / bound_s: at most so many times faster


def makespan_bound(
    job: PrintJob,
    machine: Machine,
    graph: DependencyGraph,
    *,
    seconds: NDArray[np.float64] | None = None,
) -> Bound:
    """Return the conflict-aware bound for all heads of the machine.

    Parameters
    ----------
    seconds : (n,) or None
        Printing time of each contour; None: the machine's time model.
    """
    space = build_space(job, machine)
    time = job_times(job, machine.limits) if seconds is None else seconds
    serial, heads = float(time.sum()), len(machine.heads)
    chain = float(longest_chain(time, graph.pred_offsets, graph.preds))
    alone = space.eligible.sum(axis=1) == 1
    exclusive = max(
        (float(time[alone & space.eligible[:, r]].sum()) for r in range(heads)), default=0.0
    )
    overlap = serial * (1.0 - 1.0 / heads)
    if heads == 2:
        overlap = min(overlap, pair_work(time, space).shared_s)
    bound = max(serial - overlap, chain, exclusive) * (1.0 - SAFETY)
    return Bound(serial, overlap, chain, exclusive, bound, serial / bound if bound > 0.0 else 1.0)
