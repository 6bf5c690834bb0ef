"""What primes the nozzle stays first, against the definition pair by pair."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decmcts.feasibility.build import build_graph, closure_of
from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.feasibility.rules import prime_first
from decmcts.print.contours import Contours, Role
from decmcts.print.job import PrintJob

S, P, F, U, W, C = (
    Role.SKIRT_BRIM, Role.PERIMETER, Role.INFILL, Role.UNKNOWN, Role.WIPE_TOWER, Role.CUSTOM,
)  # fmt: skip
NOTHING = np.empty((0, 2), np.int32)


def job_of(oracle: Any, roles: list[int], *, epoch=None, tool=None, refills=(), layer=None):
    """Short lines far apart, one a role."""
    lines = [[(10.0 * k, 0.0, 0.2), (10.0 * k + 5.0, 0.0, 0.2)] for k in range(len(roles))]
    contours = oracle.make_contours(lines, role=roles, epoch=epoch, layer=layer)
    if tool is not None:
        contours = replace(contours, tool=np.array(tool, np.int16))
    return PrintJob("lines", contours, refills=refills)


def pairs_of(job: PrintJob, given: np.ndarray = NOTHING) -> list[list[int]]:
    graph = DependencyGraph.from_pairs(len(job.contours), given)
    return sorted(prime_first(graph, job).pairs().tolist())


def before(graph: DependencyGraph) -> np.ndarray:
    bits = np.unpackbits(closure_of(graph).view(np.uint8), axis=1, bitorder="little")
    return bits[:, : graph.n].astype(bool)


def test_skirt_and_brim_come_first_and_in_order(oracle: Any) -> None:
    """A skirt printed as the fortieth contour primes nothing."""
    assert pairs_of(job_of(oracle, [S, S, P, F, S, P])) == [[0, 1], [1, 2], [1, 3], [1, 4], [1, 5]]


def test_a_print_without_a_skirt_is_as_free_as_before(oracle: Any) -> None:
    """Where the start code primes, the first perimeter is as good as any."""
    assert pairs_of(job_of(oracle, [P, F, S, P])) == []


def test_every_epoch_and_every_tool_begins_with_what_the_source_begins_it_with(oracle: Any) -> None:
    """After a temperature change a draft shield primes again; each tool has its own skirt."""
    job = job_of(oracle, [S, P, P, S, P, P], epoch=[0, 0, 0, 1, 1, 1])
    assert pairs_of(job) == [[0, 1], [0, 2], [3, 4], [3, 5]]
    job = job_of(oracle, [S, P, S, P, P, P], tool=[0, 0, 1, 1, 0, 1])
    assert pairs_of(job) == [[0, 1], [0, 4], [2, 3], [2, 5]]


@pytest.mark.parametrize("how", ["pause", "tool"])
def test_what_is_printed_first_after_a_pause_or_tool_change_stays_first(
    oracle: Any, how: str
) -> None:
    """The slicer chose where the blob of a nozzle that stood still goes."""
    tool = [0, 0, 1, 1, 1] if how == "tool" else [0] * 5
    job = job_of(oracle, [P, P, F, P, P], epoch=[0, 0, 1, 1, 1], tool=tool)
    if how == "pause":
        assert pairs_of(job) == []
        job = replace(job, refills=(1,))
    assert pairs_of(job) == [[2, 3], [2, 4]]


def test_what_has_no_role_primes_only_where_others_have_one(oracle: Any) -> None:
    """A start script's purge line has no role; in a file without roles nothing is said."""
    assert pairs_of(job_of(oracle, [U, U, P, F, U])) == [[0, 1], [1, 2], [1, 3], [1, 4]]
    assert pairs_of(job_of(oracle, [C, P, F])) == [[0, 1], [0, 2]]
    assert pairs_of(job_of(oracle, [U, U, U])) == [[0, 1], [0, 2]]  # at least the first


def ring(x: float, y: float, half: float, z: float) -> list[tuple[float, float, float]]:
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]
    return [(x + half * a, y + half * b, z) for a, b in corners]


def unnamed(oracle: Any, purge: int, skirt: int, skirt_layers: int) -> Contours:
    """Purge lines, a skirt of two loops round two parts of two shells, three layers, no roles."""
    lines, layers = [], []
    for k in range(3):
        z = 0.2 * (k + 1)
        loops = [[(-40.0, 2.0 * j, z), (-30.0, 2.0 * j, z)] for j in range(purge if k == 0 else 0)]
        loops += [ring(20, 0, 25 - 0.4 * j, z) for j in range(skirt if k < skirt_layers else 0)]
        loops += [ring(x, 0, half, z) for x in (10, 30) for half in (4.0, 3.6)]
        lines += loops
        layers += [k] * len(loops)
    return oracle.make_contours(lines, layer=layers)


@pytest.mark.parametrize(
    ("purge", "skirt", "skirt_layers", "primes"),
    [(2, 2, 1, 4), (2, 0, 1, 2), (0, 2, 1, 2), (0, 2, 3, 2), (3, 2, 2, 5), (0, 0, 0, 1)],
)
def test_without_roles_the_parts_shape_says_what_primes(
    oracle: Any, purge: int, skirt: int, skirt_layers: int, primes: int
) -> None:
    """Purge lines carry nothing; a skirt, tall or not, goes round all else of its layer."""
    contours = unnamed(oracle, purge, skirt, skirt_layers)
    graph = prime_first(
        DependencyGraph.from_pairs(len(contours), NOTHING), PrintJob("unnamed", contours)
    )
    relation = before(graph)
    assert relation[primes:, :primes].all()
    assert not relation[primes:, primes:].any()


def test_a_print_of_one_layer_without_roles_stays_free(oracle: Any) -> None:
    """A test pattern of lines: each is as loose as the next, only the first is held."""
    assert pairs_of(job_of(oracle, [U] * 6)) == [[0, k] for k in range(1, 6)]


@pytest.mark.parametrize("seed", range(12))
def test_closure_is_the_definitions_and_nothing_follows_from_the_rest(
    oracle: Any, seed: int
) -> None:
    """Random prints with two epochs, skirts and a graph of their own."""
    contours = oracle.random_print(seed if seed % 2 else 3 * seed, n_layers=4)
    rng = np.random.default_rng(seed)
    role = contours.role.copy()
    for e in np.unique(contours.epoch):
        mine = np.flatnonzero(contours.epoch == e)
        role[mine[: int(rng.integers(0, min(5, len(mine)) + 1))]] = int(S)
    contours = replace(contours, role=role)
    graph = build_graph(contours, [oracle.heads["box"]], clearance_mm=0.0, quality=True)
    refills = tuple(e for e in (0, 1) if rng.random() < 0.5)
    due = before(graph)
    for e in np.unique(contours.epoch).tolist():
        mine = np.flatnonzero(contours.epoch == e)
        count = next((k for k, c in enumerate(mine) if role[c] != S), len(mine))
        count = max(count, int(e in refills))
        for k in range(count):
            due[mine[k + 1 :], mine[k]] = True
    for k in range(len(due)):
        due |= due[:, k, None] & due[None, k]
    result = prime_first(graph, PrintJob("random", contours, refills=refills))
    np.testing.assert_array_equal(before(result), due)
    for a, b in result.pairs().tolist():
        assert not (due[b] & due[:, a]).any(), (a, b)


def test_a_brim_stays_before_what_touches_it(oracle: Any) -> None:
    """Also the brim of a second part, printed after the first part."""
    lines = [
        [(0, 0, 0.2), (5, 0, 0.2)], [(20, 0.4, 0.2), (25, 0.4, 0.2)], [(20, 0, 0.2), (25, 0, 0.2)],
    ]  # fmt: skip
    contours = oracle.make_contours(lines, role=[int(P), int(S), int(P)])
    head = [oracle.head_of((5.0, [oracle.box(-1, -1, 1, 1)]))]
    graph = build_graph(contours, head, clearance_mm=0.0, process_order="free")
    assert graph.pairs().tolist() == [[1, 2]]
    assert graph.kinds.tolist() == [EdgeKind.PRIMING]


def test_an_edge_that_is_there_keeps_its_kind(oracle: Any) -> None:
    """The reason shown is the one that can not be negotiated."""
    job = job_of(oracle, [S, P])
    graph = prime_first(DependencyGraph.from_pairs(2, np.array([[0, 1]], np.int32)), job)
    assert graph.kinds.tolist() == [EdgeKind.GEOMETRY]


def test_nothing_and_one_contour(oracle: Any) -> None:
    """A vase is one contour; an empty print has nothing to prime."""
    for n in (0, 1):
        job = PrintJob("few", oracle.make_contours([[(0, 0, 0.2), (1, 0, 0.2)]] * n))
        assert prime_first(DependencyGraph.from_pairs(n, NOTHING), job).n_edges == 0


def test_edges_stay_few(oracle: Any) -> None:
    """A hundred brim loops before a thousand lines take about as many edges as contours."""
    job = job_of(oracle, [S] * 100 + [F] * 1000)
    assert len(pairs_of(job)) == 99 + 1000
