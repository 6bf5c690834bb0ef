"""Mutants of what the plan.json of a cut print says of its pieces.

Paths, actions and times stay as they are wherever that is possible, so a judge has to compare
what is said with the source.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from tests.mutants.catalogue import Mutant, NotHereError, pick
from tests.mutants.cut_rows import PER_SEGMENT, Plan, Row, brothers, per_segment, place_of

Rng = np.random.Generator
Spoil = Callable[[Plan, Rng], None]
GRID_E_MM = 1e-5


def _piece(plan: Plan, rng: Rng) -> Row:
    """Return the row of a piece of a contour that has several."""
    row: Row = plan["contours"][pick([p for ps in brothers(plan).values() for p in ps], rng)]
    return row


def _field(name: str, change: Callable[[Any], Any]) -> Spoil:
    def spoil(plan: Plan, rng: Rng) -> None:
        row = _piece(plan, rng)
        row[name] = change(row[name])

    return spoil


def _segment(name: str, change: Callable[[float], float]) -> Spoil:
    """Return a mutant of one printed segment of a piece."""

    def spoil(plan: Plan, rng: Rng) -> None:
        row = _piece(plan, rng)
        values = per_segment(row, name)
        k = pick([k for k, e in enumerate(row["extrusion"]) if e > 0.0], rng)
        values[k] = change(values[k])
        row[name] = values

    return spoil


def _hop(name: str, change: Callable[[float], float]) -> Spoil:
    """Return a mutant of one hop."""

    def spoil(plan: Plan, rng: Rng) -> None:
        hops = [
            (row, k) for row in plan["contours"] for k, e in enumerate(row["extrusion"]) if e == 0.0
        ]
        row, k = hops[pick(list(range(len(hops))), rng)]
        values = per_segment(row, name)
        values[k] = change(values[k])
        row[name] = values

    return spoil


def of_another(plan: Plan, rng: Rng) -> None:
    """Say of the last piece of a contour that it is of the next one."""
    last = [max(ps) for ps in brothers(plan).values() if max(ps) + 1 < len(plan["contours"])]
    plan["contours"][pick(last, rng)]["of"] += 1


def of_exchanged(plan: Plan, rng: Rng) -> None:
    """Exchange what two pieces beside one another in the list are of."""
    rows = plan["contours"]
    ends = [k for k in range(len(rows) - 1) if rows[k]["of"] != rows[k + 1]["of"]]
    k = pick(ends, rng)
    rows[k]["of"], rows[k + 1]["of"] = rows[k + 1]["of"], rows[k]["of"]


def places_exchanged(plan: Plan, rng: Rng) -> None:
    """Exchange the places of two pieces of one contour that have as many points."""
    rows = plan["contours"]
    alike = [
        (a, b) for ps in brothers(plan).values() for a, b in pairwise(ps)
        if len(rows[a]["along"]) == len(rows[b]["along"])
    ]  # fmt: skip
    a, b = alike[pick(list(range(len(alike))), rng)]
    rows[a]["along"], rows[b]["along"] = rows[b]["along"], rows[a]["along"]


def order_exchanged(plan: Plan, rng: Rng) -> None:
    """Exchange two pieces of one contour in the list, and in all that names them."""
    pieces = brothers(plan)[pick(list(brothers(plan)), rng)]
    a = pick(pieces[:-1], rng)
    rows, number = plan["contours"], {a: a + 1, a + 1: a}
    rows[a], rows[a + 1] = rows[a + 1], rows[a]
    rows[a]["id"], rows[a + 1]["id"] = a, a + 1
    named = [[number.get(c, c) for c in pair] for pair in plan["precedence"]]
    plan["precedence"] = [pair for pair in named if pair[0] < pair[1]]
    for head in plan["heads"]:
        for action in head["actions"]:
            action["contour"] = number.get(action["contour"], action["contour"])


def place_off(plan: Plan, rng: Rng) -> None:
    """State one place along the contour a little wrong."""
    row = _piece(plan, rng)
    k = int(rng.integers(len(row["along"])))
    row["along"][k] = abs(row["along"][k] + float(rng.uniform(0.005, 0.3) * rng.choice([-1, 1])))


def places_off(plan: Plan, rng: Rng) -> None:
    """State all places of a piece one vertex further."""
    row = _piece(plan, rng)
    row["along"] = [place + 1.0 for place in row["along"]]


def point_off(plan: Plan, rng: Rng) -> None:
    """Move one point of a piece, in the list and in its action."""
    row = _piece(plan, rng)
    actions, k = place_of(plan, row["id"])
    inner = list(range(1, len(row["points"]) - 1))
    p = pick(inner, rng)
    by = float(rng.uniform(0.002, 0.05))
    row["points"][p][1] += by
    path = actions[k]["path"]
    path[len(path) - 1 - p if actions[k]["reversed"] else p][1] += by


def turned_in_the_list(plan: Plan, rng: Rng) -> None:
    """List a piece from its end to its begin; its head still runs the same way."""
    row = _piece(plan, rng)
    actions, k = place_of(plan, row["id"])
    for name in ("points", "along"):
        row[name] = row[name][::-1]
    for name in PER_SEGMENT:
        if isinstance(row.get(name), list):
            row[name] = row[name][::-1]
    actions[k]["reversed"] ^= True


def filament_to_a_brother(plan: Plan, rng: Rng) -> None:
    """Give filament of one piece to its brother, within one segment of their contour."""
    rows = plan["contours"]
    pairs = [
        (a, b) for ps in brothers(plan).values() for a in ps for b in ps
        if rows[a]["along"][-1] == rows[b]["along"][0] and rows[b]["along"][0] % 1.0
    ]  # fmt: skip
    a, b = pairs[pick(list(range(len(pairs))), rng)]
    most = 0.5 * rows[a]["extrusion"][-1]
    moved = round(float(np.exp(rng.uniform(np.log(3e-5), np.log(max(most, 4e-5))))), 5)
    rows[a]["extrusion"][-1] -= moved
    rows[b]["extrusion"][0] += moved


def filament_within(plan: Plan, rng: Rng) -> None:
    """Move filament from one segment of a piece to the next."""
    row = _piece(plan, rng)
    laid = [k for k, e in enumerate(row["extrusion"]) if e > 2e-4]
    k = pick([k for k in laid if k + 1 in laid], rng)
    row["extrusion"][k] -= 1e-4
    row["extrusion"][k + 1] += 1e-4


def no_pieces(plan: Plan, rng: Rng) -> None:
    """Give the pieces as contours of a print that is not cut."""
    for row in plan["contours"]:
        del row["of"], row["along"]
    plan["version"] = 2
    del plan["rules"]["cut"]


def each_its_own(plan: Plan, rng: Rng) -> None:
    """Say that each piece is of a contour of its own."""
    for k, row in enumerate(plan["contours"]):
        row["of"] = k


def _without(name: str) -> Spoil:
    def spoil(plan: Plan, rng: Rng) -> None:
        del _piece(plan, rng)[name]

    return spoil


def _rule(value: str | None) -> Spoil:
    def spoil(plan: Plan, rng: Rng) -> None:
        outside = {"external_perimeter", "top_solid_infill"}
        cut = {plan["contours"][ps[0]]["role"] for ps in brothers(plan).values()}
        if value == "inside" and not cut & outside:
            raise NotHereError
        del plan["rules"]["cut"]
        if value is not None:
            plan["rules"]["cut"] = value

    return spoil


def point_of_no_length(plan: Plan, rng: Rng) -> None:
    """Put a point of a piece twice, without filament, in the list and in its action."""
    row = _piece(plan, rng)
    actions, k = place_of(plan, row["id"])
    if any(edge[1] == k and edge[2] is not None for head in plan["heads"]
           for action in head["actions"] for edge in action["after"]):  # fmt: skip
        raise NotHereError  # a point of it is waited for: points have other numbers then
    p = int(rng.integers(1, len(row["points"])))
    for name in PER_SEGMENT:
        if name in row:
            row[name] = per_segment(row, name)
            row[name].insert(p - 1, 0.0 if name == "extrusion" else row[name][p - 1])
    for name in ("points", "along"):
        row[name].insert(p, row[name][p - 1])
    path = actions[k]["path"]
    at = len(path) - p if actions[k]["reversed"] else p
    path.insert(at, path[at - 1])


PIECE_MUTANTS: tuple[Mutant[Plan], ...] = (
    Mutant("a piece of the next contour", of_another),
    Mutant("two pieces of each other's contours", of_exchanged),
    Mutant("a piece of no contour", _field("of", lambda v: v + 10**6)),
    Mutant("two pieces at each other's places", places_exchanged),
    Mutant("two pieces of a contour in another order in the list", order_exchanged),
    Mutant("a place along its contour a little wrong", place_off),
    Mutant("all places a vertex further", places_off),
    Mutant("a point of a piece elsewhere", point_off),
    Mutant("a piece listed from its end", turned_in_the_list),
    Mutant("a point of a piece twice", point_of_no_length),
    Mutant("filament of a piece for its brother", filament_to_a_brother),
    Mutant("filament of a segment for the next one", filament_within),
    Mutant("a little less filament", _segment("extrusion", lambda e: e - 3 * GRID_E_MM)),
    Mutant("twice the filament", _segment("extrusion", lambda e: 2.0 * e)),
    Mutant("another feed of a segment", _segment("feed", lambda v: v + 1.0)),
    Mutant("another acceleration of a segment", _segment("acceleration", lambda v: v + 500.0)),
    Mutant("filament in a hop", _hop("extrusion", lambda e: e + 0.01)),
    Mutant("a hop faster than travels", _hop("feed", lambda v: 3.0 * v)),
    Mutant("another width of a piece", _field("width", lambda v: v + 0.01)),
    Mutant("another height of a piece", _field("height", lambda v: v - 0.01)),
    Mutant("another role of a piece", _field("role", lambda v: "support")),
    Mutant("another layer of a piece", _field("layer", lambda v: v + 1)),
    Mutant("another tool of a piece", _field("tool", lambda v: v + 1)),
    Mutant("another epoch of a piece", _field("epoch", lambda v: v + 1)),
    Mutant("another line of a piece", _field("line", lambda v: v + 1)),
    Mutant("a piece said to be a loop", _field("closed", lambda v: True)),
    Mutant("another height of the nozzle", _field("z", lambda v: round(v + 0.2, 3))),
    Mutant("pieces as contours of a print that is not cut", no_pieces),
    Mutant("each piece of a contour of its own", each_its_own),
    Mutant("a piece that does not say of what", _without("of")),
    Mutant("a piece that does not say where", _without("along")),
    Mutant("pieces where nothing may be cut", _rule("none")),
    Mutant("pieces, and no rule that allows cuts", _rule(None)),
    Mutant("pieces outside where only inside may be cut", _rule("inside")),
    Mutant("a rule of cuts nobody knows", _rule("outside")),
)
