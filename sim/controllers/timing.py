"""What goes wrong with time: moves take longer or shorter than they should, or not at once.

An error belongs to an action of a head, or of files to the stretch between two rests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sim.arrays import Floats, Ints
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
    return _DRAWS[timing](program, size, rng) if timing in _DRAWS else no_error(program)


def _uniform(program: HeadProgram, size: float, rng: np.random.Generator) -> Error:
    actions, of = _actions(program)
    factor = np.maximum(rng.uniform(1.0 - size, 1.0 + size, actions), LEAST_FACTOR)
    return Error(factor[of], np.zeros(len(of)))


def _heavy(program: HeadProgram, size: float, rng: np.random.Generator) -> Error:
    """Stalls of Pareto's distribution before few actions; at 0.2 of one action in a hundred."""
    actions, of = _actions(program)
    stall = np.minimum(STALL_S * rng.pareto(STALL_TAIL, actions), MOST_STALL_S)
    stall[rng.random(actions) >= STALL_SHARE * size / 0.2] = 0.0
    firsts = np.flatnonzero(np.diff(of, prepend=-1))
    stalls = np.zeros(len(of))
    stalls[firsts] = stall[of[firsts]]
    return Error(np.ones(len(of)), stalls)


def _drift(program: HeadProgram, size: float, rng: np.random.Generator) -> Error:
    """One factor for the whole print, and a slow walk round it a fifth as wide."""
    actions, of = _actions(program)
    walk = np.cumsum(rng.normal(size=actions)) / np.sqrt(max(actions, 1))
    factor = 1.0 + size * (rng.uniform(-1.0, 1.0) + 0.2 * walk)
    return Error(np.maximum(factor, LEAST_FACTOR)[of], np.zeros(len(of)))


def _actions(program: HeadProgram) -> tuple[int, Ints]:
    """Return how many actions have moves, and which of them each move is of, (m,)."""
    of = np.cumsum(np.diff(program.action, prepend=program.action[:1]) != 0)
    return int(of[-1]) + 1 if len(of) else 0, of.astype(np.int64)


_DRAWS: dict[Timing, Callable[[HeadProgram, float, np.random.Generator], Error]] = {
    Timing.UNIFORM: _uniform,
    Timing.HEAVY_TAILS: _heavy,
    Timing.DRIFT: _drift,
}
