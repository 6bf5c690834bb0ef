"""What the commands for bare problems (.sop, .qcsp) share: options refused, and what is proven."""

from __future__ import annotations

import math

import typer

from decmcts.cli.options import given
from decmcts.errors import InputError
from decmcts.search.bounds.certificate import INFORMS_PERCENT

_MEANT = frozenset({"source", "output", "time_limit", "seed", "as_json"})


def refuse_others(context: typer.Context, kind: str, has: str) -> None:
    """Raise InputError for an option given that means nothing to a file of this kind.

    `has` says what there is in it, and what is not.
    """
    for name, spellings in given(context).items():
        if name not in _MEANT:
            spelled = spellings[0 if context.params[name] else -1]
            raise InputError(
                f"{spelled} means nothing for a {kind} file: it has {has}", advice="leave it out"
            )


def proven(value: float, bound: float, *, optimal: bool) -> str:
    """Return in words how near to the best possible a cost or makespan is."""
    if optimal:
        return "proven optimal"
    gap = 100.0 * (value / bound - 1.0) if bound > 0.0 else math.inf
    near = f", at most {gap:.1f} % above optimal" if gap <= INFORMS_PERCENT else ""
    return f"bound {bound:,.10g}{near}"
