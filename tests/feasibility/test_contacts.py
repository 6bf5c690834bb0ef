"""Contacts of the source: found, limited in depth, and turned into edges."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.contacts import CollisionError, Contacts, find_contacts
from decmcts.feasibility.graph import EdgeKind
from decmcts.feasibility.packed_head import pack_contours

WALL = [(0.0, 0.0, 0.2), (10.0, 0.0, 0.2)]


def ramp(y: float, low: float) -> list[tuple[float, float, float]]:
    return [(0.0, y, low), (5.0, y, 0.2), (10.0, y, 0.2)]


def contacts(oracle: Any, polylines: Any, head: str = "box", **options: Any) -> Contacts:
    contours = oracle.make_contours(polylines, **options)
    return find_contacts(contours, pack_contours(contours, 0.0), [oracle.heads[head]])


def test_a_ramp_beside_a_wall_keeps_its_place_behind_it(oracle: Any) -> None:
    """The nozzle goes into the wall; turned round, the wall's side would be another's."""
    contours = oracle.make_contours([WALL, ramp(0.45, 0.1)])
    found = contacts(oracle, [WALL, ramp(0.45, 0.1)])
    assert found.pairs.tolist() == [[0, 1]]
    assert found.depth == pytest.approx([0.1])
    assert found.as_sliced.tolist() == [0, 1]
    graph = build_graph(contours, [oracle.heads["box"]], clearance_mm=0.0)
    assert graph.pairs().tolist() == [[0, 1]]
    assert graph.kinds.tolist() == [EdgeKind.CONTACT]


def test_a_ramp_that_only_the_head_comes_near_may_be_printed_first(oracle: Any) -> None:
    """In the other order there is no contact at all."""
    found = contacts(oracle, [WALL, ramp(5.0, 0.1)])
    assert found.pairs.tolist() == [[0, 1]]
    assert not len(found.ordered)
    assert found.as_sliced.tolist() == [1]
    contours = oracle.make_contours([WALL, ramp(5.0, 0.1)])
    assert build_graph(contours, [oracle.heads["box"]], clearance_mm=0.0).n_edges == 0


def test_the_tip_goes_into_a_bead_of_another_layer_and_not_through_it(oracle: Any) -> None:
    """Below the bead's underside is what one printed part is to the next: a collision."""
    deep = [(0.0, 0.45, 0.0), (10.0, 0.45, 0.2)]
    assert contacts(oracle, [WALL, deep], layer=[0, 1]).depth == pytest.approx([0.2])
    high = [(0.0, 0.0, 0.3), (10.0, 0.0, 0.3)]
    with pytest.raises(CollisionError, match=r"contour 0 .* before contour 1 "):
        contacts(oracle, [high, deep], layer=[0, 1])


def test_on_one_layer_the_nozzle_may_pass_beside_higher_beads(oracle: Any) -> None:
    """A layer that waves is higher elsewhere than its beads are; it ends where heads get wider."""
    for top, fits in ((1.5, True), (4.9, True), (5.2, False)):
        waves = [[(0.0, 0.0, top), (10.0, 0.0, top)], [(0.0, 0.4, 0.1), (10.0, 0.4, 0.1)]]
        if fits:
            assert contacts(oracle, waves).depth == pytest.approx([top - 0.1])
        else:
            with pytest.raises(CollisionError):
                contacts(oracle, waves)


def test_flat_layers_have_no_contacts(oracle: Any) -> None:
    """What is printed at one height or higher never stands in the way."""
    layers = [[(0.0, y, 0.2 * z), (9.0, y, 0.2 * z)] for z in range(1, 5) for y in (0.0, 0.4)]
    assert not len(contacts(oracle, layers))


def test_many_contacts_are_all_found(oracle: Any) -> None:
    """The list of pairs grows; brute force over pairs has as many."""
    rng = np.random.default_rng(1)
    low = 0.1 + 0.1 * rng.random((40, 2))
    lines = [[(0.0, 0.4 * k, a), (9.0, 0.4 * k, b)] for k, (a, b) in enumerate(low.tolist())]
    found = contacts(oracle, lines)
    box = 7.0 + 0.2  # half the head and half a bead
    due = [
        [a, b] for b in range(40) for a in range(b)
        if 0.4 * (b - a) <= box and low[a].max() > low[b].min() + 1e-6
    ]  # fmt: skip
    assert sorted(map(list, found.pairs.tolist())) == sorted(due)
    assert found.depth == pytest.approx(
        [low[a].max() - low[b].min() for a, b in found.pairs.tolist()]
    )
