"""What the numbers in a head's plan mean.

A plan is a flat int32 sequence, so that it travels in a message as it is:

- macro-action ids (below `n_macros`) in the order the head wants to do them;
- before them at most one policy symbol (`n_macros + k`): how the head chooses
  between contours that are ready (row k of `POLICIES`);
- or a serial plan: the symbol `n_macros + len(POLICIES)`, then 2·contour +
  backwards for every contour: everything in this order, one head at a time.

Symbols that mean nothing are skipped: a plan may come from a peer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decmcts.print.toolpath import Toolpath

# Weights of the key, of waste and of being out of step (`decmcts._kernels.dispatch`); then how
# far the key is the chain that must come after (1) rather than the progress of the part (0).
POLICIES = np.array(
    [
        [20.0, 1.0, 3.0, 1.0],
        [10.0, 1.0, 10.0, 0.0],
        [60.0, 2.6, 0.5, 0.5],
        [80.0, 3.8, 5.0, 1.0],
        [8.0, 0.45, 1.4, 0.0],
        [50.0, 0.9, 7.8, 1.0],
        [18.0, 0.6, 3.7, 1.0],
        [15.0, 1.0, 0.5, 0.0],
        [44.0, 3.1, 7.4, 0.5],
        [60.0, 1.6, 30.0, 1.0],
        [10.0, 1.0, 0.0, 0.0],
        [30.0, 0.6, 1.0, 0.5],
        [3.0, 1.0, 3.0, 1.0],
        [1.0, 1.0, 0.0, 0.0],
    ]
)
BY_URGENCY = 3  # column of POLICIES


@dataclass(frozen=True, slots=True)
class Intent:
    """A decoded plan."""

    macros: NDArray[np.int32]  # (k,) in the order wanted, each once
    policy: int  # row of POLICIES
    serial: Toolpath | None  # everything in this order instead


def decode(plan: NDArray[np.int32], n_macros: int, n_contours: int) -> Intent:
    """Return what a plan says; what means nothing is skipped."""
    serial = n_macros + len(POLICIES)
    if len(plan) == n_contours + 1 and plan[0] == serial and n_contours:
        order, backwards = plan[1:] // 2, plan[1:] % 2 == 1
        if np.array_equal(np.sort(order), np.arange(n_contours)):
            return Intent(np.empty(0, np.int32), 0, Toolpath.of(order, backwards))
    named = plan[(plan >= n_macros) & (plan < serial)]
    known = plan[(plan >= 0) & (plan < n_macros)]
    _, first = np.unique(known, return_index=True)
    policy = int(named[0]) - n_macros if len(named) else 0
    return Intent(known[np.sort(first)].astype(np.int32), policy, None)


def encode(macros: NDArray[np.int32], policy: int, n_macros: int) -> NDArray[np.int32]:
    """Return the plan of these macro-actions under a policy."""
    return np.concatenate([[n_macros + policy], macros]).astype(np.int32)


def encode_serial(toolpath: Toolpath, n_macros: int) -> NDArray[np.int32]:
    """Return the plan that prints everything in this order, one head at a time."""
    symbols = 2 * toolpath.order + toolpath.reversed
    return np.concatenate([[n_macros + len(POLICIES)], symbols]).astype(np.int32)
