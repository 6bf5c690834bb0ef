"""One fingerprint of a planning problem, equal on every platform and in every process.

Agents compare it before they talk; a plan file carries it. What it covers is
what planning depends on: contours, precedence and machine. Where the text came
from (source lines, machine and source names) is left out.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from hashlib import blake2b
from typing import Any

import numpy as np

from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.machine import Machine

DIGEST_BYTES = 32
ROUND_TO = 1e-6  # mm, mm/s ...: numbers count as equal when they round to the same multiple
_ONLY_TEXT = {"Contours": {"line"}, "Machine": {"name", "source"}}


def problem_digest(contours: Contours, graph: DependencyGraph, machine: Machine) -> str:
    """Return the blake2b digest of a problem as 64 hexadecimal digits.

    Every number, whether kept as integer or float, is rounded to a multiple of 1e-6
    and hashed as that multiple, a little-endian 64-bit integer; every array after
    its shape, every field after its name; the precedence as its sorted stored edges.
    """
    state = blake2b(digest_size=DIGEST_BYTES, person=b"decmcts-problem1")
    pairs = graph.pairs()
    pairs = pairs[np.lexsort((pairs[:, 0], pairs[:, 1]))]
    for name, value in (("contours", contours), ("precedence", pairs), ("machine", machine)):
        state.update(_text(name))
        _absorb(state, value)
    return state.hexdigest()


def _absorb(state: blake2b, value: Any) -> None:
    """Hash a frozen dataclass, sequence, array, text, number or None; changes `state`."""
    if is_dataclass(value) and not isinstance(value, type):
        skipped = _ONLY_TEXT.get(type(value).__name__, set())
        for field in sorted(field.name for field in fields(value)):
            if field not in skipped:
                state.update(_text(field))
                _absorb(state, getattr(value, field))
    elif isinstance(value, tuple):
        state.update(b"t" + _integers(len(value)))
        for item in value:
            _absorb(state, item)
    elif isinstance(value, str):
        state.update(_text(value))
    elif value is None:
        state.update(b"n")
    else:
        array = np.asarray(value, np.float64)
        steps = np.rint(array / ROUND_TO)
        state.update(b"a" + _integers(array.ndim, *array.shape) + steps.astype("<i8").tobytes())


def _text(value: str) -> bytes:
    encoded = value.encode()
    return b"s" + _integers(len(encoded)) + encoded


def _integers(*values: int) -> bytes:
    return np.array(values, "<i8").tobytes()
