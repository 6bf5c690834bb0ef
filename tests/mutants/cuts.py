"""Mutants of cut prints: pieces printed twice, never, the other way round, cut where none may be.

What is said of a piece is spoilt in `pieces`, the files of heads in
`piece_lines`. `benchmarks/cut_plans.py` makes thousands of all three.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.mutants.actions import (
    across_a_barrier,
    jump,
    process_order_swapped,
    reversed_unsaid,
    shift_path,
    upper_layer_first,
)
from tests.mutants.catalogue import Mutant, NotHereError, pick
from tests.mutants.cut_rows import (
    Plan,
    Row,
    add_actions,
    add_row,
    brothers,
    drop_row,
    follow,
    later,
    lifted,
    place_of,
    segments,
    split,
    travel_only,
)

Rng = np.random.Generator
NEVER = ("overhang_perimeter", "bridge_infill", "ironing", "skirt_brim", "gap_fill")
OUTSIDE = ("external_perimeter", "top_solid_infill")
INSIDE = ("perimeter", "infill", "solid_infill", "support", "support_interface")
AGAIN_S = 60.0  # enough for any piece to be printed once more


def some_piece(plan: Plan, rng: Rng) -> int:
    """Return a piece of a contour that has several."""
    return pick([p for pieces in brothers(plan).values() for p in pieces], rng)


def twice(plan: Plan, rng: Rng) -> None:
    """List a piece twice, and print it twice."""
    piece = some_piece(plan, rng)
    _print_again(plan, piece)


def stretch_twice(plan: Plan, rng: Rng) -> None:
    """Print the first segment of a piece again, as a piece of its own."""
    piece = some_piece(plan, rng)
    _print_again(plan, piece, last=1)


def _print_again(plan: Plan, piece: int, last: int | None = None) -> None:
    actions, k = place_of(plan, piece)
    row = plan["contours"][piece]
    again = segments(row, 0, len(row["points"]) - 1 if last is None else last)
    add_row(plan, again, piece + 1)
    z = actions[k]["path"][0][2]
    path, end = [[*point[:2], z] for point in again["points"]], actions[k]["path"][-1]
    travel: Row = {"kind": "travel", "contour": None, "reversed": False, "entry": 0}
    travel["takes_s"] = AGAIN_S
    printed = {"kind": "print", "contour": piece + 1, "path": path, "takes_s": AGAIN_S}
    back = {**travel, "path": lifted(path[-1], end)}
    more = [{**travel, "path": lifted(end, path[0])}, {**travel, **printed}, back]
    add_actions(plan, actions, k + 1, more)


def never(plan: Plan, rng: Rng) -> None:
    """Run along a piece without printing it; it stays in the list."""
    travel_only(plan, some_piece(plan, rng))


def gone(plan: Plan, rng: Rng) -> None:
    """Leave a piece out of list and actions alike."""
    piece = some_piece(plan, rng)
    travel_only(plan, piece)
    drop_row(plan, piece)


def contour_gone(plan: Plan, rng: Rng) -> None:
    """Leave out all pieces of one contour."""
    of = pick(list(brothers(plan)), rng)
    for piece in sorted(brothers(plan)[of], reverse=True):
        travel_only(plan, piece)
        drop_row(plan, piece)


def _one_way(plan: Plan) -> list[int]:
    """Return the pieces of contours that may not be reversed."""
    rows = plan["contours"]
    return [p for ps in brothers(plan).values() for p in ps if not rows[p]["reversible"]]


def against_its_contour(plan: Plan, rng: Rng) -> None:
    """Reverse a piece whose contour may not be."""
    follow(plan, pick(_one_way(plan), rng), reverse=True)


def against_its_contour_denied(plan: Plan, rng: Rng) -> None:
    """Reverse a piece whose contour may not be, and say that it may."""
    piece = pick(_one_way(plan), rng)
    plan["contours"][piece]["reversible"] = True
    follow(plan, piece, reverse=True)


def elsewhere(far_mm: float) -> Callable[[Plan, Rng], None]:
    """Return a mutant that moves the end of a piece along its segment, filament and all.

    By less than nothing the piece leaves a gap, by more it lies over its brother.
    """

    def spoil(plan: Plan, rng: Rng) -> None:
        piece = some_piece(plan, rng)
        row = plan["contours"][piece]
        (x0, y0), (x, y) = row["points"][-2][:2], row["points"][-1][:2]
        length = float(np.hypot(x - x0, y - y0))
        by = far_mm * float(rng.uniform(0.5, 2.0))
        share = 1.0 + by / length if length > 1e-6 else 0.0
        if not 0.1 < share < 2.0 or row["extrusion"][-1] == 0.0:
            raise NotHereError
        row["points"][-1] = [round(x0 + share * (x - x0), 3), round(y0 + share * (y - y0), 3)]
        begin, end = row["along"][-2:]
        row["along"][-1] = begin + share * (end - begin)
        row["extrusion"][-1] = round(share * row["extrusion"][-1], 5)
        follow(plan, piece)

    return spoil


def _splits(roles: tuple[str, ...]) -> Callable[[Plan, Rng], None]:
    """Return a mutant that cuts a contour of one of the roles, parted exactly."""

    def spoil(plan: Plan, rng: Rng) -> None:
        rows = [r for r in plan["contours"] if r["role"] in roles and len(r["points"]) > 2]
        row = rows[pick(list(range(len(rows))), rng)]
        split(plan, row["id"], int(rng.integers(1, len(row["points"]) - 1)))

    return spoil


def outside_though_inside(plan: Plan, rng: Rng) -> None:
    """Cut an outer wall where only what lies inside may be cut."""
    if plan["rules"]["cut"] != "inside":
        raise NotHereError
    _splits(OUTSIDE)(plan, rng)


def one_more_cut(plan: Plan, rng: Rng) -> None:
    """Cut once more where that is allowed, at a corner; the head prints both one by one."""
    rows = [r["id"] for r in plan["contours"] if r["role"] in INSIDE and len(r["points"]) > 2]
    along = {p: plan["contours"][p]["along"] for p in rows}
    corners = [
        (p, k) for p in rows for k in range(1, len(along[p]) - 1)
        if along[p][k] == int(along[p][k]) and plan["contours"][p]["extrusion"][k] > 0.0
        and plan["contours"][p]["extrusion"][k - 1] > 0.0
    ]  # fmt: skip
    split(plan, *corners[pick(list(range(len(corners))), rng)])


def long_hop(plan: Plan, rng: Rng) -> None:
    """Make one piece of two that lie far apart."""
    actions = max((h["actions"] for h in plan["heads"]), key=len)
    rows, printed = plan["contours"], [a for a in actions if a["kind"] == "print"]
    pairs = [
        (a["contour"], b["contour"])
        for group in [[a for a in printed if not a["reversed"]]]
        for a in group
        for b in group
        if rows[a["contour"]]["of"] == rows[b["contour"]]["of"]
        and rows[a["contour"]]["along"][-1] < rows[b["contour"]]["along"][0]
        and np.hypot(*np.subtract(rows[a["contour"]]["points"][-1][:2],
                                  rows[b["contour"]]["points"][0][:2])) > 8.0
    ]  # fmt: skip
    one, other = pairs[pick(list(range(len(pairs))), rng)]
    travel_only(plan, other)
    rows[one] = _joined(rows[one], rows[other])
    drop_row(plan, other)
    follow(plan, one - (other < one))


def _joined(a: Row, b: Row) -> Row:
    """Return the row of two pieces as one, with a hop between them."""
    joined = {**a, "points": a["points"] + b["points"], "along": a["along"] + b["along"]}
    for name, hop in (("extrusion", 0.0), ("feed", 150.0), ("acceleration", 0.0)):
        if name in a:
            one, two = (
                r[name] if isinstance(r[name], list) else [r[name]] * (len(r["points"]) - 1)
                for r in (a, b)
            )
            joined[name] = [*one, hop or two[0] * (name != "extrusion"), *two]
    return joined


def to_a_head_that_cannot(plan: Plan, rng: Rng) -> None:
    """Give a piece to a head that does not reach it, once all else is printed."""
    reach = {h["name"]: (h["reach"]["min"], h["reach"]["max"]) for h in plan["machine"]["heads"]}
    far = [
        (p, head) for ps in brothers(plan).values() for p in ps for head in plan["heads"]
        if any(not reach[head["name"]][0][0] <= point[0] <= reach[head["name"]][1][0]
               for point in plan["contours"][p]["points"])
    ]  # fmt: skip
    piece, head = far[pick(list(range(len(far))), rng)]
    actions, k = place_of(plan, piece)
    printed, mine = dict(actions[k]), head["actions"]
    travel_only(plan, piece)
    at = len(mine) - 1  # before it parks
    stands = mine[at - 1]["path"][-1]
    travel = {"kind": "travel", "contour": None, "reversed": False, "entry": 0, "takes_s": AGAIN_S}
    there, back = lifted(stands, printed["path"][0]), lifted(printed["path"][-1], stands)
    add_actions(
        plan, mine, at,
        [{**travel, "path": there}, printed | {"takes_s": AGAIN_S}, {**travel, "path": back}],
    )  # fmt: skip


def weld_too_late(plan: Plan, rng: Rng) -> None:
    """Let hours pass between two pieces that touch, longer than the plan's rules allow."""
    rows = plan["contours"]
    pairs = [
        (a, b) for ps in brothers(plan).values() for a in ps for b in ps
        if rows[a]["along"][-1] == rows[b]["along"][0]
    ]  # fmt: skip
    times = []
    for pair in pairs:
        first, second = sorted(
            actions[k]["begin_s"] for actions, k in (place_of(plan, piece) for piece in pair)
        )
        times += [second] if second > first else []
    at_s = times[pick(list(range(len(times))), rng)]
    later(plan, at_s + 1e-9, 2e4)
    for head in plan["heads"]:
        for action in head["actions"]:
            if action["begin_s"] == at_s:
                action["begin_s"] += 2e4


CUT_MUTANTS: tuple[Mutant[Plan], ...] = (
    Mutant("a piece twice", twice),
    Mutant("a segment of a piece twice", stretch_twice),
    Mutant("a piece that is not printed", never),
    Mutant("a piece left out everywhere", gone),
    Mutant("all pieces of a contour left out", contour_gone),
    Mutant("a piece reversed against its contour", against_its_contour),
    Mutant("a piece reversed against its contour, said to be allowed", against_its_contour_denied),
    Mutant("a piece that ends too soon", elsewhere(-0.1)),
    Mutant("a piece that ends a little too soon", elsewhere(-0.01)),
    Mutant("a piece that lies over its brother", elsewhere(0.1)),
    Mutant("a piece that lies over its brother a little", elsewhere(0.01)),
    *(Mutant(f"a cut in {role}", _splits((role,))) for role in NEVER),
    Mutant("a cut outside where only inside may be cut", outside_though_inside),
    Mutant("two pieces as one with a long hop", long_hop),
    Mutant("a piece for a head that does not reach it", to_a_head_that_cannot),
    Mutant("a weld too late", weld_too_late),
    Mutant("a piece of infill before its wall", process_order_swapped),
    Mutant("a piece before the one under it", upper_layer_first),
    Mutant("a piece across a change of temperature", across_a_barrier),
    Mutant("a path beside its piece", shift_path),
    Mutant("an open piece backwards unsaid", reversed_unsaid),
    Mutant("a jump", jump),
    Mutant(
        "one more cut at a corner, inside",
        one_more_cut,
        harmless="it parts its contour exactly, where that is allowed, and both are printed",
    ),
)
