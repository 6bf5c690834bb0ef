"""One fingerprint of a planning problem, equal on every platform and in every process.

A plan file carries `problem_digest`, of what is printed and on what: contours,
precedence and machine. Where the text came from (source lines, machine and source
names) is left out. Agents compare `team_digest` before they talk: it adds what the
same plans resolve to depends on, the source's process and the planner's own code.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from decmcts.arrays import Floats, Ints
from decmcts.feasibility.graph import DependencyGraph
from decmcts.print.contours import Contours
from decmcts.print.job import PrintJob
from decmcts.print.machine import Head, Idle, Machine

_HOME = Path(__file__).parents[1]
DIGEST_BYTES = 32
ROUND_TO = 1e-6  # mm, mm/s ...: numbers count as equal when they round to the same multiple
ROOMS_OF_A_PLAN = ("feasibility", "print", "search/sequence", "team")
NAN_STEPS, INF_STEPS = 2**62, 2**61
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


def team_digest(problem: str, job: PrintJob, *, code: str) -> str:
    """Return the digest agents compare, as 64 hexadecimal digits.

    Parameters
    ----------
    problem : str
        `problem_digest` of the same job; the limits of motion are its machine's.
    job : PrintJob
        Its settings, accelerations and refills count.
    code : str
        `code_digest` of the planner that resolves plans.
    """
    state = blake2b(digest_size=DIGEST_BYTES, person=b"decmcts-team-1")
    process = (job.settings, job.acceleration, job.refills)
    for value in (problem, code, *process):
        _absorb(state, value)
    return state.hexdigest()


@cache
def code_digest() -> str:
    """Return the digest of the source code that resolves plans: another version differs."""
    state = blake2b(digest_size=DIGEST_BYTES, person=b"decmcts-code-1")
    for room in ROOMS_OF_A_PLAN:
        for path in sorted((_HOME / room).rglob("*.py")):
            state.update(_text(path.relative_to(_HOME).as_posix()) + _text(path.read_text("utf-8")))
    return state.hexdigest()


def _absorb(state: blake2b, value: Any) -> None:
    """Hash a frozen dataclass, sequence, array, text, number or None; changes `state`."""
    if is_dataclass(value) and not isinstance(value, type):
        skipped = _ONLY_TEXT.get(type(value).__name__, set())
        for field in sorted(field.name for field in fields(value)):
            if field not in skipped and not _as_of_old(value, field):
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
        state.update(b"a" + _integers(array.ndim, *array.shape) + _steps(array).tobytes())


def _as_of_old(value: Any, field: str) -> bool:
    """Tell whether a newer field says what held before there was one: such digests stay."""
    if isinstance(value, Contours):
        return field in ("of", "along") and getattr(value, field) is None
    if not isinstance(value, Head):
        return False
    return (field == "pace" and value.pace == 1.0) or (field == "idle" and value.idle == Idle())


def _steps(array: Floats) -> Ints:
    """Return an array as multiples of `ROUND_TO`; infinite and absent ones have their own."""
    finite = np.isfinite(array)
    if finite.all():
        return np.asarray(np.rint(array / ROUND_TO).astype("<i8"))
    steps = np.rint(np.where(finite, array, 0.0) / ROUND_TO).astype("<i8")
    odd = np.where(np.isnan(array), NAN_STEPS, np.where(array > 0, INF_STEPS, -INF_STEPS))
    return np.asarray(np.where(finite, steps, odd), "<i8")


def _text(value: str) -> bytes:
    encoded = value.encode()
    return b"s" + _integers(len(encoded)) + encoded


def _integers(*values: int) -> bytes:
    return np.array(values, "<i8").tobytes()
