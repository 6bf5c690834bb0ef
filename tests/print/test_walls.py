"""Which travels stay bare: inside the part only, against a slow oracle, and one rule for all."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
import shapely
from shapely.ops import substring

from decmcts.print.contours import Contours, Role
from decmcts.print.job import PrintJob, ProcessSettings
from decmcts.print.walls import (
    bare_pairs,
    has_walls,
    no_walls,
    outer_walls,
    retracted_paths,
    retracts,
    walls_for,
)
from decmcts.print.walls_kernels import END_MM, over_walls

U_SHAPE = [(0, 0), (30, 0), (30, 30), (20, 30), (20, 10), (10, 10), (10, 30), (0, 30)]
HABIT = ProcessSettings(retract_mm=1.0, retract_min_travel_mm=2.0, bare_inside_mm=100.0)


def loops(*rings: list[tuple[float, float]], z: float = 0.2, role: int = 1) -> Contours:
    """Return closed contours through these points, each ended 0.1 mm before its start."""
    lines = []
    for ring in rings:
        start, last = np.array(ring[0], float), np.array(ring[-1], float)
        stop = start + 0.1 * (last - start) / np.linalg.norm(last - start)
        flat = np.array([*ring, stop], float)
        lines.append(np.column_stack([flat, np.full(len(flat), z)]))
    sizes = [len(line) for line in lines]
    n, points = len(lines), np.concatenate(lines)
    return Contours(
        points, np.cumsum([0, *sizes]).astype(np.int64), np.ones(len(points)),
        np.full(len(points), 30.0), np.full(n, 0.45), np.full(n, 0.2), np.full(n, role, np.int8),
        np.ones(n, np.bool_), np.zeros(n, np.int32), np.zeros(n, np.int16), np.zeros(n, np.bool_),
        np.zeros(n, np.int32), np.zeros(n, np.int32),
    )  # fmt: skip


def concatenated(first: Contours, second: Contours) -> Contours:
    """Return the contours of both."""
    offsets = np.concatenate([first.offsets, second.offsets[1:] + first.offsets[-1]])
    values = {
        field.name: np.concatenate([getattr(first, field.name), getattr(second, field.name)])
        for field in fields(Contours)
        if getattr(first, field.name) is not None
    }
    return Contours(**{**values, "offsets": offsets})


def at(x: float, y: float, z: float = 0.2) -> np.ndarray:
    return np.array([[x, y, z]], float)


@pytest.mark.parametrize(
    ("start", "goal", "stays"),
    [
        (at(5, 25), at(5, 5), True),  # down one arm
        (at(5, 25), at(25, 25), False),  # over the gap
        (at(0, 30), at(30, 0), False),  # between corners, over the gap
        (at(10, 20), at(20, 20), False),  # both ends on the walls, the middle outside
        (at(0, 15), at(10, 15), True),  # both ends on the walls, the middle inside
        (at(5, 25), at(5, 5, 0.4), False),  # to another layer
        (at(5, 25, 0.4), at(5, 5, 0.4), False),  # on a layer without walls
        (at(-5, 5), at(-5, 25), False),  # outside
        (at(5, 5), at(5, 60), False),  # out of the part
    ],
)
def test_a_travel_is_bare_only_inside_the_part(start, goal, stays):
    """What leaves the part must be retracted, or it strings."""
    walls = outer_walls(loops(U_SHAPE))
    assert bare_pairs(walls, 100.0, start, goal).tolist() == [stays]
    assert bare_pairs(walls, 100.0, goal, start).tolist() == [stays]


@pytest.mark.parametrize(
    ("start", "goal", "stays"),
    [
        (at(5, 25), at(5, 5, 0.4), True),  # inside both layers
        (at(5, 5, 0.4), at(5, 25), False),  # down: what was printed since is in the way
        (at(15, 5), at(5, 5, 0.4), False),  # begins outside the upper layer
        (at(5, 5), at(15, 5, 0.4), False),  # ends there
        (at(5, 25), at(25, 25, 0.4), False),  # over the gap of the lower layer
        (at(5, 25), at(5, 5, 0.6), False),  # on a layer without walls
    ],
)
def test_a_change_of_layer_is_bare_only_inside_both(start, goal, stays):
    """The nozzle leaves one layer and comes to the other: it may string on either."""
    arm = [(0, 0), (10, 0), (10, 30), (0, 30)]
    contours = concatenated(loops(U_SHAPE), loops(arm, z=0.4))
    walls = outer_walls(contours)
    assert bare_pairs(walls, 100.0, start, goal, climb_mm=0.2).tolist() == [stays]
    assert bare_pairs(walls, 100.0, start, goal).tolist() == [False]
    assert bare_pairs(walls, 100.0, start, goal, climb_mm=0.19).tolist() == [False]
    settings = replace(HABIT, bare_climb_mm=0.2)
    corner = np.array([[*start[0, :2], goal[0, 2]]])
    up, lift = np.concatenate([start, corner, goal]), np.array([0.0, 0.0, 0.5])
    over = np.concatenate([start, corner + lift, goal + lift, goal])
    assert retracts(walls, settings, [tuple(p) for p in up.tolist()]) == (not stays)
    assert retracts(walls, settings, [tuple(p) for p in over.tolist()])


def test_no_longer_than_the_sources_longest():
    """Cura retracts beyond a length even inside the part."""
    walls = outer_walls(loops(U_SHAPE))
    assert bare_pairs(walls, 20.0, at(5, 25), at(5, 5)).tolist() == [True]
    assert bare_pairs(walls, 19.9, at(5, 25), at(5, 5)).tolist() == [False]


def test_a_hole_is_outside():
    """Even-odd: a wall within a wall bounds a hole."""
    ring = [(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)]
    hole = [(10.0, 10.0), (30.0, 10.0), (30.0, 30.0), (10.0, 30.0)]
    walls = outer_walls(loops(ring, hole))
    assert bare_pairs(walls, 100.0, at(2, 20), at(38, 20)).tolist() == [False]
    assert bare_pairs(walls, 100.0, at(15, 20), at(25, 20)).tolist() == [False]
    assert bare_pairs(walls, 100.0, at(2, 2), at(38, 2)).tolist() == [True]


def test_a_print_without_roles_has_no_walls():
    """Nothing tells inside from outside there, so length alone decides."""
    walls = outer_walls(loops(U_SHAPE, role=int(Role.UNKNOWN)))
    assert not has_walls(walls)
    assert bare_pairs(walls, 100.0, at(5, 25), at(5, 5)).tolist() == [False]


def star(rng: np.random.Generator, x: float, y: float) -> list[tuple[float, float]]:
    """Return a random star-shaped ring."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, 23))
    radius = rng.uniform(6.0, 20.0, 23)
    return [(x + r * np.cos(a), y + r * np.sin(a)) for a, r in zip(angle, radius, strict=True)]


@pytest.mark.parametrize("seed", range(4))
def test_against_shapely(seed):
    """Random travels among random rings, hole included: the same as cutting by geometry."""
    rng = np.random.default_rng(seed)
    rings = [star(rng, 20, 20), star(rng, 70, 30)]
    rings.append([(20 + 0.2 * (x - 20), 20 + 0.2 * (y - 20)) for x, y in rings[0]])
    solid = [shapely.Polygon(ring) for ring in rings]
    part = shapely.union_all([solid[0].difference(solid[2]), solid[1]])
    outlines = shapely.MultiLineString([shapely.LinearRing(ring) for ring in rings])
    walls = outer_walls(loops(*rings))
    start, goal = (np.column_stack([rng.uniform(0, 90, (400, 2)), np.full(400, 0.2)]) for _ in "ab")
    corners = np.array([p for ring in rings for p in ring])
    start[::3, :2] = rng.permutation(corners)[rng.integers(len(corners), size=134)]
    goal[::2, :2] = start[::2, :2] + rng.normal(0, 6.0, (200, 2))
    found = bare_pairs(walls, 200.0, start, goal)
    over = over_walls(walls, start, goal)
    for k, (a, b) in enumerate(zip(start[:, :2], goal[:, :2], strict=True)):
        line = shapely.LineString([a, b])
        trim = END_MM / line.length
        inner = substring(line, trim, 1 - trim, normalized=True)
        crossed = inner.intersects(outlines)
        assert over[k] == crossed
        assert found[k] == (not crossed and part.contains(line.interpolate(0.5, normalized=True)))
    assert 0.02 < found.mean() < 0.9


@pytest.mark.parametrize("inside", [0.0, 25.0])
def test_one_path_and_many_are_judged_alike(inside):
    """Times are made from the one, files from the other: they may never differ."""
    rng = np.random.default_rng(5)
    settings = replace(HABIT, bare_inside_mm=inside, bare_climb_mm=0.4)
    contours = concatenated(loops(U_SHAPE), loops(U_SHAPE, z=0.6))
    walls = walls_for(PrintJob("part", contours, settings))
    paths = []
    for _ in range(600):
        n = int(rng.integers(1, 5))
        path = np.column_stack([rng.uniform(0, 30, (n, 2)), np.full(n, 0.2)])
        path[1:, 2] += rng.choice([0.0, 0.0, 0.4], n - 1)
        if n == 3 and rng.random() < 0.5:  # up, then across
            path[1] = [*path[0, :2], path[2, 2]]
        paths.append(path if rng.random() < 0.8 else path * 0 + path[0])
    offsets = np.cumsum([0, *map(len, paths)]).astype(np.int64)
    many = retracted_paths(walls, settings, np.concatenate(paths), offsets)
    one = [retracts(walls, settings, [tuple(p) for p in path.tolist()]) for path in paths]
    plain = np.array([1 < len(path) < 4 for path in paths])
    assert (many[plain] == np.array(one)[plain]).all()
    assert many[plain].any()
    assert (~many[plain]).any()


def test_without_the_habit_nothing_is_looked_at():
    """A slicer that retracts every long travel has its reasons."""
    settings = replace(HABIT, bare_inside_mm=0.0)
    job = PrintJob("part", loops(U_SHAPE), settings)
    assert not has_walls(walls_for(job))
    assert retracts(no_walls(), settings, [(5.0, 25.0, 0.2), (5.0, 5.0, 0.2)])
