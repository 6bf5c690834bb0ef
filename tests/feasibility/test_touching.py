"""Which touching contours keep the slicer's order."""

from __future__ import annotations

from typing import Any

import pytest

from decmcts.feasibility.build import build_graph
from decmcts.feasibility.graph import EdgeKind
from decmcts.print.contours import Role

INNER, BRIDGE, GAP, TOP = Role.PERIMETER, Role.BRIDGE_INFILL, Role.GAP_FILL, Role.TOP_SOLID_INFILL


def kind(
    oracle: Any, first: Role, second: Role, *, process: Any = "free", apart: float = 0.4
) -> int:
    """The kind of the edge between two lines beside each other on one layer, 0: none."""
    lines = [[(0, 0, 0.2), (5, 0, 0.2)], [(0, apart, 0.2), (5, apart, 0.2)]]
    contours = oracle.make_contours(lines, role=[int(first), int(second)])
    graph = build_graph(
        contours, [oracle.heads["box"]], clearance_mm=0.0, process_order=process, quality=True
    )
    return int(graph.kinds[0]) if graph.n_edges else 0


@pytest.mark.parametrize("second", [INNER, BRIDGE, GAP, TOP, Role.OVERHANG_PERIMETER])
def test_what_hangs_on_a_perimeter_comes_after_it(oracle: Any, second: Role) -> None:
    """A bridge in the air has nothing to hold on to before its anchor is there."""
    assert kind(oracle, INNER, second) == EdgeKind.QUALITY


@pytest.mark.parametrize(
    ("first", "second"),
    [(Role.INFILL, INNER), (Role.INFILL, Role.INFILL), (Role.SUPPORT, Role.SUPPORT)],
)
def test_order_without_meaning_stays_free(oracle: Any, first: Role, second: Role) -> None:
    """Who prints infill first, or infill beside infill, asks for nothing here."""
    assert kind(oracle, first, second) == 0


def test_shells_stay_as_sliced_beside_the_process_order(oracle: Any) -> None:
    """Inner perimeters are of one role, so `keep` alone lets them change places."""
    assert kind(oracle, INNER, INNER, process="keep") == EdgeKind.QUALITY
    assert kind(oracle, INNER, Role.EXTERNAL_PERIMETER, process="keep") == EdgeKind.PROCESS
    assert kind(oracle, Role.EXTERNAL_PERIMETER, INNER) == EdgeKind.QUALITY
    assert kind(oracle, INNER, INNER, apart=0.5) == 0


def test_ironing_and_unknown_roles(oracle: Any) -> None:
    """Ironing smooths what is there; of what has no role anything may hang on anything."""
    assert kind(oracle, TOP, Role.IRONING) == EdgeKind.QUALITY
    assert kind(oracle, Role.IRONING, TOP) == 0
    assert kind(oracle, Role.UNKNOWN, Role.UNKNOWN) == EdgeKind.QUALITY


def test_an_edge_says_why(oracle: Any) -> None:
    """A user asks why one thing waits for another."""
    lines = [[(0, 0, 0.2), (5, 0, 0.2)], [(0, 0.4, 0.2), (5, 0.4, 0.2)]]
    contours = oracle.make_contours(lines, role=[int(INNER), int(BRIDGE)])
    graph = build_graph(
        contours, [oracle.heads["box"]], clearance_mm=0.0, process_order="free", quality=True
    )
    assert graph.kinds.tolist() == [EdgeKind.QUALITY]
