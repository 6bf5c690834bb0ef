"""How near heads come, against a dense look at all times and FCL."""

from __future__ import annotations

import numpy as np
import pytest

from decmcts.print.machine import Body, Head, Slice
from sim.controllers.nearness import gap_between, shape_of
from sim.controllers.program import StopKind
from sim.controllers.simulate import simulate
from sim.controllers.timing import Timing
from sim.replay.shapes import Solid, parts_of
from tests.sim.controllers.programs import pair, program


def test_heads_that_pass_each_other_are_seen_however_fast():
    """Two cubes driven head-on through each other: a sampler with few samples would miss it."""
    left = program([[0, 0, 0], [200, 0, 0]], feed=200.0)
    right = program([[200, 15, 0], [0, 15, 0]], feed=200.0, name="right")
    found = simulate([left, right], pair())
    (contact,) = found.trials[0].contacts
    assert contact.what == "bodies"
    assert not found.safe
    assert contact.gap_mm == pytest.approx(0.0, abs=1e-9)
    assert found.trials[0].near[0].gap_mm == 0.0


def test_the_least_distance_is_that_of_the_nearest_moment():
    """They pass 25 mm apart from middle to middle: 5 mm between cubes of 20 mm."""
    left = program([[0, 0, 0], [200, 0, 0]])
    right = program([[200, 25, 0], [0, 25, 0]], name="right")
    near = simulate([left, right], pair()).trials[0].near[0]
    assert near.gap_mm == pytest.approx(5.0, abs=0.02)
    assert near.contacts == ()


def test_a_rail_is_broken_before_bodies_touch():
    left = program([[0, 0, 0], [100, 0, 0]])
    right = program([[200, 0, 0], [160, 0, 0]], name="right")
    found = simulate([left, right], pair(separation=70.0))
    assert found.trials[0].near[0].rail_mm == pytest.approx(-10.0, abs=0.05)
    assert [contact.what for contact in found.trials[0].contacts] == ["rail"]


@pytest.mark.parametrize("seed", range(30))
def test_distances_of_shapes_are_those_of_fcl(seed):
    """Polygons and heights, by logic of its own, against the library."""
    rng = np.random.default_rng(seed)

    def head(name: str) -> Head:
        if seed % 3 == 0 and name == "a":  # a rectangle along the axes is its own box
            x, y = rng.uniform(2, 8, 2)
            polygon = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
            return Head(name, (Slice(1.0, (polygon,)), Slice(3.0, (polygon * 1.5,))), ())
        angles = np.sort(rng.uniform(0, 2 * np.pi, 5))
        while np.diff(angles, append=angles[0] + 2 * np.pi).max() > 3.0:
            angles = np.sort(rng.uniform(0, 2 * np.pi, 5))
        polygon = 8 * np.column_stack([np.cos(angles), np.sin(angles)])
        low, size = rng.uniform(-5, 5, 3), rng.uniform(2, 9, 3)
        body = Body("box", tuple(low.tolist()), tuple((low + size).tolist()))
        return Head(name, (Slice(float(rng.uniform(0, 4)), (polygon,)),), (body,))

    a, b = head("a"), head("b")
    p, q = rng.uniform(-12, 12, 3), rng.uniform(-12, 12, 3)
    due = min(
        Solid(one.vertices() + p).distance(Solid(two.vertices() + q))
        for one in parts_of(a) for two in parts_of(b)
    )  # fmt: skip
    assert gap_between(shape_of(a), shape_of(b), p, q) == pytest.approx(due, abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_the_least_distance_is_no_more_than_a_dense_look_finds(seed):
    rng = np.random.default_rng(seed)
    ways = [rng.uniform(0, 60, (15, 3)) * [1, 1, 0.1] + [x, 0, 0] for x in (0.0, 90.0)]
    programs = [program(way, name=name) for way, name in zip(ways, ("left", "right"), strict=True)]
    machine = pair()
    found = simulate(programs, machine)
    times = np.linspace(0.0, found.makespan_s, 4000)
    a, b = found.positions(times)
    shapes = [shape_of(head) for head in machine.heads]
    dense = min(gap_between(*shapes, p, q) for p, q in zip(a, b, strict=True))
    assert found.trials[0].near[0].gap_mm <= dense + 0.02


def test_an_adversary_finds_the_delay_that_makes_heads_meet():
    """Without a wait they pass at different times: only a late head meets the other."""
    left = program([[0, 0, 0], [200, 0, 0], [0, 0, 0]], rest=(1,),
                   stops=[(1, StopKind.REST, -1, 0.0)])  # fmt: skip
    right = program([[250, 0, 0], [250, 0, 0], [50, 0, 0]], name="right",
                    stops=[(0, StopKind.DWELL, -1, 8.0), (1, StopKind.REST, -1, 0.0)])  # fmt: skip
    kept = simulate([left, right], pair())
    assert kept.safe
    met = simulate([left, right], pair(), timing=Timing.ADVERSARIAL)
    assert not met.safe
    ordered = program(right.points, name="right", stops=[(0, StopKind.WAIT, 0, 0.0)])
    gives = program(left.points, rest=(1,), stops=[(2, StopKind.PASS, 0, 0.0)])
    assert simulate([gives, ordered], pair(), timing=Timing.ADVERSARIAL).safe


def test_an_adversary_brings_the_nearest_points_of_long_legs_together():
    """Each head is near the other for one point of a leg; that their legs overlap is no contact."""
    way = [[float(x), float(y), 0.0] for y in range(40) for x in (0, 20)]
    deep = [[30.0, 40.0, 0.0]] + [[float(x), float(y), 0.0] for y in range(40) for x in (0, 20)]
    left = program([*way, *deep])
    right = program([[99.5, 0.0, 0.0]] + [[x + 100.0, y, 0.0] for x, y, _ in way], name="right")
    kept = simulate([left, right], pair(separation=70.0))
    assert kept.safe
    met = simulate([left, right], pair(separation=70.0), timing=Timing.ADVERSARIAL)
    contacts = [contact for trial in met.trials for contact in trial.contacts]
    assert -0.5 <= min(contact.gap_mm for contact in contacts) < -0.3
