"""A small random generator whose whole state is one 64-bit word in an array.

Numba's own generator is global; kernels that take their state as an argument
can be run side by side and give equal results for equal seeds.

References
----------
Marsaglia 2003, "Xorshift RNGs", Journal of Statistical Software 8(14).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.compiled import kernel

_TO_UNIT = 2.0**-53


def seeded(seed: int) -> NDArray[np.uint64]:
    """Return a generator state, never zero; near seeds give unrelated streams."""
    word = int(np.random.SeedSequence(seed).generate_state(1, np.uint64)[0])
    return np.array([word or 1], np.uint64)


@kernel
def uniform(state: NDArray[np.uint64]) -> float:
    """Mutate `state`; return a number in (0, 1]; 1 by rounding, once in 2^53."""
    x = state[0]
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    x ^= x << np.uint64(17)
    state[0] = x
    return (np.float64(x >> np.uint64(11)) + 0.5) * _TO_UNIT


@kernel
def below(state: NDArray[np.uint64], n: int) -> int:
    """Mutate `state`; return an integer in 0..n - 1."""
    return min(int(uniform(state) * n), n - 1)


@kernel
def log_uniform(state: NDArray[np.uint64], least: float, most: float) -> float:
    """Mutate `state`; return a number in (least, most] whose logarithm is uniform."""
    return least * float((most / least) ** uniform(state))


@kernel
def length_up_to(state: NDArray[np.uint64], longest: int) -> int:
    """Mutate `state`; return a length in 1..longest, about log-uniform."""
    bits = 0
    while (1 << bits) < longest:
        bits += 1
    length = 1 + below(state, 1 << below(state, bits + 1))
    return min(length, longest)
