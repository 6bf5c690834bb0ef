"""Rollouts over clusters: a random feasible order of clusters, each printed greedily.

Within a cluster the next contour is the nearest feasible one from where the
nozzle stands, so its order depends only on where the cluster is entered. (The
paper asks for nothing better there: clusters are those subgraphs "in which
optimization of the toolpath beyond a layer-by-layer solution is not needed".)

References
----------
Yoo et al. 2020, Sec. III-A (rollouts, Eq. 3) and III-B (clusters).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from decmcts._kernels.jit import kernel
from decmcts._kernels.sequence.metric import Metric, distance

NOWHERE = -1  # the nozzle before the first contour: any start is free
PRINTED, READY, PORT = range(3)  # of `Rollout.tally`


class Clustered(NamedTuple):
    """A print and its clusters; the cluster graph has no cycle."""

    metric: Metric
    reversible: NDArray[np.bool_]  # (n,)
    pred_offsets: NDArray[np.int64]  # (n + 1,)
    succ_offsets: NDArray[np.int64]  # (n + 1,)
    succs: NDArray[np.int32]  # (m,)
    label: NDArray[np.int32]  # (n,) cluster of each contour
    member_offsets: NDArray[np.int64]  # (h + 1,)
    members: NDArray[np.int32]  # (n,) contours by cluster
    outer_preds: NDArray[np.int32]  # (h,) edges into each cluster from others


class Rollout(NamedTuple):
    """The print as far as one rollout has come; all arrays are mutated by it."""

    order: NDArray[np.int32]  # (n,)
    reversed: NDArray[np.uint8]  # (n,) by contour
    waiting: NDArray[np.int32]  # (n,) predecessors not yet printed
    outer: NDArray[np.int32]  # (h,) edges into each cluster not yet satisfied
    ready: NDArray[np.int32]  # (h,) clusters that may be next, the first tally[READY]
    local: NDArray[np.int32]  # (n,) contours of the open cluster that may be next
    tally: NDArray[np.int64]  # (3,) contours PRINTED, clusters READY, PORT the nozzle is at
    travel: NDArray[np.float64]  # (1,) in the metric's unit


@kernel
def reset(clustered: Clustered, rollout: Rollout) -> None:
    """Mutate the rollout: nothing is printed yet."""
    n_ready = 0
    for c in range(len(rollout.waiting)):
        rollout.waiting[c] = clustered.pred_offsets[c + 1] - clustered.pred_offsets[c]
    for h in range(len(rollout.outer)):
        rollout.outer[h] = clustered.outer_preds[h]
        if rollout.outer[h] == 0:
            rollout.ready[n_ready] = h
            n_ready += 1
    rollout.tally[PRINTED], rollout.tally[READY], rollout.tally[PORT] = 0, n_ready, NOWHERE
    rollout.travel[0] = 0.0


@kernel
def _nearest(
    metric: Metric,
    reversible: NDArray[np.bool_],
    local: NDArray[np.int32],
    n_local: int,
    at: int,
) -> tuple[int, int, float]:
    """Return slot, direction and distance of the nearest of the first `n_local` contours."""
    slot, is_reversed, shortest = -1, 0, np.inf
    for k in range(n_local):
        c = local[k]
        for f in range(2 if reversible[c] else 1):
            d = 0.0 if at == NOWHERE else distance(metric, at, 2 * c + f)
            if d < shortest or (d == shortest and c < local[slot]):
                slot, is_reversed, shortest = k, f, d
    return slot, is_reversed, shortest


@kernel
def _release(clustered: Clustered, rollout: Rollout, c: int, n_local: int) -> int:
    """Mutate the rollout for the printing of c; return how many of its cluster may be next."""
    h = clustered.label[c]
    for e in range(clustered.succ_offsets[c], clustered.succ_offsets[c + 1]):
        b = clustered.succs[e]
        g = clustered.label[b]
        rollout.waiting[b] -= 1
        if g != h:
            rollout.outer[g] -= 1
            if rollout.outer[g] == 0:
                rollout.ready[rollout.tally[READY]] = g
                rollout.tally[READY] += 1
        elif rollout.waiting[b] == 0:
            rollout.local[n_local] = b
            n_local += 1
    return n_local


@kernel
def nearest_cluster(clustered: Clustered, rollout: Rollout) -> int:
    """Return the ready cluster with the contour nearest to the nozzle, which stands somewhere."""
    metric, reversible, at = clustered.metric, clustered.reversible, rollout.tally[PORT]
    found, shortest = rollout.ready[0], np.inf
    for k in range(rollout.tally[READY]):
        h = rollout.ready[k]
        for x in range(clustered.member_offsets[h], clustered.member_offsets[h + 1]):
            c = clustered.members[x]
            if rollout.waiting[c] > 0:
                continue
            for f in range(2 if reversible[c] else 1):
                d = distance(metric, at, 2 * c + f)
                if d < shortest or (d == shortest and h < found):
                    found, shortest = h, d
    return int(found)


@kernel
def print_cluster(clustered: Clustered, rollout: Rollout, h: int) -> None:
    """Mutate the rollout: print cluster h, which must be ready, nearest feasible first."""
    metric, reversible, local = clustered.metric, clustered.reversible, rollout.local
    slot = 0
    while rollout.ready[slot] != h:
        slot += 1
    rollout.tally[READY] -= 1
    rollout.ready[slot] = rollout.ready[rollout.tally[READY]]
    n_local = 0
    for x in range(clustered.member_offsets[h], clustered.member_offsets[h + 1]):
        if rollout.waiting[clustered.members[x]] == 0:
            local[n_local] = clustered.members[x]
            n_local += 1
    while n_local > 0:
        slot, f, d = _nearest(metric, reversible, local, n_local, rollout.tally[PORT])
        c = local[slot]
        local[slot] = local[n_local - 1]
        n_local = _release(clustered, rollout, c, n_local - 1)
        rollout.order[rollout.tally[PRINTED]], rollout.reversed[c] = c, f
        rollout.tally[PRINTED] += 1
        rollout.tally[PORT] = 2 * c + 1 - f
        rollout.travel[0] += d
