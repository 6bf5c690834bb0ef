"""What the heads of a machine have to do with one another: names, rails and parks.

No single value of a machine file shows these; `machine_dict` reads the values.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from decmcts.formats.files.fields import Fields, fail
from decmcts.formats.heads.head_name import as_file_systems_see
from decmcts.print.machine import Body, Machine, Rail

AXES = ("x", "y")

MOST_HEADS = 16
"""Each is a process, and finding who can be let in where takes the fourth power of them: 0.3 s of
processor time for 16 heads with 256 contours, 5 s for 32, 80 s for 64."""


def check_relations(machine: Machine, given: Fields) -> None:
    """Check what no single value shows: names, rail and parks."""
    if not machine.heads:
        given.fail("heads", "no head")
    if len(machine.heads) > MOST_HEADS:
        given.fail("heads", f"{len(machine.heads)} heads, at most {MOST_HEADS} are taken")
    if not all(a < b for a, b in zip(machine.bed_min, machine.bed_max, strict=True)):
        given.fail("bed", f"min {machine.bed_min} is not below max {machine.bed_max}")
    _check_names(machine, given)
    for i, rail in enumerate(machine.rails):
        _check_rail(machine, rail, given, "rail" if "rail" in given.values else f"rails[{i}]")
    _check_parks(machine, given)


def _check_names(machine: Machine, given: Fields) -> None:
    known: dict[str, str] = {}
    for i, head in enumerate(machine.heads):
        name, seen = head.name, as_file_systems_see(head.name)
        if known.get(seen) == name:
            given.fail(f"heads[{i}].name", f"two heads are named {name!r}")
        if seen in known:
            given.fail(
                f"heads[{i}].name",
                f"two heads are named {known[seen]!r} and {name!r}",
                "their files would be one on macOS and Windows",
            )
        known[seen] = name


def _check_rail(machine: Machine, rail: Rail, given: Fields, where: str) -> None:
    parks = {head.name: head.park[rail.axis] for head in machine.heads}
    for name in rail.order:
        if name not in parks:
            given.fail(f"{where}.order", f"no head is named {name!r}", f"heads: {', '.join(parks)}")
    for before, after in pairwise(rail.order):
        gap = parks[after] - parks[before]
        if gap < rail.separation_mm:
            given.fail(
                where,
                f"parked heads {before!r} and {after!r} are {gap:g} mm apart along"
                f" {AXES[rail.axis]}, separation_mm is {rail.separation_mm:g}",
                "move the parks apart",
            )


def _check_parks(machine: Machine, given: Fields) -> None:
    for i, one in enumerate(machine.heads):
        for two in machine.heads[:i]:
            gap = min(
                (_gap(a, one.park, b, two.park) for a in one.bodies for b in two.bodies),
                default=np.inf,
            )
            if gap < machine.head_clearance_mm:
                fail(
                    given.at(f"heads[{i}].park"),
                    f"parked heads {two.name!r} and {one.name!r} have bodies {gap:g} mm apart,"
                    f" head_clearance_mm is {machine.head_clearance_mm:g}",
                    given.path,
                    "move the parks apart",
                )


def _gap(a: Body, at: tuple[float, float, float], b: Body, bt: tuple[float, float, float]) -> float:
    """Return the distance of two boxes that moved with their nozzles, in mm."""
    low_a, high_a = np.add(a.minimum, at), np.add(a.maximum, at)
    low_b, high_b = np.add(b.minimum, bt), np.add(b.maximum, bt)
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(low_a - high_b, low_b - high_a))))
