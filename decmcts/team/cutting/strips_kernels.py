"""Strips of the heads' territories: heads print them in step, and share as much as they can."""

from __future__ import annotations

import numpy as np

from decmcts.arrays import Floats
from decmcts.compiled import inlined, kernel

HALVINGS = 24  # of the time of a strip, to find the longest


@kernel
def share_layer(done: Floats, price: Floats, apart: Floats, begin: Floats, end: Floats) -> float:
    """Write where the strips of one layer begin and end; return the seconds all steps take.

    The time of a strip is that of printing what lies in it and of the cuts at both its edges.
    At each step all heads take as long. Two heads that cannot share everything have steps of
    unequal length, in which they are as near as they may be. Else all steps are as long.

    Parameters
    ----------
    done : (k,)
        Seconds of printing up to each place; places are one unit apart.
    price : (k,)
        Seconds that a cut at each place costs either side of it; 0 at both ends.
    apart : (steps,)
        So far two heads are apart, in units, while they print strip i of their territories.
    begin, end : (heads, steps)
        Places; written to.
    """
    up = done + price
    down = done - price
    for i in range(1, len(done)):
        up[i] = max(up[i], up[i - 1])
    for i in range(len(done) - 2, -1, -1):
        down[i] = min(down[i], down[i + 1])
    if begin.shape[0] == 2:
        shared = _tight(done, price, up, apart, begin, end)
        if shared > 0.0 and end[0, -1] <= begin[1, 0]:
            return shared
    least, most = 0.0, 2.0 * (done[-1] + price.max()) / len(apart)
    for _ in range(HALVINGS):
        seconds = (least + most) / 2.0
        _strips(done, price, up, down, seconds, begin, end)
        if _are_apart(begin, end, apart):
            least = seconds
        else:
            most = seconds
    _strips(done, price, up, down, least, begin, end)
    return least * len(apart)


@inlined
def _tight(
    done: Floats, price: Floats, up: Floats, apart: Floats, begin: Floats, end: Floats,
) -> float:  # fmt: skip
    """Write strips of two heads that are just `apart` at each step; return their seconds.

    Where the first strip ends says where all others do: it is widened until the last head's
    last strip ends with the layer. 0: the layer is too narrow.
    """
    steps, last = len(apart), float(len(done) - 1)
    least, most = 0.0, max(0.0, last - apart[0])
    for _ in range(HALVINGS):
        first = (least + most) / 2.0
        if _chain(done, price, up, apart, first, begin, end) >= 0.0:
            least = first
        else:
            most = first
    if least <= 0.0 or _chain(done, price, up, apart, least, begin, end) < 0.0:
        return 0.0
    shared = 0.0
    for k in range(steps):
        shared += max(
            _seconds(done, price, begin[0, k], end[0, k]),
            _seconds(done, price, begin[1, k], end[1, k]),
        )
    return shared


@inlined
def _chain(
    done: Floats, price: Floats, up: Floats, apart: Floats, first: float, begin: Floats,
    end: Floats,
) -> float:  # fmt: skip
    """Write the strips where the first ends at `first`; return how much room is left; < 0: none."""
    steps, last = len(apart), float(len(done) - 1)
    a, b = first, first + apart[0]
    begin[0, 0], end[0, 0], begin[1, 0] = 0.0, a, b
    for k in range(steps - 1):
        seconds = _seconds(done, price, begin[0, k], a)
        b = _place_of(up, _value(done, b) - _value(price, b) + seconds)
        if b >= last:
            return -1.0
        end[1, k], begin[1, k + 1] = b, b
        begin[0, k + 1], a = a, max(a, b - apart[k + 1])
        end[0, k + 1] = a
    end[1, steps - 1] = last
    own = _seconds(done, price, begin[0, steps - 1], a)
    return _seconds(done, price, b, last) - own


@inlined
def _seconds(done: Floats, price: Floats, a: float, b: float) -> float:
    """Return the seconds of a strip from a to b."""
    return _value(done, b) - _value(done, a) + _value(price, a) + _value(price, b)


@inlined
def _strips(
    done: Floats, price: Floats, up: Floats, down: Floats, seconds: float, begin: Floats,
    end: Floats,
) -> None:  # fmt: skip
    """Write the strips that take so long: the last head's from its end, the others' from theirs."""
    heads, steps = begin.shape
    at = float(len(done) - 1)
    for k in range(steps - 1, -1, -1):
        end[heads - 1, k] = at
        at = _place_of(down, _value(done, at) + _value(price, at) - seconds)
        begin[heads - 1, k] = at
    first = _value(done, at)
    for head in range(heads - 1):
        at = _place_of(done, first * head / (heads - 1))
        for k in range(steps):
            begin[head, k] = at
            at = _place_of(up, _value(done, at) - _value(price, at) + seconds)
            end[head, k] = at


@inlined
def _are_apart(begin: Floats, end: Floats, apart: Floats) -> bool:
    """Tell whether heads stay apart at every step, and no strip lies in another territory."""
    heads, steps = begin.shape
    for head in range(heads - 1):
        if begin[head + 1, 0] < end[head, steps - 1]:
            return False
        for k in range(steps):
            if begin[head + 1, k] - end[head, k] < apart[k]:
                return False
    return True


@inlined
def _value(values: Floats, at: float) -> float:
    """Return the value at a place, linear in between."""
    i = min(int(at), len(values) - 2)
    return float(values[i] + (at - i) * (values[i + 1] - values[i]))


@inlined
def _place_of(values: Floats, value: float) -> float:
    """Return the first place at which ascending values reach a value, within their range."""
    i = int(np.searchsorted(values, value))
    if i == 0:
        return 0.0
    if i >= len(values):
        return float(len(values) - 1)
    return float(i - 1 + (value - values[i - 1]) / (values[i] - values[i - 1]))
