"""What a person says of heads: who prints no more and where it stands, and who is late."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.formats.files.bounds import LARGEST_MM
from decmcts.print.machine import Head, Machine, Point, Stands
from decmcts.print.machine_fit import refuse_unknown_head
from decmcts.print.plan import PlanDocument
from decmcts.print.print_state import PrintState, whereabouts

PARKED, SLOWEST = "park", 10.0
BEYOND_MM = 10.0  # so far beside reach and park a head may be pushed


def fenced_places(
    stated: Sequence[str], document: PlanDocument, state: PrintState, *, seen: bool
) -> dict[str, Stands]:
    """Return the heads that print no more, and where each stands.

    Parameters
    ----------
    stated : Sequence[str]
        Heads as ``NAME``, ``NAME=park`` or ``NAME=X,Y,Z``. Those that failed by the events need
        not be named; where they stand now may be.
    seen : bool
        Whether events say where heads are: one that was at an action may have gone on to its
        end, and one that no event is of is still parked.

    Raises
    ------
    InputError
        For heads the machine has not, or named twice, places that are none, and where no place is
        known.
    """
    machine, last = document.machine, dict[str, Stands]()
    if seen:
        last |= {head.name: head.park for head in machine.heads}
        last |= {
            head.head: _line(whereabouts(head, actions, machine.head(head.head).park))
            for head, actions in zip(state.heads, document.plan.heads, strict=True)
        }
    places = {name: last[name] for name in state.failed}
    named = set[str]()
    for text in stated:
        name, place = stated_place(text, machine)
        _refuse_twice("--fenced", text, name, named)
        if place is not None:
            places[name] = place
        elif name in last:
            places[name] = last[name]
        else:
            raise InputError(
                f"--fenced {text}: no event says where head {name} stands",
                advice=f"name the place: --fenced {name}=park or --fenced {name}=X,Y,Z",
            )
    return places


def stated_place(text: str, machine: Machine) -> tuple[str, Point | None]:
    """Return a head and where a person says that it stands, None: that is not said.

    Raises
    ------
    InputError
        For heads the machine has not, and places that are none, or that the head cannot be at.
    """
    name, has_place, place = text.partition("=")
    refuse_unknown_head("--fenced", text, name, machine)
    if not has_place:
        return name, None
    head = machine.head(name)
    return name, head.park if place == PARKED else _point(text, place, head)


def _line(line: NDArray[np.float64]) -> Stands:
    return tuple((x, y, z) for x, y, z in line.tolist())


def late_heads(stated: Sequence[str], machine: Machine) -> dict[str, float]:
    """Return the heads that are late, by ``NAME=FACTOR``: how many times as long they take.

    Raises
    ------
    InputError
        For heads the machine has not, or named twice, and factors that are none.
    """
    found, named = dict[str, float](), set[str]()
    for text in stated:
        name, _, factor = text.partition("=")
        refuse_unknown_head("--slower", text, name, machine)
        _refuse_twice("--slower", text, name, named)
        try:
            found[name] = float(factor)
        except ValueError:
            found[name] = math.nan
        if not 1.0 <= found[name] <= SLOWEST:
            raise InputError(
                f"--slower {text}: {factor!r} is no factor",
                advice=f"give how many times as long as planned it takes, 1 to {SLOWEST:g}",
            )
    return found


def _refuse_twice(option: str, text: str, name: str, named: set[str]) -> None:
    """Raise InputError for a head that an option has named already; mutates `named`."""
    if name in named:
        raise InputError(f"{option} {text}: head {name} is named twice", advice="name it once")
    named.add(name)


def _point(text: str, place: str, head: Head) -> Point:
    """Return coordinates as a place where a head can be, mm."""
    try:
        x, y, z = map(float, place.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(abs(v) <= LARGEST_MM for v in (x, y, z)):
        raise InputError(
            f"--fenced {text}: {place!r} is no place",
            advice=f"give park, or three numbers X,Y,Z within ±{LARGEST_MM:g} mm",
        )
    low = np.minimum(head.reach_min, head.park) - BEYOND_MM
    high = np.maximum(head.reach_max, head.park) + BEYOND_MM
    for axis, at, least, most in zip("XYZ", (x, y, z), low.tolist(), high.tolist(), strict=True):
        if not least <= at <= most:
            raise InputError(
                f"--fenced {text}: head {head.name} cannot be at {axis} {at:g}: with its park it "
                f"reaches {least + BEYOND_MM:g} to {most - BEYOND_MM:g} mm",
                advice="say where its nozzle is, X,Y,Z in mm",
            )
    return x, y, z
