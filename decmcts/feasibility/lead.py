"""How many layers one part of a print may run ahead of the rest.

With a limit of N nothing of layer L + N + 1 is begun before all of layer L is
printed. Said for every pair of contours that is a product of two layers, so on
layers with many contours one contour stands for the rule: the first of layer
L + N in the source, all of layer L before it, it before all of layer L + N + 1.
That is a little stricter than asked, since that one contour is waited for. So is
what rests on nothing: it waits for one contour of the layer below, through which
the layers further down come before it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decmcts.feasibility.graph import DependencyGraph, EdgeKind

DENSE = 8  # edges a contour up to which the pairs themselves are stored

Ints = NDArray[np.int64]


def limit_lead(graph: DependencyGraph, layer: NDArray[np.int32], *, layers: int) -> DependencyGraph:
    """Return the graph with edges that let no contour run more than `layers` layers ahead.

    Where the source itself goes down again (objects printed one by one) the
    limit holds within each climb, so the source stays a solution. With 0 the
    print goes layer by layer.

    Parameters
    ----------
    layer : (n,) layer of each contour in source order
    layers : int
        At least 0.

    Raises
    ------
    ValueError
        If `layers` is negative.
    """
    if layers < 0:
        raise ValueError(f"{layers} layers ahead, expected 0 or more")
    step = np.diff(layer)
    run = np.concatenate([[0], np.cumsum(step != 0)])[: graph.n]
    climb = np.concatenate([[0], np.cumsum(step < 0)])[: graph.n]
    lasts, firsts = _ends(graph, run)
    begins = np.flatnonzero(np.diff(run, prepend=-1))
    pairs = graph.pairs()
    supported = np.zeros(graph.n, np.bool_)  # something of the layer below comes before it
    supported[pairs[run[pairs[:, 0]] == run[pairs[:, 1]] - 1, 1]] = True
    found = [np.empty((0, 2), np.int64)]
    for low in range(len(begins) - layers - 1):
        high = low + layers + 1
        if climb[begins[low]] == climb[begins[high]]:
            # The contour that stands for the rule; for no layer ahead the last of the layer.
            hub = begins[high - 1] if layers else begins[high] - 1
            found.append(_between(lasts[low], firsts[high], hub))
            loose = firsts[high][~supported[firsts[high]]]
            found.append(np.stack([np.full(len(loose), begins[high - 1]), loose], axis=1))
    return _with(graph, np.concatenate(found))


def _ends(graph: DependencyGraph, run: Ints) -> tuple[list[Ints], list[Ints]]:
    """Return of each run the contours nothing of it comes after, and before."""
    pairs = graph.pairs()
    inside = pairs[run[pairs[:, 0]] == run[pairs[:, 1]]]
    last, first = np.ones(graph.n, np.bool_), np.ones(graph.n, np.bool_)
    last[inside[:, 0]] = False
    first[inside[:, 1]] = False
    return _by_run(np.flatnonzero(last), run), _by_run(np.flatnonzero(first), run)


def _by_run(contour: Ints, run: Ints) -> list[Ints]:
    if not len(run):
        return []
    return np.split(contour, np.searchsorted(run[contour], np.arange(1, int(run[-1]) + 1)))


def _between(before: Ints, after: Ints, hub: int) -> Ints:
    """Return edges that put all of `before` before all of `after`, (k, 2)."""
    if len(before) * len(after) <= DENSE * (len(before) + len(after)):
        return np.stack([np.repeat(before, len(after)), np.tile(after, len(before))], axis=1)
    into = before[before != hub]
    return np.concatenate(
        [
            np.stack([into, np.full(len(into), hub)], axis=1),
            np.stack([np.full(len(after), hub), after], axis=1),
        ]
    )


def _with(graph: DependencyGraph, more: Ints) -> DependencyGraph:
    """Return the graph with more edges; one that is there keeps its kind."""
    if not len(more):
        return graph
    there = graph.pairs().astype(np.int64)
    fresh = np.setdiff1d(more @ [graph.n, 1], there @ [graph.n, 1])
    pairs = np.stack([fresh // graph.n, fresh % graph.n], axis=1)
    kinds = np.full(len(pairs), EdgeKind.LEAD, np.uint8)
    return DependencyGraph.from_pairs(
        graph.n,
        np.concatenate([there, pairs]).astype(np.int32),
        np.concatenate([graph.kinds, kinds]),
    )
