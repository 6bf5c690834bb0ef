"""The dependency graph against its definition."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from decmcts.errors import InputError
from decmcts.feasibility.build import _build, build_graph, closure_of, touching_kinds
from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.feasibility.packed_head import pack_contours
from decmcts.formats.gcode import read_gcode
from decmcts.formats.machines.machine_file import load_machine
from decmcts.print.contours import Contours
from decmcts.print.machine import Head, Slice
from tests.makers.corpus import CORPUS


def as_matrix(graph: DependencyGraph) -> NDArray[np.bool_]:
    bits = np.unpackbits(closure_of(graph).view(np.uint8), axis=1, bitorder="little")
    return np.asarray(bits[:, : graph.n], np.bool_)


@pytest.mark.slow
@pytest.mark.parametrize("head", ["box", "lopsided", "hollow"])
@pytest.mark.parametrize("seed", range(2))
def test_closure_equals_the_definition(oracle: Any, head: str, seed: int) -> None:
    """A missing edge is a crash, a superfluous one is lost travel: the closure is exact."""
    slope = 0.1 if head == "hollow" else 0.0
    contours, heads = oracle.random_print(seed, slope=slope), [oracle.heads[head]]
    blocked = oracle.blocked(contours, heads, 0.3)
    for keep, quality in product((True, False), repeat=2):
        graph = build_graph(
            contours, heads, clearance_mm=0.3, process_order="keep" if keep else "free",
            quality=quality,
        )  # fmt: skip
        expected = oracle.slow_closure(contours, blocked, keep=keep, quality=quality)
        np.testing.assert_array_equal(as_matrix(graph), expected)


@pytest.mark.slow
@pytest.mark.parametrize("head", ["box", "lopsided", "hollow"])
def test_long_segments_equal_the_definition(oracle: Any, head: str) -> None:
    """Long moves past corners of the head, where only the exact convex test decides."""
    rng = np.random.default_rng(7)
    for _ in range(200):
        a, b = rng.uniform(-25.0, 25.0, (2, 2, 3))
        a[:, 2], b[:, 2] = 0.2, 0.2 + rng.uniform(0.1, 3.0)
        contours = oracle.make_contours([a.tolist(), b.tolist()])
        graph = build_graph(contours, [oracle.heads[head]], clearance_mm=0.8)
        assert graph.n_edges == oracle.hits(a, b, oracle.heads[head], 1.0)


@pytest.mark.parametrize(("x", "edges"), [(9.09, 1), (9.11, 0)])
def test_rounded_corner_of_the_grown_slice(oracle: Any, x: float, edges: int) -> None:
    """Clearance grows a slice by a disc: diagonally past a corner it is not a larger box."""
    # the corner is at (7, 7), the bead at (x, 9.1), radius 2.1 * sqrt(2) = 2.97
    contours = oracle.make_contours(
        [[(0, 0, 0.2), (0, 0, 0.2)], [(x, 9.1, 0.4), (x + 9, 9.1, 0.4)]], width=0.0
    )
    head = oracle.heads["box"]
    clearance_mm = 2.1 * 2**0.5
    assert build_graph(contours, [head], clearance_mm=clearance_mm).n_edges == edges


@pytest.mark.slow
def test_two_heads_give_the_union(oracle: Any) -> None:
    """Either head may print a contour, so what blocks one of them counts."""
    contours = oracle.random_print(5)
    heads = [oracle.heads["lopsided"], oracle.heads["box"]]
    graph = build_graph(contours, heads, clearance_mm=0.0)
    expected = oracle.slow_closure(contours, oracle.blocked(contours, heads, 0.0), keep=True)
    np.testing.assert_array_equal(as_matrix(graph), expected)


def towers(oracle: Any, gap: float, n_layers: int = 40) -> Contours:
    """Four square towers, `gap` mm between centres, 0.2 mm layers."""
    polylines, layers = [], []
    for layer in range(n_layers):
        for x, y in ((0.0, 0.0), (gap, 0.0), (0.0, gap), (gap, gap)):
            z = 0.2 * (layer + 1)
            square = [(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -2)]
            polylines.append([(x + u, y + v, z) for u, v in square])
            layers.append(layer)
    return oracle.make_contours(polylines, layer=layers)


@pytest.mark.slow
@pytest.mark.parametrize("head", ["box", "lopsided"])
@pytest.mark.parametrize("gap", [9.0, 11.2, 14.0, 30.0])
def test_towers_equal_the_definition(oracle: Any, head: str, gap: float) -> None:
    """Towers are where another order pays, so their edges must be right at every distance."""
    contours, heads = towers(oracle, gap, n_layers=8), [oracle.heads[head]]
    graph = build_graph(contours, heads, clearance_mm=0.0)
    expected = oracle.slow_closure(contours, oracle.blocked(contours, heads, 0.0), keep=True)
    np.testing.assert_array_equal(as_matrix(graph), expected)


def test_far_towers_are_chains(oracle: Any) -> None:
    """Stored edges are reduced: a tower of its own is one chain, not a clique."""
    graph = build_graph(towers(oracle, 60.0), [oracle.heads["box"]], clearance_mm=0.0)
    assert graph.n_edges == 4 * 39
    np.testing.assert_array_equal(graph.pairs()[:, 1] - graph.pairs()[:, 0], 4)


def test_no_stored_edge_follows_from_the_others(oracle: Any) -> None:
    """Planners scan cover relations; a superfluous edge costs them on every move."""
    graph = build_graph(oracle.random_print(1), [oracle.heads["lopsided"]], clearance_mm=0.0)
    closure = as_matrix(graph)
    for a, b in graph.pairs():
        assert not (closure[b] & closure[:, a]).any()


def test_edges_do_not_depend_on_the_memory_limit(oracle: Any) -> None:
    """Large prints are walked in column blocks; that must not change a single edge."""
    contours = oracle.random_print(3, n_layers=60, per_layer=12)
    head = [oracle.heads["lopsided"]]
    whole = build_graph(contours, head, clearance_mm=0.0)
    keep = touching_kinds(process_order="keep", quality=False)
    assert len(contours) > 256
    for limit in (1, 8 * len(contours) * 2, 8 * len(contours) * 3):
        blocked = _build(contours, head, pack_contours(contours, 0.0), keep, limit)
        np.testing.assert_array_equal(blocked.pairs(), whole.pairs())
        np.testing.assert_array_equal(blocked.kinds, whole.kinds)


def mirrored(contours: Contours) -> Contours:
    fields = {name: getattr(contours, name) for name in Contours.__slots__}
    return Contours(**{**fields, "points": contours.points * np.array([-1.0, 1.0, 1.0])})


def test_mirrored_head_and_print_give_the_same_graph(oracle: Any) -> None:
    """Nothing in the walk prefers a side."""
    head = oracle.heads["lopsided"]
    slices = tuple(
        Slice(s.height_mm, tuple((p * np.array([-1.0, 1.0]))[::-1] for p in s.polygons))
        for s in head.slices
    )
    contours = oracle.random_print(2)
    one = build_graph(contours, [head], clearance_mm=0.1)
    other = build_graph(mirrored(contours), [Head("m", slices)], clearance_mm=0.1)
    np.testing.assert_array_equal(one.pairs(), other.pairs())


@pytest.mark.parametrize(("x", "edges"), [(15.0, 1), (-15.0, 0), (25.3, 0), (25.1, 1)])
def test_side_of_a_lopsided_head(oracle: Any, x: float, edges: int) -> None:
    """A head that reaches to the right is blocked by material to the right of the nozzle."""
    contours = oracle.make_contours([[(0, 0, 0.2), (0, 1, 0.2)], [(x, 0, 0.4), (x, 1, 0.4)]])
    head = oracle.head_of((0.0, [oracle.box(5, -3, 25, 3)]))
    assert build_graph(contours, [head], clearance_mm=0.0).n_edges == edges


@pytest.mark.parametrize(("top", "edges"), [(5.2, 0), (5.2 + 2e-6, 1)])
def test_height_of_a_slice_is_exact(oracle: Any, top: float, edges: int) -> None:
    """Material exactly as high as the slice passes under it."""
    contours = oracle.make_contours([[(0, 0, 0.2), (1, 0, 0.2)], [(0, 0, top), (1, 0, top)]])
    head = oracle.head_of((5.0, [oracle.box(-3, -3, 3, 3)]))
    assert build_graph(contours, [head], clearance_mm=0.0).n_edges == edges


def test_touching_exactly_counts(oracle: Any) -> None:
    """Rounding must not let a head graze a bead."""
    contours = oracle.make_contours([[(0, 0, 0.2), (0, 1, 0.2)], [(7.3, 0, 0.4), (7.3, 1, 0.4)]])
    head = oracle.heads["box"]
    assert build_graph(contours, [head], clearance_mm=0.1).n_edges == 1
    assert build_graph(contours, [head], clearance_mm=0.0999).n_edges == 0


def test_long_infill_line_meets_the_middle_of_a_slice(oracle: Any) -> None:
    """A line that crosses the slice with both ends far outside still blocks it."""
    contours = oracle.make_contours(
        [[(0, 0, 0.2), (0.5, 0, 0.2)], [(-90, -91, 0.4), (90, 89, 0.4)]]
    )
    assert build_graph(contours, [oracle.heads["box"]], clearance_mm=0.0).n_edges == 1


def test_kinds(oracle: Any) -> None:
    """The reason of an edge is shown to people: state before geometry before process."""
    line = [(0, 0, 0.2), (5, 0, 0.2)]
    beside = [(0, 0.4, 0.2), (5, 0.4, 0.2)]
    above = [(0, 0, 0.4), (5, 0, 0.4)]
    far = [(90, 0, 0.4), (95, 0, 0.4)]
    contours = oracle.make_contours(
        [line, beside, above, far], role=[1, 4, 1, 1], layer=[0, 0, 1, 1], epoch=[0, 0, 0, 1]
    )
    graph = build_graph(contours, [oracle.heads["box"]], clearance_mm=0.0)
    assert graph.pairs().tolist() == [[0, 1], [1, 2], [2, 3]]
    assert graph.kinds.tolist() == [EdgeKind.PROCESS, EdgeKind.GEOMETRY, EdgeKind.STATE]
    free = build_graph(contours, [oracle.heads["box"]], clearance_mm=0.0, process_order="free")
    assert free.pairs().tolist() == [[0, 2], [1, 2], [2, 3]]


def test_source_that_collides_is_refused_by_name(oracle: Any) -> None:
    """Objects printed one by one too close together: say which, where and what to do."""
    tall = [(0, 0, 9.0), (1, 0, 9.0)]
    low = [(6, 0, 0.2), (6, 1, 0.2)]
    contours = oracle.make_contours([tall, low], layer=[44, 0], line=[120, 950])
    with pytest.raises(InputError) as caught:
        build_graph(contours, [oracle.heads["box"]], clearance_mm=0.0)
    text = str(caught.value)
    for part in ("contour 0", "layer 44", "line 120", "contour 1", "line 950", "0 mm above", "z 9"):
        assert part in text
    assert "choose another machine" in text
    assert (
        build_graph(
            contours, [oracle.head_of((9.0, [oracle.box(-7, -7, 7, 7)]))], clearance_mm=0.0
        ).n_edges
        == 0
    )


def test_collision_with_an_object_printed_long_before(oracle: Any) -> None:
    """The search for a violation must reach back over the whole source."""
    tower = [[(0, 0, 0.2 * i), (1, 0, 0.2 * i)] for i in range(1, 200)]
    far = [[(90, 0, 0.2 * i), (91, 0, 0.2 * i)] for i in range(1, 200)]
    good = oracle.make_contours(tower + far)
    assert build_graph(good, [oracle.heads["box"]], clearance_mm=0.0).n_edges == 2 * 198
    layers = [*range(199), *range(199), 194]
    bad = oracle.make_contours([*tower, *far, [(6, 0, 39.0), (6, 1, 39.0)]], layer=layers)
    with pytest.raises(InputError, match=r"contour 198 .* before contour 398 "):
        build_graph(bad, [oracle.heads["box"]], clearance_mm=0.0)


def test_empty_and_single(oracle: Any) -> None:
    """The smallest prints are prints too."""
    assert build_graph(oracle.make_contours([]), [oracle.heads["box"]], clearance_mm=0.0).n == 0
    one = oracle.make_contours([[(0, 0, 0.2), (0, 0, 0.2)]])
    assert build_graph(one, [oracle.heads["box"]], clearance_mm=0.0).n_edges == 0


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.skipif(not CORPUS.is_dir(), reason=f"no corpus of real prints at {CORPUS}")
@pytest.mark.parametrize("machine", ["paper", "mk4s"])
def test_samples_of_a_real_print_equal_the_definition(oracle: Any, machine: str) -> None:
    """On a real print every stored edge is real and no sampled requirement is missing."""
    job, _ = read_gcode(CORPUS / "models" / "gcode" / "teaset_chess_7.gcode.gz")
    contours, head = job.contours, load_machine(machine).heads[0]
    graph = build_graph(contours, [head], clearance_mm=0.0)
    closure = as_matrix(graph)
    rng = np.random.default_rng(0)
    geometry = graph.pairs()[graph.kinds == EdgeKind.GEOMETRY]
    for a, b in rng.choice(geometry, 10):
        assert oracle.blocks(contours, b, a, head, 1e-9)
    free = np.argwhere(np.tril(~closure, -1))
    for b, a in rng.choice(free, 30):
        assert not oracle.blocks(contours, b, a, head, -1e-9)


def test_bead_width_counts_unless_the_machine_says_centreline(oracle: Any) -> None:
    """A bead whose rim, not its middle, lies under the head blocks it only where beads count."""
    contours = oracle.make_contours([[(0, 0, 0.2), (0, 1, 0.2)], [(7.1, 0, 0.4), (7.1, 1, 0.4)]])
    head = [oracle.heads["box"]]
    assert build_graph(contours, head, clearance_mm=0.0).n_edges == 1
    assert build_graph(contours, head, clearance_mm=0.0, bead_width=False).n_edges == 0
