"""Who prints a rest: heads that are fenced, heads that are late, tools that print for others.

Heads that failed are obstacles where they may stand: the reach of one that lives is lessened to
one side of the obstacle, so that it never comes near, whatever it does. That is more careful than
it has to be where heads could pass.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from decmcts.arrays import Floats
from decmcts.errors import InputError
from decmcts.formats.files.bounds import LARGEST_MM
from decmcts.formats.gcode.text.source_text import load_text
from decmcts.planning.problem.own_tools import one_tool_each
from decmcts.planning.problem.source import Source
from decmcts.print.contours import Contours
from decmcts.print.kinematics import separations
from decmcts.print.machine import Head, Machine, Point, Stands, line_of
from decmcts.print.machine_fit import refuse_unknown_head
from decmcts.print.plan import PlanDocument
from decmcts.print.print_state import PrintState, whereabouts

PARKED, SLOWEST = "park", 10.0
BEYOND_MM = 10.0  # so far beside reach and park a head may be pushed
OPTION = "--print-with"
_PAIR = re.compile(r"([0-9]{1,4})=([0-9]{1,4})", re.ASCII)
_DIAMETERS = re.compile(rb"^[;#][ \t]*filament_diameter[ \t]*=[ \t]*([^\r\n]*)", re.M)
Box = tuple[Floats, Floats]  # lower and upper corner, mm
ALL_FENCED = (
    "name fewer with --fenced; if by the events all of them failed, say what is printed"
    " by --layer N or --height Z in place of --events"
)
BESIDE_MM = 0.01  # more than it must be: files round


def fenced_places(
    stated: Sequence[str], document: PlanDocument, state: PrintState, *, seen: bool
) -> dict[str, Stands]:
    """Return the heads that print no more, and where each stands.

    `stated` are heads as ``NAME``, ``NAME=park`` or ``NAME=X,Y,Z``. Those that failed by the events
    need not be named; where they stand now may be. If events are `seen` they say where heads are:
    one that was at an action may have gone on to its end, and one that no event is of is still
    parked. Raises InputError for heads the machine has not, or named twice, places that are none,
    and where no place is known.
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

    Raises InputError for heads the machine has not, and places that are none, or that the head
    cannot be at.
    """
    name, has_place, place = text.partition("=")
    refuse_unknown_head("--fenced", text, name, machine)
    if not has_place:
        return name, None
    head = machine.head(name)
    return name, head.park if place == PARKED else _point(text, place, head)


def _line(line: Floats) -> Stands:
    return tuple((x, y, z) for x, y, z in line.tolist())


def late_heads(stated: Sequence[str], machine: Machine) -> dict[str, float]:
    """Return the heads that are late, by ``NAME=FACTOR``: how many times as long they take.

    Raises InputError for heads the machine has not, or named twice, and factors that are none.
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


def other_tools(stated: Sequence[str], machine: Machine, contours: Contours) -> dict[int, int]:
    """Return tools and those that print for them, by ``TOOL=OTHER``.

    Raises InputError for what is no pair of tools of the print, chains, and where heads have not
    one tool each.
    """
    pairs = dict[int, int]()
    for text in stated:
        match = _PAIR.fullmatch(text)
        if match is None:
            raise _refused(text, "it is no pair of tools", "give two numbers, as in 0=1")
        due, has = int(match[1]), int(match[2])
        if pairs.get(due, has) != has:
            raise _refused(text, f"tool {pairs[due]} prints for tool {due} already", "name one")
        pairs[due] = has
    for due, has in pairs.items():
        _refuse_pair(f"{due}={has}", due, has, machine, contours)
        if has in pairs:
            what = f"tool {has} does not print itself: {has}={pairs[has]}"
            raise _refused(f"{due}={has}", what, "name tools that print")
    return dict(sorted(pairs.items()))


def _refuse_pair(text: str, due: int, has: int, machine: Machine, contours: Contours) -> None:
    tools = np.unique(contours.tool).tolist()
    named = ", ".join(map(str, tools))
    if due == has:
        raise _refused(text, "it is one tool", "name another")
    if len(tools) < 2:
        raise _refused(text, f"the print has one tool, {named}", "any head may print it")
    for tool in (due, has):
        if tool not in tools:
            raise _refused(text, f"the print has no tool {tool}", f"its tools are {named}")
    if not one_tool_each(machine, contours):
        what = f"the heads of {machine.name} have not one tool each"
        raise _refused(text, what, "give each head its `tools` in the machine file")


def _refused(text: str, what: str, advice: str) -> InputError:
    return InputError(f"{OPTION} {text}: {what}", advice=advice)


def refuse_unfit(other: Mapping[int, int], machine: Machine, gone: Sequence[str]) -> None:
    """Raise InputError unless other tools' heads print, and those are `gone` that they are for."""
    for due, has in other.items():
        text = f"{due}={has}"
        living = [head for head in machine.heads if head.name not in gone]
        if (head := _head_of(living, due)) is not None:
            advice = f"name it with --fenced {head} if it prints no more"
            raise _refused(text, f"head {head} has tool {due} and lives", advice)
        if _head_of(living, has) is None:
            advice = f"the heads that live are {', '.join(each.name for each in living)}"
            raise _refused(text, f"no head that lives has tool {has}", advice)


def _head_of(heads: Sequence[Head], tool: int) -> str | None:
    return next((head.name for head in heads if tool in head.tools), None)


def needed(other: Mapping[int, int], machine: Machine, contours: Contours) -> dict[int, int]:
    """Return those pairs of which no living head has the one tool, and some has the other.

    `machine` is that of the heads that live.
    """
    tools = np.unique(contours.tool).tolist()
    has = {tool for head in machine.heads for tool in head.tools}
    return {a: b for a, b in other.items() if a in tools and a not in has and b in has}


def refuse_other_diameters(source: Source, other: Mapping[int, int]) -> None:
    """Raise InputError where the filaments of two tools differ in diameter, as the file states it.

    So much of E is another amount then.
    """
    stated = _DIAMETERS.findall(load_text(source.path, source.plate)) if other else []
    values = re.split(r"[,;]", stated[-1].decode("utf-8", "replace")) if stated else []
    mm = [value.strip().strip('"') for value in values]
    for due, has in other.items():
        if max(due, has) < len(mm) and mm[due] != mm[has]:
            raise InputError(
                f"{OPTION} {due}={has}: filament of tool {due} is {mm[due]} mm thick, of tool "
                f"{has} {mm[has]} mm, so as much of it is another amount",
                path=source.path,
            )


def living_machine(machine: Machine, fenced: Mapping[str, Stands], rest: Contours) -> Machine:
    """Return the machine without heads that are `fenced` where they stand.

    Each head keeps the side from which it reaches the most of the `rest`. Raises InputError when no
    head lives, or one parks where it could touch one that is fenced.
    """
    heads = [head for head in machine.heads if head.name not in fenced]
    if not heads:
        raise InputError("every head is fenced, so none is left to print with", advice=ALL_FENCED)
    known = {head.name: head for head in machine.heads}
    for name, stands in fenced.items():
        line = line_of(stands)
        there = line.min(axis=0), line.max(axis=0)
        heads = [_beside(machine, head, known[name], there, rest) for head in heads]
    return machine.of_heads(heads)


def slowed(machine: Machine, slower: Mapping[str, float]) -> Machine:
    """Return the machine with heads that take so many times as long as they did."""
    heads = [replace(head, pace=head.pace * slower.get(head.name, 1.0)) for head in machine.heads]
    return replace(machine, heads=tuple(heads))


def _beside(machine: Machine, head: Head, gone: Head, there: Box, rest: Contours) -> Head:
    """Return a head whose reach keeps clear of one that stands anywhere in a box."""
    for kept in separations(machine, gone.name, head.name):
        nearest = float(there[kept.side > 0][kept.axis])
        limit = nearest + kept.side * kept.least_mm
        head = _cut(head, gone, kept.axis, limit, upwards=kept.side > 0)
    low, high = _forbidden(machine, head, gone, there)
    sides = [(axis, float(low[axis]), False) for axis in (0, 1)]
    sides += [(axis, float(high[axis]), True) for axis in (0, 1)]
    if any(_keeps(head, *side) for side in sides):
        return head
    free = [side for side in sides if _parks(head, *side)]
    if not free:
        raise _in_the_way(head, gone)
    cut = [_cut(head, gone, axis, limit, upwards=upwards) for axis, limit, upwards in free]
    return max(cut, key=lambda one: _reached(one, rest))


def _forbidden(machine: Machine, head: Head, gone: Head, there: Box) -> Box:
    """Return where the nozzle of a head might touch one that stands there, seen from above."""
    (low, high), (its_low, its_high) = _outline(head), _outline(gone)
    margin = max(machine.head_clearance_mm, machine.clearance_mm) + BESIDE_MM
    return there[0][:2] + its_low - high - margin, there[1][:2] + its_high - low + margin


def _outline(head: Head) -> Box:
    """Return the box around all of a head, seen from above, with its nozzle at the origin."""
    corners = [np.zeros((1, 2))]
    corners += [np.asarray(polygon) for one in head.slices for polygon in one.polygons]
    corners += [np.array([body.minimum[:2], body.maximum[:2]]) for body in head.bodies]
    every = np.concatenate(corners)
    return every.min(axis=0), every.max(axis=0)


def _keeps(head: Head, axis: int, limit: float, upwards: bool) -> bool:
    """Tell whether all of a head's reach, and its park, lie on this side."""
    ends = (head.reach_min if upwards else head.reach_max)[axis], head.park[axis]
    return min(ends) >= limit if upwards else max(ends) <= limit


def _parks(head: Head, axis: int, limit: float, upwards: bool) -> bool:
    return head.park[axis] >= limit if upwards else head.park[axis] <= limit


def _cut(head: Head, gone: Head, axis: int, limit: float, *, upwards: bool) -> Head:
    """Return a head whose reach ends at `limit`; raises InputError if it parks beyond."""
    if not _parks(head, axis, limit, upwards):
        raise _in_the_way(head, gone)
    low, high = list(head.reach_min), list(head.reach_max)
    if upwards:
        low[axis] = max(low[axis], limit)
        high[axis] = max(high[axis], limit)  # one that reaches nothing there stays where it parks
    else:
        high[axis] = min(high[axis], limit)
        low[axis] = min(low[axis], limit)
    return replace(
        head, reach_min=(low[0], low[1], low[2]), reach_max=(high[0], high[1], high[2])
    )  # fmt: skip


def _reached(head: Head, rest: Contours) -> int:
    """Return how many points of the rest lie within a head's reach."""
    inside = (rest.points >= head.reach_min) & (rest.points <= head.reach_max)
    return int(inside.all(axis=1).sum())


def _in_the_way(head: Head, gone: Head) -> InputError:
    return InputError(
        f"head {head.name} parks where it could touch head {gone.name}, which is fenced",
        advice=f"move {gone.name} away and name where it stands: --fenced {gone.name}=park or "
        f"{gone.name}=X,Y,Z",
    )
