"""The presets of several heads: who parks, reaches and passes where."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from decmcts.formats.machines.machine_file import SIZES, load_machine, rail_machine
from decmcts.print.machine import Body, Head, Machine


def meets(machine: Machine, one: tuple[float, float], two: tuple[float, float]) -> bool:
    """Whether two heads at these places come nearer than the machine allows."""
    a, b = machine.heads
    pairs = [(p, q) for p in a.bodies for q in b.bodies]
    return any(gap(p, one, q, two) < machine.head_clearance_mm for p, q in pairs)


def gap(p: Body, at: tuple[float, float], q: Body, bt: tuple[float, float]) -> float:
    low_p, high_p = np.add(p.minimum, (*at, 0.0)), np.add(p.maximum, (*at, 0.0))
    low_q, high_q = np.add(q.minimum, (*bt, 0.0)), np.add(q.maximum, (*bt, 0.0))
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(low_p - high_q, low_q - high_p))))


@pytest.mark.parametrize("heads", SIZES)
def test_heads_of_a_rail_park_in_order_on_both_sides(heads):
    """All are parked at once: half of them left of the bed, half right, the rail kept."""
    machine = load_machine(f"rail-{heads}")
    (rail,) = machine.rails
    assert machine.release == "point"
    parks = np.array([head.park[0] for head in machine.heads])
    assert rail.order == tuple(head.name for head in machine.heads)
    assert (np.diff(parks) >= rail.separation_mm).all()
    left = int((parks < machine.bed_min[0] - 40).sum())
    right = int((parks > machine.bed_max[0] + 40).sum())
    assert left + right == heads and left - right in (0, 1)


@pytest.mark.parametrize("heads", SIZES)
def test_heads_of_a_rail_reach_what_the_others_leave_them(heads):
    """With a head at either end of its reach the others find places between it and their parks."""
    machine = load_machine(f"rail-{heads}")
    (rail,) = machine.rails
    step = rail.separation_mm
    parks = [head.park[0] for head in machine.heads]
    for k, head in enumerate(machine.heads):
        left = sum(park < 0.0 for park in parks)
        beyond = range(max(k + 1, left), heads)  # whose parks stand in the way
        for j in beyond:
            assert head.reach_max[0] + step * (j - k) <= parks[j]
        for j in range(min(k, left)):
            assert head.reach_min[0] - step * (k - j) >= parks[j]
        assert 0.0 <= head.reach_min[0] < head.reach_max[0] <= machine.bed_max[0]


def test_every_place_of_the_longest_bed_is_reached():
    """A plate of 1200 mm has work at both ends."""
    machine = load_machine("rail-8")
    assert machine.bed_max[0] == 1200.0
    assert min(head.reach_min[0] for head in machine.heads) == 0.0
    assert max(head.reach_max[0] for head in machine.heads) == 1200.0


def test_two_heads_of_the_family_are_the_dual_gantry():
    """The family continues the machine it is made of."""
    pair = load_machine("dual-gantry")
    again = rail_machine(pair, 2)

    def shape(head: Head) -> tuple[object, ...]:
        return head.park, head.reach_min, head.reach_max, head.bodies

    assert [shape(head) for head in again.heads] == [shape(head) for head in pair.heads]
    assert (again.bed_max, again.rails[0].separation_mm) == (pair.bed_max, 70.0)


def test_heads_of_dueling_zero_pass_one_another_but_beams_do_not():
    """Side by side along Y both reach all of X; one behind the other they stay in order."""
    machine = load_machine("dueling-zero")
    (x0, y0), (x1, y1) = machine.bed_min, machine.bed_max
    assert not machine.rails
    for corner in (x0, x1):  # the end zones, where its own software sends one past the other
        assert not meets(machine, (corner, y0), (corner, y1))
    assert not meets(machine, (x0 + 30, y0), (x1 - 30, y0))
    assert meets(machine, (60.0, y0), (100.0, y0))  # heads of 40 mm
    assert not meets(machine, (60.0, y0), (100.6, y0))
    assert not meets(machine, (80.0, 20.0), (80.0, 73.6))  # heads of 53 mm
    assert meets(machine, (80.0, 20.0), (80.0, 73.0))
    for past in range(6, 104):  # each head at the other's beam, then beam at beam
        assert meets(machine, (60.0 + past, y0), (60.0, y1))


def test_no_head_of_dueling_zero_passes_above_the_other():
    """The real bed moves along Z under both: lifting one head is no way round the other."""
    machine = load_machine("dueling-zero")
    (left, right), z = machine.heads, machine.heads[0].reach_max[2]
    for a, b in ((left, right), (right, left)):
        for body in a.bodies[1:]:
            assert all(body.maximum[2] > z + other.minimum[2] for other in b.bodies)


def test_parked_heads_of_one_machine_are_apart():
    """The relation the files are refused for, on the presets themselves."""
    for name in ("dueling-zero", "rail-3", "rail-8"):
        machine = load_machine(name)
        for a, b in combinations(machine.heads, 2):
            parks = (a.park[0], a.park[1]), (b.park[0], b.park[1])
            gaps = [gap(p, parks[0], q, parks[1]) for p in a.bodies for q in b.bodies]
            assert min(gaps) >= machine.head_clearance_mm
