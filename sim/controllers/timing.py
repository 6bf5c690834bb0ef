"""What goes wrong with time: moves take longer or shorter than they should, or not at once.

An error belongs to an action of a head, or of files to the stretch between two rests.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from decmcts.arrays import Floats
from sim.controllers.program import HeadProgram

LEAST_FACTOR = 0.2  # of the due time, whatever is drawn
STALL_SHARE, STALL_S, STALL_TAIL = 0.01, 0.5, 1.5  # of actions, scale and exponent of Pareto
MOST_STALL_S = 600.0


class Timing(StrEnum):
    """Kinds of errors of time."""

    NONE = "none"
    UNIFORM = "uniform"  # each action, independently
    HEAVY_TAILS = "heavy-tails"  # few actions, some of them for long
    DRIFT = "drift"  # clocks that run apart
    ADVERSARIAL = "adversarial"  # delays that bring heads nearest


@dataclass(frozen=True, slots=True)
class Error:
    """What happens to the times of one head's moves."""

    factor: Floats  # (m,) times as long
    stall_s: Floats  # (m,) and so much later


def no_error(program: HeadProgram) -> Error:
    """Return an error that is none."""
    m = len(program.feed)
    return Error(np.ones(m), np.zeros(m))


def draw(timing: Timing, program: HeadProgram, size: float, rng: np.random.Generator) -> Error:
    """Draw the error of one head; `size` is the share by which times may be off (0.2: 20 %)."""
    of = np.cumsum(np.diff(program.action, prepend=program.action[:1]) != 0)  # (m,) with moves
    n = int(of[-1]) + 1 if len(of) else 0
    factor, stall = np.ones(n), np.zeros(n)
    match timing:
        case Timing.UNIFORM:
            factor = rng.uniform(1.0 - size, 1.0 + size, n)
        case Timing.DRIFT:  # one factor for all, and a slow walk round it a fifth as wide
            walk = np.cumsum(rng.normal(size=n)) / np.sqrt(max(n, 1))
            factor = 1.0 + size * (rng.uniform(-1.0, 1.0) + 0.2 * walk)
        case Timing.HEAVY_TAILS:  # by Pareto, before few actions; at 0.2 one in a hundred
            stall = np.minimum(STALL_S * rng.pareto(STALL_TAIL, n), MOST_STALL_S)
            stall[rng.random(n) >= STALL_SHARE * size / 0.2] = 0.0
    firsts = np.diff(of, prepend=-1) != 0
    return Error(np.maximum(factor, LEAST_FACTOR)[of], np.where(firsts, stall[of], 0.0))
