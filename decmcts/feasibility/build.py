"""The dependency graph of a print for the heads that may print it.

Turns contours and heads into kernel arrays, runs the walk and words what it
finds for people. The geometry itself lives in `decmcts.feasibility.clearance_kernels`, the
order of the walk in `decmcts.feasibility.closure_kernels`.

Contours of one layer that touch keep the slicer's order by their roles. Process order `keep` holds
whatever has different roles. Quality holds what a slicer would never turn round: the shells of an
island (inner and outer perimeters as sliced), what is anchored in them (infill, bridges, gap fill,
top surfaces after the perimeters they start from), ironing after what it irons, and contours of
which nothing is known. Always, a brim stays before what touches it. That what lies below comes
first needs no rule: material above always blocks the head.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from decmcts.feasibility.clearance_kernels import Centrelines
from decmcts.feasibility.closure_kernels import (
    NO_EDGE,
    WORD,
    ClosureRules,
    Edges,
    close,
    walk_columns,
)
from decmcts.feasibility.contacts import Contacts, find_contacts, words_of
from decmcts.feasibility.graph import DependencyGraph, EdgeKind
from decmcts.feasibility.packed_head import pack_contours, pack_heads
from decmcts.print.contours import Contours, Role
from decmcts.print.machine import Head

ROWS_BYTES = 512 * 2**20  # memory of one column block of ancestor bits


def build_graph(
    contours: Contours,
    heads: Sequence[Head],
    *,
    clearance_mm: float,
    process_order: Literal["keep", "free"] = "keep",
    quality: bool = False,
    bead_width: bool = True,
    contacts: Contacts | None = None,
) -> DependencyGraph:
    """Return the exact dependency graph, transitively reduced but for its CONTACT edges.

    Parameters
    ----------
    contours : Contours
        The print, in source order.
    heads : Sequence[Head]
        The heads that may print it; an edge of any of them counts for all.
    clearance_mm : float
        Kept between head slices and printed beads, mm.
    process_order : {"keep", "free"}
        Whether touching contours of different roles on a layer keep their order.
    quality : bool
        Whether shells, and what is anchored in them, keep their order where they
        touch; see `decmcts.feasibility.build`.
    bead_width : bool
        Whether material has its beads' width, or is a centreline as in the paper.
    contacts : Contacts | None
        Of these contours and heads (`decmcts.feasibility.contacts`); None: they are found here.

    Returns
    -------
    DependencyGraph
        Its transitive closure is that of the definition in docs/definitions.md. An
        edge with several reasons carries the least negotiable kind: CONTACT, then STATE, then
        GEOMETRY, then PRIMING (a brim and what touches it), then PROCESS, then QUALITY.

    Raises
    ------
    CollisionError
        If in the source an earlier contour already blocks a head at a later one, deeper than
        contacts may be.

    References
    ----------
    Lensgraf & Mettu 2016; Yoo et al. 2020, Sec. II (dependency graph).
    """
    beads = pack_contours(contours, clearance_mm, bead_width=bead_width)
    brims = bool((contours.role == Role.SKIRT_BRIM).any())
    touching = touching_kinds(process_order=process_order, quality=quality, brims=brims)
    contacts = find_contacts(contours, beads, heads) if contacts is None else contacts
    graph = _build(contours, heads, beads, touching, ROWS_BYTES)
    return graph.with_edges(contacts.ordered, EdgeKind.CONTACT, over=True)


def closure_of(graph: DependencyGraph) -> NDArray[np.uint64]:
    """Return the ancestors of every contour as bits, (n, ceil(n / 64)).

    Bit a % 64 of word [b, a // 64] says that a must be printed before b. Needs
    n² / 8 bytes.
    """
    rows = np.zeros((graph.n, -(-graph.n // WORD)), np.uint64)
    close(graph.pred_offsets, graph.preds, rows)
    return rows


def _build(
    contours: Contours,
    heads: Sequence[Head],
    beads: Centrelines,
    touching: NDArray[np.uint8],
    rows_bytes: int,
) -> DependencyGraph:
    """Build as `build_graph`, with the memory limit of a column block as an argument."""
    n = len(contours)
    if n == 0:
        return DependencyGraph.from_pairs(0, np.empty((0, 2), np.int32))
    head = pack_heads(heads)
    words = words_of(contours, beads)
    rules = ClosureRules(
        contours.layer,
        contours.role,
        contours.epoch,
        contours.width,
        contours.sources,
        touching,
        bool(touching.any()),
    )
    edges = Edges(
        np.full(n, NO_EDGE, np.int64),
        np.empty(4 * n, np.int64),
        np.empty(4 * n, np.int32),
        np.empty(4 * n, np.uint8),
        np.zeros(1, np.int64),
    )
    n_words = len(words.boxes)
    columns = max(1, min(n_words, rows_bytes // (8 * n)))
    for last in range(n_words, 0, -columns):
        first = max(0, last - columns)
        rows = np.empty((n - first * WORD, last - first), np.uint64)
        edges = walk_columns(rows, first * WORD, beads, rules, words, head, edges)
    return _graph_of(edges)


def _graph_of(edges: Edges) -> DependencyGraph:
    count = int(edges.used[0])
    target = np.empty(count, np.int32)
    at = edges.latest.copy()
    while (alive := np.flatnonzero(at != NO_EDGE)).size:
        target[at[alive]] = alive
        at[alive] = edges.older[at[alive]]
    pairs = np.stack([edges.source[:count], target], axis=1)
    return DependencyGraph.from_pairs(len(edges.latest), pairs, edges.kind[:count].copy())


SHELLS = (Role.EXTERNAL_PERIMETER, Role.PERIMETER, Role.OVERHANG_PERIMETER)
ANCHORED = (
    Role.INFILL,
    Role.SOLID_INFILL,
    Role.TOP_SOLID_INFILL,
    Role.BRIDGE_INFILL,
    Role.GAP_FILL,
)


def touching_kinds(
    *, process_order: Literal["keep", "free"], quality: bool, brims: bool = False
) -> NDArray[np.uint8]:
    """Return the `EdgeKind` of a contour of role a touching a later one of role b, 0: none.

    Shape (roles, roles), [a, b]. With `brims` a brim stays before what touches it.
    """
    kinds = np.zeros((len(Role), len(Role)), np.uint8)
    if quality:
        for shell in SHELLS:
            kinds[shell, list(SHELLS + ANCHORED)] = EdgeKind.QUALITY
        kinds[:, Role.IRONING] = EdgeKind.QUALITY
        kinds[Role.UNKNOWN, Role.UNKNOWN] = EdgeKind.QUALITY
    if process_order == "keep":
        kinds[~np.eye(len(Role), dtype=np.bool_)] = EdgeKind.PROCESS
    if brims:
        kinds[Role.SKIRT_BRIM, np.arange(len(Role)) != Role.SKIRT_BRIM] = EdgeKind.PRIMING
    return kinds
